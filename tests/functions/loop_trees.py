"""Random robots with closed loops and a contact, fixed or floating, their C, and Pinocchio's model of the same file."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import pinocchio as pin
from contact_trees import OneByOne
from mimic_trees import FOOT, TRUNK, as_urdf, placed
from random_trees import TREES, RandomTree

from psdmc.derivation.derive import derive_model
from psdmc.functions import RECIPES, SIGNATURES
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import states_of
from psdmc.program.signature import Sizes
from psdmc.robot.coordinates import Coordinate
from psdmc.robot.load import LoadedRobot, load_robot_text
from psdmc.robot.reference import reference
from psdmc.verification.check import with_passive_joints

Array = np.ndarray

FUNCTIONS = (
    "loop_error",
    "loop_jacobian",
    "loop_drift",
    "constrained_forward_dynamics",
    "constrained_forward_dynamics_derivatives",
    "constrained_forward_dynamics_vjp",
    "constrained_forward_dynamics_jvp",
    "constrained_semi_implicit_euler",
    "constrained_semi_implicit_euler_derivatives",
    "constrained_rk4_step",
    "passive_motion",
    "loop_inverse_dynamics",
    "impulse",
    "impulse_derivatives",
    "impulse_vjp",
    "impulse_jvp",
    "delassus",
    "contact_space_inertia",
    "contact_inverse_dynamics",
)
COUNT = 16

ROWS = (3, ["y", "rx", "rz"], ["x", "z", "ry", "rz"], ["x", "y", "rx", "ry", "rz"])
"""Rows of the loop between two ends, and for one more between an end and the base."""


@dataclass(frozen=True, eq=False)
class LoopTree:
    """A robot with closed loops. `closed` is a configuration (nq,) in which they are closed."""

    loaded: LoadedRobot
    closed: Array

    @cached_property
    def model(self) -> DynamicsModel:
        return derive_model(self.loaded.mechanism, expand=False)

    @cached_property
    def robot(self) -> OneByOne:
        return OneByOne(self.model)

    @cached_property
    def given(self) -> dict[str, Array]:
        """States, of which the last one is closed. The contact acts in every second one if the base floats."""
        robot = self.loaded.mechanism
        rng = np.random.default_rng(5)
        q, qd, tau = states_of(robot, rng, COUNT)
        q[-1] = self.closed
        found = {
            "q": q,
            "qd": qd,
            "qd_before": qd,
            "restitution": rng.uniform(0.0, 1.0, COUNT),
            "tau": tau,
            "qdd": rng.normal(size=qd.shape),
            "dt": np.linspace(0.001, 0.02, COUNT),
            "active": np.arange(COUNT)[:, None] % 2.0 * robot.has_floating_base,
            "mu": np.zeros(COUNT),
            "kp": rng.uniform(0.0, 50.0, COUNT),
            "kd": rng.uniform(0.0, 10.0, COUNT),
            "error": 0.01 * rng.normal(size=(COUNT, sum(robot.rows_of_contacts))),
        }
        sizes = Sizes.of(robot)
        others = {each.name: each for name in FUNCTIONS for each in SIGNATURES[name].inputs}
        return found | {
            name: rng.normal(size=(COUNT, *sizes.shape(each.axes)))
            for name, each in others.items()
            if name not in found
        }

    @cached_property
    def conditions(self) -> Array:
        """Condition numbers of J M^-1 J^T, with J of the loops. They are large where rows nearly depend on each other."""
        q, found = self.given["q"], []
        for mass, rows in zip(self.model.mass_matrix(q), self.model.loop_jacobian(q), strict=True):
            found.append(np.linalg.cond(rows @ np.linalg.solve(mass, rows.T)))
        return np.array(found)

    @property
    def far(self) -> Array:
        """Which states have a condition number below 1e5: derivatives keep their digits there."""
        return self.conditions < 1e5

    def expected(self, function: str, **other: Array) -> dict[str, Array]:
        """The values from Pinocchio's own reading of the file and of the loops' frames."""
        return RECIPES[function].pinocchio(
            reference(with_passive_joints(self.model, self.loaded), snapped=False), self.given | other
        )

    def found(self, function: str, **other: Array) -> list[tuple[Array, ...]]:
        """The values of C for many states, of C for each state, and of the model in NumPy."""
        given = [(self.given | other)[q.name] for q in SIGNATURES[function].inputs]
        many, plain = (getattr(robot, function)(*given) for robot in (self.robot, self.model))
        each = [getattr(self.robot, function)(*state) for state in zip(*given, strict=True)]
        if not isinstance(many, tuple):
            return [(many,), (np.array(each),), (plain,)]
        return [many, tuple(map(np.array, zip(*each, strict=True))), plain]


@cache
def loop_tree(seed: int, floating: bool) -> LoopTree:
    """Four legs on a body: two feet are joined, a third one is joined to the base, the last one can touch the world."""
    pin.seed(seed)
    tree = RandomTree(seed, TREES["four legs on a body"], "RRRRRRRR" if seed % 2 else "RRPRRRRR")
    text = as_urdf(tree, [Coordinate(i) for i in range(tree.n)])
    text = text.replace('<link name="base"/>', f'<link name="base">{TRUNK}</link>')
    text = text.replace("</robot>", "".join(FOOT.format(i=i) for i in (2, 4, 6, 7)) + "</robot>")
    model = (
        pin.buildModelFromXML(text, pin.JointModelFreeFlyer()) if floating else pin.buildModelFromXML(text)
    )
    data, q = (
        model.createData(),
        pin.randomConfiguration(model, -2.0 * np.ones(model.nq), 2.0 * np.ones(model.nq)),
    )
    pin.framesForwardKinematics(model, data, q)
    tables = []
    for number, (first, second) in enumerate(
        (("foot2", "link4"), ("universe" if floating else "base", "foot6"))
    ):
        where = data.oMf[model.getFrameId(first)] * pin.SE3.Random()
        ends = {"first": placed(model, data, first, where), "second": placed(model, data, second, where)}
        rows = ROWS[seed % 4 if floating and number else (seed + number) % 2]
        tables.append({"rows": rows, **ends})
    loaded = load_robot_text(text, "urdf", floating=floating, contacts=["foot7"], loops=tables)
    return LoopTree(loaded, q)


LEG = "".join(
    f'<link name="{name}{{k}}"><inertial><origin xyz="{length / 2} 0.01 0"/><mass value="{2 * length}"/>'
    f'<inertia ixx="0.002" iyy="{0.02 * length}" izz="0.005" ixy="0" ixz="0.0003" iyz="0"/></inertial></link>'
    f'<joint name="{name}{{k}}" type="continuous"><parent link="{parent}"/><child link="{name}{{k}}"/>'
    f'<origin xyz="{place}" rpy="{turn}"/><axis xyz="0 1 0"/></joint>'
    for name, length, parent, place, turn in (
        ("crank", 0.2, "base", "{x} 0.1 0", "0.2 0 {k}"),
        ("coupler", 0.5, "crank{k}", "0.2 0 0", "0 0 0"),
        ("rocker", 0.4, "crank_base{k}", "0.45 0 0", "0 0 0"),
    )
) + (
    '<link name="crank_base{k}"/><joint name="to_crank_base{k}" type="fixed"><parent link="base"/>'
    '<child link="crank_base{k}"/><origin xyz="{x} 0.1 0" rpy="0.2 0 {k}"/></joint>'
    '<link name="foot{k}"/><joint name="to_foot{k}" type="fixed"><parent link="coupler{k}"/><child link="foot{k}"/>'
    '<origin xyz="0.6 0.05 0.1" rpy="0.4 -0.7 1.1"/></joint>'
)


@cache
def four_bar_legs() -> LoopTree:
    """A floating body with two legs, each a four-bar whose coupler carries a foot. Coupler and rocker are passive. A passive
    boom slides on a wall."""
    legs = "".join(LEG.format(k=k, x=x) for k, x in enumerate((0.3, -0.3)))
    boom = (
        f'<link name="boom">{TRUNK}</link><joint name="boom" type="continuous"><parent link="base"/>'
        '<child link="boom"/><origin xyz="0 0 0.2" rpy="0.3 0 0"/><axis xyz="0 0 1"/></joint>'
    )
    text = f'<robot name="legs"><link name="base">{TRUNK}</link>{legs}{boom}</robot>'
    loops = [
        {
            "rows": ["x", "z"],
            "first": {"link": f"rocker{k}", "xyz": [0.4, 0.0, 0.0]},
            "second": {"link": f"coupler{k}", "xyz": [0.5, 0.0, 0.0]},
            "passive": ["boom", *(f"{name}{i}" for i in range(2) for name in ("coupler", "rocker"))],
        }
        for k in range(2)
    ]
    loops.append({"rows": ["x"], "first": "universe", "second": {"link": "boom", "xyz": [0.0, 0.7, 0.1]}})
    loaded = load_robot_text(text, "urdf", floating=True, contacts=["foot0:6", "foot1"], loops=loops)
    return LoopTree(loaded, states_of(loaded.mechanism, np.random.default_rng(2), 1)[0][0])
