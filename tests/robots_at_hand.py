"""The robots that accuracy is promised on: bundled, other people's, and generic ones; each with Pinocchio's own model."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from bundled import ROBOTS, robot_path
from installed import in_wheel
from random_chains import Oracle, random_chain

from psdmc.derivation.derive import derive_model, provenance_of
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.load import LoadedRobot, load_robot
from psdmc.robot.reference import Reference, reference

FOREIGN = {
    "UR5": ("ur5_robot.urdf", None),
    "UR10": ("ur10_robot.urdf", None),
    "Panda": ("panda.urdf", "panda_link7"),
    "Kinova": ("kinova.urdf", "j2s6s200_link_6"),
    "Z1": ("z1.urdf", "link06"),
}
"""File in the example-robot-data wheel, and the tip that leaves grippers out (None: the end of the chain)."""

GENERIC = {"generic 6R": (61, "RRRRRR"), "generic 7R": (71, "RRRRRRR")}
"""Seed and joints of chains with oblique axes."""

BUNDLED = tuple(sorted(path.stem for path in ROBOTS.iterdir() if not path.stem.endswith("_published")))
"""Published files differ from those of the same name by the inertias of a link or two."""
NAMES = (*BUNDLED, *FOREIGN, *GENERIC)


@dataclass(frozen=True, slots=True, eq=False)
class Subject:
    """A robot under test.

    label      its name, and the seed where it was drawn
    pinocchio  answers from Pinocchio alone, for the same snapped robot
    """

    label: str
    model: DynamicsModel
    pinocchio: Reference


def loaded(name: str) -> LoadedRobot:
    if name in FOREIGN:
        file, tip = FOREIGN[name]
        return load_robot(in_wheel(file), tip=tip)
    return load_robot(robot_path(name))


@cache
def subject(name: str, *, expand: bool = True) -> Subject:
    """`expand`: with E and P."""
    if name in GENERIC:
        return drawn(*GENERIC[name], expand=expand)
    robot = loaded(name)
    model = derive_model(robot.chain, provenance=provenance_of(robot), expand=expand)
    return Subject(name, model, reference(robot))


def drawn(seed: int, kinds: str, *, tidy: bool = False, expand: bool = True) -> Subject:
    """A random chain with one joint per letter of `kinds`."""
    chain = random_chain(seed, kinds, tidy=tidy, gravity=(1.0, -2.0, -9.0))
    label = f"{kinds}, seed {seed}{', tidy' if tidy else ''}"
    return Subject(label, derive_model(chain, expand=expand), Reference(Oracle(chain).model, "tip"))
