"""Random robots with contacts, fixed or floating, their C, and Pinocchio's model of the same file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from mimic_trees import FOOT, TRUNK, as_urdf
from pinocchio_robots import path_of
from random_trees import TREES, RandomTree
from unoptimised import without_optimisation

import psdmc
from psdmc.derivation.derive import derive_model
from psdmc.functions import RECIPES, SIGNATURES
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import states_of
from psdmc.program.signature import Sizes
from psdmc.robot.coordinates import Coordinate
from psdmc.robot.load import LoadedRobot, load_robot, load_robot_text
from psdmc.robot.mechanism import Mechanism
from psdmc.robot.reference import reference
from psdmc.toolchain.call import CompiledRobot

Array = np.ndarray

FUNCTIONS = (
    "constrained_forward_dynamics",
    "constrained_forward_dynamics_derivatives",
    "constrained_forward_dynamics_vjp",
    "constrained_forward_dynamics_jvp",
    "constrained_semi_implicit_euler",
    "constrained_semi_implicit_euler_derivatives",
    "constrained_rk4_step",
    "impulse",
    "impulse_derivatives",
    "impulse_vjp",
    "impulse_jvp",
    "contact_jacobian",
    "contact_jacobian_local",
    "contact_drift",
    "contact_drift_local",
    "delassus",
    "contact_space_inertia",
    "contact_inverse_dynamics",
)

SHAPES = ("a trunk with two arms", "four legs on a body", "a wrist with two fingers")
COUNT = 16
"""States: two for each mask of three contacts."""


@dataclass(frozen=True, eq=False)
class OneByOne:
    """A model's compiled functions as methods, each in a library of its own, made by its first call."""

    model: DynamicsModel
    real: str = "float64"

    def __getattr__(self, name: str) -> Callable[..., Any]:
        return getattr(self._with(name), name)

    @cache  # noqa: B019 - a test's robot lives as long as the tests
    def _with(self, function: str) -> CompiledRobot:
        with without_optimisation():
            return psdmc.compile(self.model, functions=[function], real=self.real)  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False)
class ContactTree:
    """A robot with three contacts or two, one of which is a surface where its base floats."""

    loaded: LoadedRobot
    real: str

    @cached_property
    def model(self) -> DynamicsModel:
        return derive_model(self.loaded.mechanism, expand=False)

    @cached_property
    def robot(self) -> OneByOne:
        return OneByOne(self.model, self.real)

    @cached_property
    def given(self) -> dict[str, Array]:
        return given_to(self.loaded.mechanism)

    def expected(self, function: str, **other: Array) -> dict[str, Array]:
        """Pinocchio's values."""
        return RECIPES[function].pinocchio(reference(self.loaded), self.given | other)

    def worst_condition(self) -> float:
        """The largest condition number of the dense systems, scaled to ones on the diagonal of their blocks."""
        own, conditions = self.given, []
        rows, mass = self.robot.contact_jacobian(own["q"]), self.model.mass_matrix(own["q"])
        on = np.repeat(own["active"], self.loaded.mechanism.rows_of_contacts, axis=1) > 0
        for jacobian, matrix, mask in zip(rows, mass, on, strict=True):
            scale = 1.0 / np.sqrt(np.diag(matrix))
            active = jacobian[mask] * scale
            active = active / np.linalg.norm(active, axis=1, keepdims=True)
            zero = np.zeros((len(active), len(active)))
            conditions.append(
                np.linalg.cond(np.block([[matrix * np.outer(scale, scale), -active.T], [active, zero]]))
            )
        return max(conditions)


def given_to(robot: Mechanism) -> dict[str, Array]:
    """What the functions read, every mask in turn, mu = 0."""
    rng = np.random.default_rng(7)
    q, qd, tau = states_of(robot, rng, COUNT)
    contacts, rows = len(robot.contacts), sum(robot.rows_of_contacts)
    masks = (np.arange(COUNT)[:, None] >> np.arange(contacts)) & 1
    found = {
        "q": q,
        "qd": qd,
        "qd_before": qd,
        "tau": tau,
        "dt": np.linspace(0.001, 0.02, COUNT),
        "active": masks.astype(float),
        "mu": np.zeros(COUNT),
        "kp": rng.uniform(0.0, 50.0, COUNT),
        "kd": rng.uniform(0.0, 10.0, COUNT),
        "error": 0.01 * rng.normal(size=(COUNT, rows)),
        "restitution": rng.uniform(0.0, 1.0, COUNT),
    }
    sizes = Sizes.of(robot)
    others = {each.name: each for name in FUNCTIONS for each in SIGNATURES[name].inputs}
    return found | {
        name: rng.normal(size=(COUNT, *sizes.shape(each.axes)))
        for name, each in others.items()
        if name not in found
    }


@cache
def floating_gripper() -> tuple[DynamicsModel, OneByOne, dict[str, Array]]:
    """The Panda, whose fingers are coupled, on a floating base: its model, its C, and what the functions read."""
    path, contacts = path_of("panda"), ["panda_link5", "panda_leftfinger:6"]
    robot = load_robot(path, floating=True, frames=["panda_link3"], contacts=contacts).mechanism
    model = derive_model(robot, expand=False)
    return model, OneByOne(model), given_to(robot) | {"mu": np.linspace(0.1, 1.0, COUNT)}


@cache
def contact_tree(seed: int, floating: bool, real: str = "float64") -> ContactTree:
    tree = RandomTree(seed, TREES[SHAPES[seed % 3]], "RRRRRRRR" if seed % 2 else "RRPRRRRP")
    ends = [i for i in range(tree.n) if i not in tree.parents][: 3 if floating else 1]
    contacts = [f"foot{i}:6" if floating and i == ends[0] and seed % 3 < 2 else f"foot{i}" for i in ends]
    text = as_urdf(tree, [Coordinate(i) for i in range(tree.n)])
    text = text.replace('<link name="base"/>', f'<link name="base">{TRUNK}</link>')
    text = text.replace("</robot>", "".join(FOOT.format(i=i) for i in ends) + "</robot>")
    return ContactTree(load_robot_text(text, "urdf", floating=floating, contacts=contacts), real)


BRICK = [3.0, 1.0, 2.0, 0.0, 0.0, 0.0, 1.0]
"""Where the brick is: its axes are the world's."""


BRICK_URDF = """<robot name="brick"><link name="brick"><inertial><mass value="4"/>
<inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="edge"/><joint name="to_edge" type="fixed"><parent link="brick"/><child link="edge"/>
<origin xyz="0.1 0 0"/></joint>
<link name="side"/><joint name="to_side" type="fixed"><parent link="brick"/><child link="side"/>
<origin xyz="0 0.1 0"/></joint></robot>"""


def brick(*contacts: str) -> DynamicsModel:
    """A body that floats."""
    loaded = load_robot_text(BRICK_URDF, "urdf", floating=True, contacts=contacts)
    return derive_model(loaded.mechanism, expand=False)
