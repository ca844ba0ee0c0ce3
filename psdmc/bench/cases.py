"""The robots of the benchmark: robots of publications, common arms, two generic arms, quadrupeds, a humanoid, a hand and
a two-armed torso. Their models are derived in a new process, to measure the time and memory of the derivation."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

import numpy as np

from psdmc.bench.case import FLOOR_MOUNT, Case, generic_chain
from psdmc.derivation.derive import derive_model
from psdmc.errors import DerivationError, InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.progress import Progress, silent
from psdmc.reproducible import length
from psdmc.robot.joints import REVOLUTE
from psdmc.robot.load import load_robot
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, Array, Joint, Mechanism, Placement
from psdmc.workers import in_a_new_process

SEED = 4
"""Seed of generic inertias and geometry; printed with every result."""

EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "robots"

BUNDLED = {"Denso": "denso_floor.toml", "KR6": "kr6.toml", "LBR7": "lbr7.toml"}

POPULAR: dict[str, tuple[str, dict[str, Any]]] = {
    "UR5": ("ur_description/urdf/ur5_robot.urdf", {}),
    "Panda": ("panda_description/urdf/panda.urdf", {"tip": "panda_link7"}),
    "solo12": ("solo_description/robots/solo12.urdf", {"floating": True}),
    "anymal_b": ("anymal_b_simple_description/robots/anymal.urdf", {"floating": True}),
    "talos": ("talos_data/robots/talos_reduced.urdf", {"floating": True}),
    "allegro": ("allegro_hand_description/urdf/allegro_right_hand.urdf", {}),
    "baxter": (
        "baxter_description/urdf/baxter.urdf",
        {"lock": {f"{side}_gripper_{finger}_finger_joint": 0.0 for side in "lr" for finger in "lr"}},
    ),
}
"""Path inside example-robot-data's robots, and how it is read: the tip or the locks leave grippers out, whose fingers follow
each other, so that every rival can take part."""

LEGGED = {
    "hyq": "hyq_description/robots/hyq_no_sensors.urdf",
    "solo12": "solo_description/robots/solo12.urdf",
    "anymal_b": "anymal_b_simple_description/robots/anymal.urdf",
    "go1": "go1_description/urdf/go1.urdf",
    "b1-z1": "b1_description/urdf/b1-z1.urdf",
    "talos_reduced": "talos_data/robots/talos_reduced.urdf",
    "icub": "icub_description/robots/icub.urdf",
}
"""Four quadrupeds, a quadruped with an arm, two humanoids: paths as in POPULAR."""

ARMS, TREES = ("UR5", "Panda"), ("solo12", "anymal_b", "talos", "allegro", "baxter")
"""Of POPULAR."""


def standard_chains() -> dict[str, Callable[[], Mechanism]]:
    """Return, by name, the functions that make the standard robots of the benchmark, including two generic arms."""
    makers: dict[str, Callable[[], Mechanism]] = {}
    for name in (*BUNDLED, *ARMS):
        makers[name] = lambda name=name: generic_chain(_known(name), SEED)  # type: ignore[misc]
    for n in (6, 7):
        makers[f"generic {n}R"] = lambda n=n: generic_chain(oblique_chain(n, SEED + n), SEED)  # type: ignore[misc]
    for name in TREES:
        makers[name] = lambda name=name: generic_chain(_known(name), SEED)  # type: ignore[misc]
    return makers


def standard_cases(names: Sequence[str] | None = None, progress: Progress = silent) -> Iterator[Case]:
    """Derive the models of the standard robots of the benchmark, each in a new process.

    Raise InputError if a robot's file is not installed, or if a name is unknown.
    """
    makers = standard_chains()
    for name in makers if names is None else names:
        if name not in makers:
            raise InputError(f"there is no standard robot {name!r}", f"choose from {', '.join(makers)}")
        progress(f"{name}: deriving")
        found = derive_fresh(makers[name]())
        note = f"generic physical inertias, floor mount, no drive inertia, seed {SEED}"
        yield Case(name, found.model, note, found.seconds, found.peak_bytes)


def legged_cases(
    functions: tuple[str, ...], names: Sequence[str] = (), progress: Progress = silent
) -> Iterator[Case]:
    """Derive the models of legged robots with the inertias of their files, each in a new process. Without names, all
    legged robots are derived.

    Raise InputError as `standard_cases` does.
    """
    for name in names or LEGGED:
        if name not in LEGGED:
            raise InputError(f"there is no legged robot {name!r}", f"choose from {', '.join(LEGGED)}")
        progress(f"{name}: deriving")
        found = derive_fresh(load_robot(robot_data() / LEGGED[name], floating=True).chain)
        yield Case(name, found.model, "inertias of its file", found.seconds, found.peak_bytes, functions)


def oblique_chain(n: int, seed: int) -> Mechanism:
    """Return a robot with n revolute joints whose axes are neither parallel nor perpendicular and do not meet, so that no
    term vanishes."""
    rng = np.random.default_rng(seed)
    joints = tuple(
        Joint(f"joint{i + 1}", f"link{i + 1}", REVOLUTE, _anywhere(rng), Placement.identity())
        for i in range(n)
    )
    return Mechanism(
        name=f"generic_{n}r",
        convention="modified",
        base_name="base",
        tip_name="tip",
        joints=joints,
        parameters=np.zeros((n, PARAMETERS_PER_LINK)),
        parameter_span=np.eye(PARAMETERS_PER_LINK * n),
        gravity=np.array(FLOOR_MOUNT),
        tip=_anywhere(rng),
    )


def first_joints(chain: Mechanism, n: int) -> Mechanism:
    """Return the robot without the joints after joint n, to measure how times grow with the number of joints."""
    rows = PARAMETERS_PER_LINK * n
    span = chain.parameter_span[:rows]
    kept = np.any(span != 0.0, axis=0)
    return Mechanism(
        name=f"{chain.name}_{n}",
        convention=chain.convention,
        base_name=chain.base_name,
        tip_name=chain.joints[n - 1].link_name,
        joints=chain.joints[:n],
        parameters=chain.parameters[:n],
        parameter_span=span[:, kept],
        gravity=chain.gravity,
        tip=Placement.identity(),
    )


def bundled_chain(name: str) -> Mechanism:
    """A robot of examples/robots."""
    return load_robot(EXAMPLES / BUNDLED[name]).chain


def _known(name: str) -> Mechanism:
    if name in BUNDLED:
        return bundled_chain(name)
    path, options = POPULAR[name]
    return load_robot(robot_data() / path, **options).chain


def robot_data() -> Path:
    """Return the folder in which the Python package example-robot-data keeps its robot files."""
    try:
        wheel = distribution("example-robot-data")
    except PackageNotFoundError:
        raise InputError("example-robot-data is not installed", "pip install example-robot-data") from None
    inside = next(file for file in wheel.files or () if str(file).endswith(POPULAR["UR5"][0]))
    return Path(str(wheel.locate_file(inside))).parents[2]


def _anywhere(rng: np.random.Generator) -> Placement:
    return Placement(_rotation(rng), rng.uniform(-0.3, 0.3, size=3))


def _rotation(rng: np.random.Generator) -> Array:
    """A uniformly random rotation: a random direction's quaternion, in arithmetic that is the same on every processor."""
    quaternion = rng.normal(size=4)
    w, x, y, z = quaternion / length(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


# Derived in a new process


STATUS = Path("/proc/self/status")


@dataclass(frozen=True, slots=True, eq=False)
class Derivation:
    """A model with the time of its derivation, and the peak memory of the process; None if the system lacks it."""

    model: DynamicsModel
    seconds: float
    peak_bytes: int | None


def derive_fresh(chain: Mechanism) -> Derivation:
    """Return the model of a robot, derived in a new process, with time and memory of the derivation. The matrices E and
    P are left out if they do not fit into memory."""
    return in_a_new_process(measured_derivation, chain)


def measured_derivation(chain: Mechanism) -> Derivation:
    """Derive a model twice; return it with the time of the second derivation and the process's peak memory."""
    derive_model(chain, expand=False)  # imports and first calls are not measured
    start = time.perf_counter()
    try:
        model = derive_model(chain)
    except DerivationError:
        start = time.perf_counter()
        model = derive_model(chain, expand=False)
    return Derivation(model, time.perf_counter() - start, _peak_bytes())


def _peak_bytes() -> int | None:
    if sys.platform == "win32":
        return None
    if STATUS.is_file():  # Linux inherits ru_maxrss from the parent, but not this
        kibibytes = next(
            line.split()[1] for line in STATUS.read_text().splitlines() if line.startswith("VmHWM")
        )
        return 1024 * int(kibibytes)
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak
