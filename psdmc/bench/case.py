"""One robot of the benchmark: its joints and bodies with all numbers known, and its name in tables."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from psdmc.dynamics.parameters import joint_frame_map, standard_parameters
from psdmc.errors import InputError
from psdmc.functions import RECIPES
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program.signature import Sizes
from psdmc.reproducible import times
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import DRIVE, PARAMETERS_PER_LINK, Array, Mechanism

LONGEST_INPUT = 256
"""Positions of the largest robot that the loops take: LONGEST_INPUT of rivals/loops.hpp."""

BENCHED = tuple(name for name, recipe in RECIPES.items() if recipe.benched)
"""The functions that the benchmark measures."""

DIFFERENTIATED = ("_derivatives", "_vjp")
MOST_DIFFERENTIATED = 25
"""Rates up to which functions with these endings are measured: a humanoid's matrices take every contestant minutes to
compile."""

JOINTS = ("RZ", "PZ", "FreeFlyer")
"""Pinocchio's short words for the types that rivals' models have: pinocchio_model.hpp and serial_joints.hpp."""

FLOOR_MOUNT = (0.0, 0.0, -9.81)


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A robot of the benchmark.

    name            name in tables
    model           its model; the base parameters and all inertias are known
    note            where the robot's inertias come from
    derive_seconds  time of a derivation by a process that already has its imports; None if the model was given
    derive_bytes    peak memory of a process that only derived the model; None if unknown
    named           functions to measure; if empty, those that are measured for every robot
    """

    name: str
    model: DynamicsModel
    note: str = ""
    derive_seconds: float | None = None
    derive_bytes: int | None = None
    named: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.chain.nq > LONGEST_INPUT:
            raise InputError(
                f"{self.name}: {self.chain.nq} positions, the benchmark takes {LONGEST_INPUT}",
                "cut a chain out of it with --base and --tip",
            )
        if self.model.theta_b is None or np.isnan(self.chain.parameters).any():
            raise InputError(
                f"{self.name}: the benchmark needs every inertial parameter, and some are unknown",
                "give the links' inertia, or calibrate first",
            )

    @property
    def chain(self) -> Mechanism:
        return self.model.mechanism

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.chain)

    @property
    def sizes(self) -> Sizes:
        return Sizes.of(self.chain, self.model.l)

    @property
    def functions(self) -> tuple[str, ...]:
        """Names of the functions that the benchmark measures for this robot."""
        return self.named or tuple(name for name in BENCHED if name not in self.costly)

    @property
    def left_out(self) -> tuple[str, ...]:
        """Names of the functions that the benchmark leaves out for this robot because they take too long."""
        return () if self.named else self.costly

    @property
    def costly(self) -> tuple[str, ...]:
        """Return the names of the derivative functions that the benchmark leaves out for this robot. They take too long
        if the robot has more than MOST_DIFFERENTIATED degrees of freedom."""
        large = self.chain.nv > MOST_DIFFERENTIATED
        return tuple(name for name in self.named or BENCHED if large and name.endswith(DIFFERENTIATED))

    @property
    def is_wide(self) -> bool:
        """Whether some joint has several coordinates."""
        return any(not kind.about_z for kind in self.chain.types)

    @property
    def has_drive_inertia(self) -> bool:
        return bool(np.any(self.chain.parameters[:, DRIVE] != 0.0))


def generic_chain(chain: Mechanism, seed: int) -> Mechanism:
    """Return a robot with the joints and lengths of the given robot and random, physically possible inertias. The robot
    has no drive inertia, and gravity is along -z.

    As no inertia is zero, no library profits from zeros. Equal seeds give equal robots.
    """
    rng = np.random.default_rng(seed)
    n = len(chain)
    parameters = np.array([[*physical_body(rng), 0.0] for _ in range(n)])
    free = [j for j in range(PARAMETERS_PER_LINK * n) if j % PARAMETERS_PER_LINK != DRIVE]
    return replace(
        chain,
        parameters=parameters,
        parameter_span=np.eye(PARAMETERS_PER_LINK * n)[:, free],
        gravity=np.array(FLOOR_MOUNT),
    )


def physical_body(rng: np.random.Generator) -> Array:
    """Return the ten standard parameters (mass, first moments, inertia) of a random body that is physically possible.
    The body consists of eight point masses; no parameter is zero."""
    masses = rng.uniform(0.1, 0.6, size=8)
    places = rng.normal(scale=0.08, size=(8, 3)) + rng.normal(scale=0.05, size=3)
    second = np.einsum("k,ki,kj->ij", masses, places, places)
    return standard_parameters(masses.sum(), times(masses, places), np.trace(second) * np.eye(3) - second)


def refuse_unlike(chain: Mechanism) -> None:
    """Raise InputError if the robot has joints that the benchmark cannot build in the other libraries."""
    for i, joint in enumerate(chain.joints):
        if joint.type.pinocchio not in JOINTS:
            raise InputError(
                f"joint {shown(joint.name)} {joint.type.verb}: the rivals' models are of {', '.join(JOINTS)}",
                "leave this rival out",
            )
        if i not in chain.own_joints:
            raise InputError(
                f"joint {shown(joint.name)} follows another, which the rivals' models leave out",
                "hold it with --lock",
            )


def robot_as_numbers(chain: Mechanism) -> str:
    """Return the robot as plain text for the C++ programs of other libraries, so that they need no parser for robot
    files. Raise InputError as refuse_unlike does.

    The text has the number n of joints, and gravity. Then follow, for each joint: Pinocchio's name of the joint type,
    the parent (0: base, else from 1), rotation (9, row-major), translation (3), body (10 standard parameters about the
    joint frame) and drive inertia.
    """
    refuse_unlike(chain)
    lines = [f"{len(chain)} {_numbers(chain.gravity)}"]
    for joint, parent, row in zip(chain.joints, chain.parents, chain.parameters, strict=True):
        body = times(joint_frame_map(joint.link_frame), row[:DRIVE])
        placement = joint.placement
        lines.append(
            f"{joint.type.pinocchio} {parent + 1} {_numbers(placement.rotation)} {_numbers(placement.translation)} "
            f"{_numbers(body)} {float(row[DRIVE])!r}"
        )
    return "\n".join(lines)


def _numbers(values: Array) -> str:
    return " ".join(repr(value) for value in np.ravel(values).tolist())
