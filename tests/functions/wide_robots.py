"""Functions of robots whose joints have several coordinates: PROGRAMs and C against Pinocchio."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import pinocchio as pin
from lowered import lowered
from random_trees import TREES, RandomTree
from unoptimised import without_optimisation

import psdmc
from psdmc.derivation.derive import derive_model
from psdmc.functions import RECIPES
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import on_joints
from psdmc.program.interpret import interpret
from psdmc.program.signature import Sizes
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.robot.reference import Reference
from psdmc.toolchain.call import CompiledRobot

Array = np.ndarray

COUNT = 40

TREE = TREES["a trunk with two arms"]
KINDS = {"free": "FRSRLP", "standing": "RSTLRF", "spherical": "SRRSRR", "planar": "LRPLRR"}
"""Types of the joints of trees of six bodies: on a floating base, and with wide joints inside, at ends and in a row."""

SMALL = {
    "small": (TREES["a wrist with two fingers"], "FRSL"),
    "hand": (TREES["a wrist with two fingers"], "LSRT"),
    "two": ((-1, 0), "TS"),
    "pair": ((-1, 0), "FL"),
}
"""Of four, for functions that take long to lower and to compile."""

EXACT = 1e-12
"""Of each output's largest entry."""


@dataclass(frozen=True, eq=False)
class WideRobot:
    """A tree, its model, and Pinocchio's."""

    tree: RandomTree
    model: DynamicsModel
    pinocchio: Reference

    @property
    def sizes(self) -> Sizes:
        model = self.model
        return Sizes.of(model.mechanism, model.l)

    @cached_property
    def arrays(self) -> RobotOnArrays:
        return RobotOnArrays.of(self.model, np.asarray(self.model.theta_b))

    @cached_property
    def given(self) -> dict[str, Array]:
        """Every quantity that functions read, quaternions of length one."""
        rng = np.random.default_rng(11)
        read = {q.name: q for recipe in RECIPES.values() for q in recipe.signature.inputs}
        found = {
            q.name: q.drawn(rng.uniform(-1.0, 1.0, (COUNT, *self.sizes.shape(q.axes)))) for q in read.values()
        }
        for quantity in read.values():
            if quantity.axes == ("nq",):
                found[quantity.name] = on_joints(self.model.mechanism, found[quantity.name])
        torques = self.pinocchio.inverse_dynamics(found["q"], found["qd"], found["qdd"])
        return found | {"tau": torques}

    def compiled(self, *functions: str) -> CompiledRobot:
        with without_optimisation():
            return psdmc.compile(self.model, functions=functions)


@cache
def wide_robot(name: str) -> WideRobot:
    parents, kinds = SMALL[name] if name in SMALL else (TREE, KINDS[name])
    tree = RandomTree(4, parents, kinds)
    model = derive_model(tree.mechanism(), expand=False)
    for frame in model.mechanism.frames:
        place = pin.SE3(frame.placement.rotation.copy(), frame.placement.translation.copy())
        joint = tree.joints[frame.joint]
        tree.model.addFrame(pin.Frame(frame.name, joint, 0, place, pin.FrameType.OP_FRAME))
    return WideRobot(tree, model, Reference(tree.model, "tip"))


def is_pinocchios(function: str, name: str, exact: float = EXACT, in_c: bool = True) -> None:
    """The NumPy reference, the PROGRAMs for one state and for lanes, and where wanted C of a function."""
    own, recipe = wide_robot(name), RECIPES[function]
    expected = recipe.pinocchio(own.pinocchio, own.given)
    _compare(expected, recipe.reference(own.arrays, own.given), exact)
    kernels = lowered(own.model, functions=[function])  # by the factored lowering: there is no E
    given = {q.name: own.given[q.name].reshape(COUNT, -1) for q in recipe.signature.inputs}
    for kernel in (kernel for kernel in kernels.values() if kernel.function.name == function):
        for program in (kernel.single, kernel.batch):
            theta = {"theta_b": own.model.theta_b} if kernel.theta else {}
            found = interpret(program, given | theta, recipe.signature.sizes(own.sizes))
            _compare(expected, found, exact)
    if in_c:
        robot = own.compiled(function)
        values = robot.call(recipe.signature, [own.given[q.name] for q in recipe.signature.inputs])
        outputs = recipe.signature.outputs
        values = [values] if len(outputs) == 1 else values
        _compare(expected, {q.name: x for q, x in zip(outputs, values, strict=True)}, exact)


def _compare(expected: dict[str, Array], found: dict[str, Array], exact: float) -> None:
    for name, values in expected.items():
        own = np.broadcast_to(found[name], values.shape) if found[name].ndim == 1 else found[name]
        error = np.abs(own.reshape(values.shape) - values).max() / max(np.abs(values).max(), 1e-300)
        assert error < exact, f"{name}: {error:.1e}"
