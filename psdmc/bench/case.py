"""One robot of the benchmark: its chain with every number known, and its name in tables."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from psdmc.bench.states import sizes_of
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
    """A robot to measure.

    name            in tables
    model           with theta_b known; its chain has no unknown inertia
    note            where its numbers come from
    derive_seconds  how long a warm derivation took, None where the model was given
    derive_bytes    peak memory of a process that did nothing else, None where unknown
    named           functions to measure; empty: those that every robot's benchmark has
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
        return sizes_of(self.chain, self.model.l)

    @property
    def functions(self) -> tuple[str, ...]:
        """The functions that the benchmark measures on this robot."""
        return self.named or tuple(name for name in BENCHED if name not in self.costly)

    @property
    def left_out(self) -> tuple[str, ...]:
        """The functions that the benchmark leaves out because they are costly."""
        return () if self.named else self.costly

    @property
    def costly(self) -> tuple[str, ...]:
        """Derivatives of a robot with more rates than MOST_DIFFERENTIATED."""
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
    """The chain's geometry standing on the floor, with generic physical inertias and no drive inertia.

    So no contestant profits from particular zeros; the same seed gives the same robot.
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
    """(10,) standard parameters of eight point masses at random places: a body that could exist, no entry zero."""
    masses = rng.uniform(0.1, 0.6, size=8)
    places = rng.normal(scale=0.08, size=(8, 3)) + rng.normal(scale=0.05, size=3)
    second = np.einsum("k,ki,kj->ij", masses, places, places)
    return standard_parameters(masses.sum(), times(masses, places), np.trace(second) * np.eye(3) - second)


def refuse_unlike(chain: Mechanism) -> None:
    """InputError where a robot has joints that the rivals' models are not made for."""
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
    """The chain as plain text for rivals: exact placements and bodies about the joint frames, so that no parser is
    involved. InputError as of refuse_unlike.

    n and gravity; then per joint Pinocchio's word for its type, parent (0 the base, else counted from 1), rotation (9,
    row-major), translation (3), body (10 standard parameters about the joint frame) and drive inertia.
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
