"""Draws a robot on an HTML page in 3D: links, axes, frames, bodies of file and calibration, and logs."""

from __future__ import annotations

import html
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from psdmc.backends.c.render import environment
from psdmc.calibration.campaign_file import is_campaign, listed_runs
from psdmc.calibration.description.description import is_description
from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.logs.log_checks import checked
from psdmc.calibration.sources import plain_sources
from psdmc.derivation.derive import provenance_of
from psdmc.dynamics.coordinates import neutral
from psdmc.dynamics.frames import frames_of
from psdmc.dynamics.kinematics import forward_kinematics
from psdmc.errors import InputError
from psdmc.files import refuse_foreign_file, write_whole
from psdmc.links.physical_links import physical_links
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.progress import Progress, silent
from psdmc.report.calibrate_tables import table
from psdmc.robot.inertia import about_com, inertia_matrix, physical_fault
from psdmc.robot.limits import listed, shown
from psdmc.robot.load import LoadedRobot
from psdmc.robot.mechanism import (
    BASE,
    BODY_PARAMETERS,
    PARAMETERS_PER_LINK,
    Array,
    Mechanism,
    Placement,
    require_axes,
)
from psdmc.robot.urdf.dependent_joints import locked
from psdmc.robot.urdf.read_urdf import read_urdf
from psdmc.robot.urdf.urdf_draft import bodies_of, body_parameters, on_floating_base

MARK = '<meta name="generator" content="psdmc view">'
"""What every page of `psdmc view` holds."""
MOST_POSES = 240
"""Of a log's rows, spread evenly: smooth to the eye, and a page of a small arm grows by 200 kB."""
MOST_NUMBERS = 400_000
"""Of all poses of a page: 4 MB of text."""
CUTOFF = 1.0
"""Hz, for the checks of a log: the page filters nothing, so slow logs are welcome."""
DENSEST = 22_600.0
"""kg/m^3: osmium. Of all bodies of a mass and density, a solid ellipsoid has the smallest determinant of second moments, so
a body whose ellipsoid is denser is made of no material."""
FLAT = 1e-3
"""Share of an ellipsoid's longest semi-axis below which another one says nothing about density: files round inertias."""
ROUNDING = 1e-12
"""Share of m |com|^2, which moving an inertia to its centre of mass subtracts, that is rounding."""
SAME = 1e-9
"""Share of a robot's mass by which a model without a load may differ from its file."""
AXIS = 0.08
"""Length of drawn axes, as a share of the robot's size."""
FILE, CALIBRATED = "file", "calibrated"
COLOURS = {FILE: "#3b7dd8", CALIBRATED: "#d97a02"}
NOT_PHYSICAL = "#d81b9a"
YELLOW = "#e0a000"
AXIS_COLOURS = ("#d62728", "#2ca02c", "#1f5fd0")
"""Of x, y and z."""


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """A body in the 3D picture: the position of its centre of mass, and the ellipsoid that shows its inertia.

    joint      number of the joint frame with which the body moves
    mass       kg
    com        (3,) m, centre of mass in the joint frame
    place      (3,) m, the centre of mass again, but in the frame of the link
    half_axes  (3,) m, ascending: semi-axes of the solid ellipsoid that has this mass and inertia; zero for a
               semi-axis whose square would be negative
    root       (3, 3) m, symmetric matrix in the joint frame: com + root u, for all unit vectors u, is the surface of the
               ellipsoid
    fault      text that says why no real body can have this mass and inertia; empty if no fault was found
    """

    link: str
    joint: int
    mass: float
    com: Array
    place: Array
    half_axes: Array
    root: Array
    fault: str

    @property
    def density(self) -> float:
        """Return the density of the ellipsoid in kg/m^3; NaN if the ellipsoid is flat."""
        if not self.half_axes[0] > FLAT * self.half_axes[2]:
            return math.nan
        return self.mass / (4.0 / 3.0 * math.pi * float(np.prod(self.half_axes)))


