"""Decides whether moving links without inertia in a URDF are massless or have unknown inertia. They are massless by
the URDF standard. They are unknown if the user says so, or if no moving link of the file has an inertia.

A link counts together with all links that are fixed to it, so a frame without inertia on a heavy link is not affected.
"""

from __future__ import annotations

import shlex
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from psdmc.errors import WARNING, InputError
from psdmc.robot.limits import listed, shown
from psdmc.robot.mechanism import BODY_PARAMETERS, DRIVE, Array, Mechanism, Placement
from psdmc.robot.urdf.read_urdf import UrdfRobot
from psdmc.robot.urdf.tree import Route

ALL = "all"
MISSING = "missing"
"""Words of --unknown: every moving link, and those without inertia in the file."""

MOST_NAMED = 3
"""Links that a warning names."""


@dataclass(frozen=True, slots=True, eq=False)
class JudgedBodies:
    """The inertias of n moving links, after the decision which links are massless and which are unknown.

    parameters  n (11,), NaN if unknown
    zeros       n tuples of parameters assumed zero: the mass of massless links
    massless    names of the links without inertia in the file that are treated as massless
    """

    parameters: tuple[Array, ...]
    zeros: tuple[tuple[str, ...], ...]
    massless: tuple[str, ...]
    notes: tuple[str, ...]


def judged_bodies(
    robot: UrdfRobot,
    route: Route,
    bodies: Sequence[Mapping[str, Placement]],
    merged: Sequence[Array],
    unknown: Sequence[str],
    source: str,
) -> JudgedBodies:
    """Return the inertias of the links that the selected movable joints move. Inertias are unknown for links that
    `unknown` names, and for all links if no moving link of the file has an inertia.

    bodies   for each joint, the links that move with it
    merged   for each joint, the parameters (10,) of these links together

    Raises InputError if `unknown` names a link that does not move.
    """
    children = [joint.child for joint in route.movable]
    bare = [robot.inertials[link] is None and not x.any() for link, x in zip(children, merged, strict=True)]
    is_unknown = _unknown(bodies, bare, unknown, robot.inertials, source)
    notes: tuple[str, ...] = ()
    if any(bare) and not any(is_unknown) and not any(x.any() for x in merged):
        is_unknown, notes = (
            bare,
            (
                f"no moving link has <inertial>, so all inertial parameters are unknown, as with --unknown {ALL}: "
                "find them with psdmc calibrate, or add <inertial>",
            ),
        )
    rows = list(zip(route.movable, merged, bare, is_unknown, strict=True))
    return JudgedBodies(
        parameters=tuple(
            np.append(np.full(BODY_PARAMETERS, np.nan) if open_ else x, 0.0) for _, x, _, open_ in rows
        ),
        zeros=tuple(("m",) if not (open_ or x.any()) else () for _, x, _, open_ in rows),
        massless=tuple(joint.child for joint, _, is_bare, open_ in rows if is_bare and not open_),
        notes=notes,
    )


def _unknown(
    bodies: Sequence[Mapping[str, Placement]],
    bare: Sequence[bool],
    words: Sequence[str],
    links: Container[str],
    source: str,
) -> list[bool]:
    """Find the bodies that the words name, by any of their links. `links` are the file's."""
    moving = [link for body in bodies for link in body]
    strange = [word for word in words if word not in (ALL, MISSING, *moving)]
    if strange:
        link = shown(strange[0])
        bare_word = link.strip("'\"")
        fault = (
            f"link {link} does not move, so its inertia has no effect"
            if strange[0] in links
            else f"there is no link {link}"
        )
        raise InputError(
            f"{source}: --unknown {bare_word}: {fault}",
            f"moving links: {listed(moving)}; --unknown {ALL} is all of them, --unknown {MISSING} those without <inertial>",
        )
    return [
        any(word in (ALL, *body) or (word == MISSING and is_bare) for word in words)
        for body, is_bare in zip(bodies, bare, strict=True)
    ]


def with_massless_warning(chain: Mechanism) -> Mechanism:
    """Return the mechanism with a warning about massless links as the first note. The note names the links, what psdmc
    cannot generate because of them, and the option that makes their inertia unknown."""
    if not chain.massless:
        return chain
    idle = [chain.joints[i].name for i in idle_joints(chain)]
    plural, verb = ("", "moves") if len(idle) == 1 else ("s", "move")
    lost = (
        f" Joint{plural} {listed(idle, MOST_NAMED)} {verb} no inertia: forward dynamics cannot be generated."
    )
    option, count = unknown_option(chain), len(chain.massless)
    if count == 1:
        said = f"{massless_words(chain)}: treated as massless."
        remedy = f"keep its parameters as unknowns with {option}"
    else:
        said = f"{count} links have no <inertial> and are treated as massless: {listed(chain.massless, MOST_NAMED)}."
        every = " (all such links)" if count > MOST_NAMED else ""
        remedy = f"type {option}{every} to keep their parameters as unknowns"
    note = f"{WARNING}{said}{lost if idle else ''} Add <inertial>, or {remedy}."
    return replace(chain, notes=(note, *chain.notes))


def massless_words(chain: Mechanism) -> str:
    """Return the start of a sentence on links without inertia, such as "link 'fore' has no <inertial>"."""
    if len(chain.massless) == 1:
        return f"link '{chain.massless[0]}' has no <inertial>"
    return f"{len(chain.massless)} links ({listed(chain.massless, MOST_NAMED)}) have no <inertial>"


def unknown_option(chain: Mechanism) -> str:
    """Return the option of the command line, quoted for a shell, that makes the inertia of massless links unknown."""
    few = len(chain.massless) <= MOST_NAMED
    return f"--unknown {shlex.quote(','.join(chain.massless)) if few else MISSING}"


def idle_joints(chain: Mechanism) -> tuple[int, ...]:
    """Return the joints that move no mass, inertia or drive inertia, not even through mimic joints."""
    moved = {i for body, x in enumerate(chain.parameters) if x[:DRIVE].any() for i in chain.path_to(body)}
    moved |= {i for i, x in enumerate(chain.parameters) if x[DRIVE] != 0.0}
    moving = {leader for i in moved for leader, _ in chain.coordinates[i].shares}
    return tuple(i for i in chain.own_joints if i not in moving)
