"""Robots whose functions are differentiated here, and their derivatives along a direction from Pinocchio alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pinocchio as pin
from bundled import under_gravity
from installed import in_wheel
from robots_at_hand import loaded

from psdmc.derivation.derive import derive_model
from psdmc.frameworks.differentiation import rule_of
from psdmc.functions import RECIPES, SIGNATURES
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import on_joints
from psdmc.program.signature import Q, Signature, Sizes
from psdmc.robot.load import load_robot
from psdmc.robot.reference import CENTRAL, DIFFERENCE, Reference, reference

Array = np.ndarray

RULED = tuple(name for name in SIGNATURES if rule_of(name))
"""Functions that can be differentiated."""

WEIGHED = tuple(name for name in RULED if SIGNATURES[name].depends_on_gravity)
"""Those whose results depend on gravity."""

ROBOTS = ("scara", "hopper", "kr6", "Panda", "hyq")
QUICK = ("scara", "hopper")
"""SCARA slides along an axis. The hopper floats."""

HOPPER = """<robot name="hopper">
<link name="trunk"><inertial><origin xyz="0.1 0 0.2"/><mass value="2"/>
<inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0.001" ixz="0" iyz="0"/></inertial></link>
<link name="leg"><inertial><origin xyz="0 0.02 -0.1"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="foot"><inertial><origin xyz="0.01 0 -0.2"/><mass value="0.5"/>
<inertia ixx="0.004" iyy="0.005" izz="0.001" ixy="0" ixz="0" iyz="0.0002"/></inertial></link>
<joint name="hip" type="revolute"><parent link="trunk"/><child link="leg"/><origin xyz="0 0.1 0"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="50" velocity="9"/></joint>
<joint name="spring" type="prismatic"><parent link="leg"/><child link="foot"/><axis xyz="0 0 1"/>
<limit lower="-0.3" upper="0.3" effort="500" velocity="9"/></joint></robot>"""


@dataclass(frozen=True, eq=False)
class Subject:
    """A robot and Pinocchio's model of it."""

    model: DynamicsModel
    pinocchio: Reference

    @property
    def sizes(self) -> Sizes:
        model = self.model
        return Sizes.of(model.mechanism, model.l)

    def drawn(self, function: Signature, count: int, seed: int = 3) -> tuple[list[Array], list[Array]]:
        """Inputs at `count` states, and a direction for each, along the tangent of q; zero by constants of its rule."""
        rng = np.random.default_rng(seed)
        rule = rule_of(function.name)
        inputs, ways = [], []
        for quantity in function.inputs:
            values = quantity.drawn(rng.uniform(-1.0, 1.0, (count, *self.sizes.shape(quantity.axes))))
            is_q = quantity.axes == Q.axes
            inputs.append(on_joints(self.model.mechanism, values) if is_q else values)
            way = rng.uniform(-1.0, 1.0, (count, *self.sizes.shape(("nv",) if is_q else quantity.axes)))
            ways.append(0.0 * way if rule is not None and quantity.name in rule.constant else way)
        return inputs, ways

    def slopes(self, function: Signature, inputs: list[Array], ways: list[Array]) -> list[Array]:
        """The derivatives of Pinocchio's outputs along the ways: central differences of eighth order, of positions in the
        tangent space at the position itself."""
        here = self.values(function, inputs)
        found = []
        for output in function.outputs:
            is_q, step, total = output.axes == Q.axes, DIFFERENCE / 4.0, 0.0
            for k, weight in enumerate(CENTRAL, start=1):
                ahead, behind = (
                    self.values(function, self.moved(function, inputs, ways, sign * k * step))[output.name]
                    for sign in (1.0, -1.0)
                )
                if is_q:
                    ahead, behind = (self.between(here[output.name], there) for there in (ahead, behind))
                total = total + weight / step * (ahead - behind)
            found.append(total)
        return found

    def values(self, function: Signature, inputs: list[Array]) -> dict[str, Array]:
        """Pinocchio's outputs."""
        given = dict(zip((quantity.name for quantity in function.inputs), inputs, strict=True))
        if "tau" in given:
            given["qdd"] = self.pinocchio.forward_dynamics(given["q"], given["qd"], given["tau"])
        return RECIPES[function.name].pinocchio(self.pinocchio, given)

    def moved(self, function: Signature, inputs: list[Array], ways: list[Array], step: float) -> list[Array]:
        """The inputs a step along the ways."""
        return [
            self.pinocchio.integrated(x, step * way) if quantity.axes == Q.axes else x + step * way
            for quantity, x, way in zip(function.inputs, inputs, ways, strict=True)
        ]

    def between(self, here: Array, there: Array) -> Array:
        """The constant rates that lead from one position to the other in a second."""
        model = self.pinocchio.model
        return np.array([pin.difference(model, a, b) for a, b in zip(here, there, strict=True)])


@cache
def differentiated(name: str) -> Subject:
    if name not in ("hopper", "hyq"):
        robot = loaded(name)
        return Subject(derive_model(robot.mechanism), reference(robot))
    if name == "hyq":
        robot = load_robot(in_wheel("hyq_no_sensors.urdf"), floating=True)
    else:
        with TemporaryDirectory() as folder:
            path = Path(folder) / "hopper.urdf"
            path.write_text(HOPPER)
            robot = load_robot(path, floating=True)
    return Subject(derive_model(robot.mechanism, expand=False), reference(robot))


def weighed(name: str) -> DynamicsModel:
    """A robot's model for functions with gravity as an input."""
    own = differentiated(name).model
    return own if own.nq != own.nv else derive_model(own.mechanism, gravity_input=True)


def pulled(name: str, gravity: Array) -> Reference:
    """The robot in Pinocchio, whose model has another gravity, (3,)."""
    return under_gravity(differentiated(name).pinocchio, gravity)


def torques_of_gravity(name: str, q: Array) -> Array:
    """(nv, 3) the derivative of the torques by gravity at one state, from Pinocchio: torques are linear in gravity."""
    still = np.zeros((1, differentiated(name).sizes.nv))
    units = (pulled(name, unit) for unit in np.eye(3))
    return np.column_stack([robot.inverse_dynamics(q[None], still, still)[0] for robot in units])


def on_its_sole() -> DynamicsModel:
    """The hopper, whose foot is a surface that touches the ground: a contact of six rows."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "hopper.urdf"
        path.write_text(HOPPER)
        robot = load_robot(path, floating=True, contacts=["foot:6"])
    return derive_model(robot.mechanism, expand=False)


def near(found: object, expected: Array, limit: float) -> bool:
    """Whether the largest error is within a share of the largest entry."""
    error = np.abs(np.asarray(found) - expected).max()
    return bool(error <= limit * max(np.abs(expected).max(), 1e-300))