def body(link: str, joint: int, frame: Placement, x: Array, judged: bool = True) -> Body:
    """Return the drawn body from standard parameters x (10,) about a link frame: mass, first moments, inertia. `frame`
    is the placement of the link frame in the joint frame.

    judged   whether to test if a real body can have these parameters; not for zeros that psdmc assumed
    """
    mass, com, six = about_com(x)
    six = np.where(np.abs(six) > ROUNDING * mass * float(com @ com), six, 0.0)
    fault = (physical_fault(mass, six) if judged else None) or ""
    inertia = frame.rotation @ inertia_matrix(six) @ frame.rotation.T
    # a_i^2 = 5 / (2 m) (I_j + I_k - I_i): eigenvalues of this matrix
    squares, axes = np.linalg.eigh((2.5 * np.trace(inertia) * np.eye(3) - 5.0 * inertia) / (mass or math.inf))
    half = np.sqrt(np.maximum(squares, 0.0))
    at = frame.translation + frame.rotation @ com
    found = Body(link, joint, mass, at, com, half, (axes * half) @ axes.T, fault)
    if fault or not judged or not found.density > DENSEST:
        return found
    return replace(found, fault=f"its ellipsoid has {found.density:.3g} kg/m^3, more than any metal")


@dataclass(frozen=True, slots=True, eq=False)
class Viewed:
    """The content of the 3D page: bodies, remarks, and the motion as F poses of the n joint frames.

    layers   the bodies of the robot file, and those of a calibration: FILE or CALIBRATED -> bodies
    faults   texts on bodies that cannot be real and on missing inertias, the worst first
    notes    further remarks
    poses    (F, n, 12) rotation (rows) and origin (m) of each joint frame in the base frame
    times    F times in s;  logs   F names of logs; both empty without a log
    """

    chain: Mechanism
    layers: Mapping[str, Sequence[Body]]
    faults: tuple[str, ...]
    notes: tuple[str, ...]
    poses: Array
    times: tuple[float, ...] = ()
    logs: tuple[str, ...] = ()


def viewed(
    robot: DynamicsModel | LoadedRobot, log: str | Path | None = None, progress: Progress = silent
) -> Viewed:
    """Collect the content of a page for a model or a robot file, at rest or in the motion of logs.

    Raise InputError if a log cannot be used, as in a calibration.
    """
    chain = robot.mechanism
    own = _own_links(robot)
    merged = [
        body(joint.link_name, k, joint.link_frame, x[:BODY_PARAMETERS], _is_judged(chain, k))
        for k, (joint, x) in enumerate(zip(chain.joints, chain.parameters, strict=True))
        if not np.isnan(x[:BODY_PARAMETERS]).any() and x[:BODY_PARAMETERS].any()
    ]
    layers, notes = {FILE: own or merged}, []
    if isinstance(robot, DynamicsModel) and robot.calibrated is not None:
        progress("finding physical links")
        try:
            found = physical_links(robot).parameters[:, :BODY_PARAMETERS]
            layers = {
                FILE: merged,  # base parameters are of what moves together, as one body
                CALIBRATED: [
                    body(joint.link_name, k, joint.link_frame, found[k], judged=False)
                    for k, joint in enumerate(chain.joints)
                    if found[k][0] > 0.0
                ],
            }
            notes.append(
                "Many masses and inertias have the model's base parameters. The page draws those nearest to the file's, "
                "as psdmc export-urdf writes them."
            )
        except InputError as error:
            notes.append(f"The model's bodies are not drawn: {error.message}.")
        if robot.calibrated.verdict is not None:
            notes.append(f"Verdict of the calibration: {robot.calibrated.verdict.word}.")
    faults = [f"link {shown(each.link)}: {each.fault}" for each in (own or merged) if each.fault]
    unknown = [j.link_name for j, bad in zip(chain.joints, chain.has_unknown_body, strict=True) if bad]
    if unknown or chain.massless:
        notes.insert(0, f"The inertia of these links is unknown: {listed([*unknown, *chain.massless])}.")
    poses, times, logs = _motion(chain, log, progress)
    return Viewed(chain, layers, tuple(faults), tuple(notes), poses, times, logs)


def _is_judged(chain: Mechanism, k: int) -> bool:
    """Whether no moment of inertia of link k is assumed zero."""
    first = PARAMETERS_PER_LINK * k
    return bool(chain.parameter_span[[first + 4, first + 6, first + 9]].any(axis=1).all())


def _own_links(robot: DynamicsModel | LoadedRobot) -> list[Body]:
    """Every link of a URDF that moves, none merged; empty for other files, and for models with a load or without source."""
    kept = provenance_of(robot) if isinstance(robot, LoadedRobot) else robot.provenance
    if kept.get("source_format") != "urdf" or not {"source_text", "options"} <= set(kept):
        return []
    name, options = str(kept.get("source_name", "robot")), kept["options"]
    read = locked(read_urdf(kept["source_text"], name), options.get("lock") or {}, name)
    read = on_floating_base(read) if options.get("floating") else read
    joints, chain = {joint.name: joint for joint in read.joints}, robot.mechanism
    if not set(chain.joint_names) <= set(joints):
        return []  # edited by hand
    below = bodies_of(read, [joints[joint.name] for joint in chain.joints])
    found = [
        body(link, k, joint.link_frame @ place, body_parameters(read.inertials[link], Placement.identity()))
        for k, (joint, links) in enumerate(zip(chain.joints, below, strict=True))
        for link, place in links.items()
        if read.inertials[link] is not None
    ]
    masses = chain.parameters[:, 0]
    has_load = abs(sum(each.mass for each in found) - masses.sum()) > SAME * masses.sum()
    return [] if has_load else found


def _motion(
    chain: Mechanism, log: str | Path | None, progress: Progress
) -> tuple[Array, tuple[float, ...], tuple[str, ...]]:
    """Poses, times and names of logs: of rows spread evenly over all logs."""
    if log is None:
        return _poses(chain, np.array([neutral(frames_of(chain))])), (), ()
    require_axes(chain, "the motion of a log")
    path = Path(log)
    is_runs = is_campaign(path) and not is_description(path)
    paths = [run.log for run in listed_runs(path)] if is_runs else [path]
    read = plain_sources(paths, chain.joint_names, LinearOptions(), progress).logs
    logs = [checked(one, chain, CUTOFF) for one in read]
    ends = np.cumsum([len(one) for one in logs])
    count = max(1, min(MOST_POSES, int(ends[-1]), MOST_NUMBERS // (12 * len(chain))))
    rows, times, names = [], [], []
    for row in np.linspace(0, ends[-1] - 1, count).astype(int):
        k = int(np.searchsorted(ends, row, side="right"))
        at = int(row - (ends[k] - len(logs[k])))
        one = logs[k].rows(at, at + 1)
        rows.append(one.position[0, list(chain.own_joints)])
        times.append(float(one.time[0] - logs[k].time[0]))
        names.append(one.name)
    return _poses(chain, np.array(rows)), tuple(times), tuple(names)


def _poses(chain: Mechanism, q: Array) -> Array:
    """(F, n, 12) joint frames at positions (F, nq)."""
    found = np.empty((len(q), len(chain), 12))
    for k, (rotation, origin) in enumerate(forward_kinematics(frames_of(chain), list(q.T))):
        for entry, value in enumerate((*(x for row in rotation for x in row), *origin)):
            found[:, k, entry] = value
    return found


# The page


def write_view(view: Viewed, path: str | Path) -> None:
    """Write the 3D page of a robot. Raise InputError without plotly, or if the path has another file."""
    try:
        from plotly.offline import get_plotlyjs
    except ImportError:
        raise InputError(
            "psdmc view draws with plotly, which is not installed", "pip install 'psdmc[view]'"
        ) from None
    require_own_page(path)
    write_whole(path, page(view, str(get_plotlyjs())))


def require_own_page(path: str | Path) -> None:
    """Raise InputError if the path has a file that `psdmc view` did not write."""
    refuse_foreign_file(path, MARK, "give another name with -o FILE.html, or move the file")


def page(view: Viewed, script: str) -> str:
    """The page as text; `script` is Plotly's."""
    template = environment().overlay(autoescape=True).get_template("report/view.html.jinja")
    return template.render(
        view=view,
        bodies=body_table(view),
        mark=MARK,
        plotly=script,
        scene=embedded(scene(view)),
        unphysical=NOT_PHYSICAL,
        colours=COLOURS,
    )


def embedded(value: Any) -> str:
    """Return a value as JSON for an HTML <script> element, escaped so that no text can end the element."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def body_table(view: Viewed) -> str:
    """Return an HTML table of all bodies, link by link."""
    head = ["Link", "From", "Mass [kg]", "Centre of mass in the link [m]", "Semi-axes [m]", "Density [kg/m³]"]
    bodies = [(name, each) for name, found in view.layers.items() for each in found]
    rows = [
        [each.link, name, f"{each.mass:.5g}", _listed(each.place), _listed(each.half_axes), _density(each)]
        for name, each in sorted(bodies, key=lambda row: row[1].joint)
    ]
    return table(head, rows)


def _density(each: Body) -> str:
    if each.fault:
        return "not physical"
    return "flat" if math.isnan(each.density) else f"{each.density:.4g}"


def _listed(values: Array) -> str:
    return ", ".join(f"{value + 0.0:.4g}" for value in _rounded(values, 6))


def _rounded(values: Array, digits: int) -> list[Any]:
    """Lists of numbers without the last digits, which differ between processors."""
    found: list[Any] = (np.round(values, digits) + 0.0).tolist()
    return found


def scene(view: Viewed) -> dict[str, Any]:
    """Return the data that the page's script draws. Points are [joint, x, y, z] in a joint frame, or in the base frame
    if joint is -1. Names are escaped, because Plotly reads markup in them."""
    chain = view.chain
    origins = view.poses[0, :, 9:]
    size = float(np.ptp(np.vstack([np.zeros(3), origins, *_ends(view)]), axis=0).max()) or 1.0
    length = AXIS * size
    lines = [("links", 7, None, _links(chain)), ("joint axes", 4, YELLOW, _axes(chain, length))]
    lines += [("named frames", 5, AXIS_COLOURS[k], _frames(chain, length, k)) for k in range(3)]
    layers: list[dict[str, Any]] = [
        {"kind": "segments", "name": name, "width": width, "colour": colour, "items": items}
        for name, width, colour, items in lines
    ]
    for name, bodies in view.layers.items():
        for kind, what in (("points", "centres of mass"), ("ellipsoids", "inertia")):
            for is_fault in (False, True):
                chosen = [_drawn(each, name) for each in bodies if bool(each.fault) is is_fault]
                colour = NOT_PHYSICAL if is_fault else COLOURS[name]
                said = f"{name}: {what}" + (", not physical" if is_fault else "")
                if chosen:
                    layers.append({"kind": kind, "name": said, "colour": colour, "items": chosen})
    return {
        "layers": layers,
        "poses": _rounded(view.poses.reshape(len(view.poses), -1), 6),
        "times": _rounded(np.array(view.times), 4),
        "logs": list(view.logs),
    }


def _ends(view: Viewed) -> list[Array]:
    """Where named frames and bodies are in the first pose."""
    points = [(frame.joint, frame.placement.translation) for frame in view.chain.frames]
    points += [(each.joint, each.com) for bodies in view.layers.values() for each in bodies]
    return [view.poses[0, k, :9].reshape(3, 3) @ at + view.poses[0, k, 9:] for k, at in points]


def _drawn(each: Body, layer: str) -> dict[str, Any]:
    lines = [each.link, f"{layer}: {each.mass:.5g} kg, semi-axes {_listed(each.half_axes)} m", each.fault]
    return {
        "joint": each.joint,
        "com": _rounded(each.com, 6),
        "root": _rounded(each.root, 6),
        "label": "<br>".join(html.escape(line) for line in lines if line),
    }


def _segment(
    start: tuple[int, Sequence[float] | Array], end: tuple[int, Sequence[float] | Array], label: str
) -> dict[str, Any]:
    ends = [[joint, *_rounded(np.asarray(point), 6)] for joint, point in (start, end)]
    return {"ends": ends, "label": html.escape(label)}


def _links(chain: Mechanism) -> list[dict[str, Any]]:
    """Draw links from joint to joint, and from the last joints to named frames."""
    here = (0.0, 0.0, 0.0)
    joints = [((parent, here), (k, here), chain.parent_link(k)) for k, parent in enumerate(chain.parents)]
    ends: list[tuple[Any, Any, str]] = [
        ((f.joint, here), (f.joint, f.placement.translation), chain.joints[f.joint].link_name)
        for f in chain.frames
    ]
    return [_segment(*each) for each in (*ends, *joints)]


def _axes(chain: Mechanism, length: float) -> list[dict[str, Any]]:
    return [
        _segment((k, (0.0, 0.0, -length)), (k, (0.0, 0.0, length)), f"{joint.name} ({joint.kind})")
        for k, joint in enumerate(chain.joints)
        if joint.type.about_z
    ]


def _frames(chain: Mechanism, length: float, k: int) -> list[dict[str, Any]]:
    """Axis k of the base and of each named frame."""
    placed = [(BASE, Placement.identity(), chain.base_name)]
    placed += [(frame.joint, frame.placement, frame.name) for frame in chain.frames]
    return [
        _segment(
            (joint, at.translation),
            (joint, at.translation + length * at.rotation[:, k]),
            f"{name}: {'xyz'[k]}",
        )
        for joint, at, name in placed
    ]
