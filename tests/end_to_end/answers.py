"""Every function asked of NumPy, of the PROGRAM, of compiled C and of Pinocchio, and how far the answers are apart."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from random_chains import states
from robots_at_hand import Subject

from psdmc.functions import DEFAULT, SIGNATURES
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program.interpret import interpret
from psdmc.program.kernel import Kernel
from psdmc.program.signature import Sizes
from psdmc.toolchain.call import CompiledRobot

Array = np.ndarray
Answers = Iterable[tuple[str, Array]]
"""Function (with what is special about this way of computing it), and its result per state as (count, n or rows, ...)."""

LIMIT = {"forward_dynamics": 1e-9}
STRICT = 1e-12
"""Largest error, relative to the largest torque of that joint over all states (matrices: the largest entry of that row)."""

WELL_CONDITIONED = 1e6
"""Forward dynamics is compared where the mass matrix's condition number is below this."""


@dataclass(frozen=True, eq=False)
class Questions:
    """Random states of one robot, and Pinocchio's answers there."""

    subject: Subject
    count: int = 1000

    @cached_property
    def inputs(self) -> dict[str, Array]:
        n = self.subject.model.n
        q, qd, qdd = states(n, self.count)
        _, qd_r, qdd_r = states(n, self.count, seed=1)
        tau = self.subject.pinocchio.inverse_dynamics(q, qd, qdd)
        return {"q": q, "qd": qd, "qdd": qdd, "tau": tau, "qd_r": qd_r, "qdd_r": qdd_r}

    def of(self, function: str) -> list[Array]:
        return [self.inputs[quantity.name] for quantity in SIGNATURES[function].inputs]

    @cached_property
    def mass(self) -> Array:
        return self.subject.pinocchio.mass_matrix(self.inputs["q"])

    @cached_property
    def coriolis(self) -> Array:
        return self.subject.pinocchio.coriolis_matrix(self.inputs["q"], self.inputs["qd"])

    @cached_property
    def well_conditioned(self) -> Array:
        return np.linalg.cond(self.mass) < WELL_CONDITIONED

    def expected(self, function: str) -> Array:
        if function in ("inverse_dynamics", "regressor"):
            return self.inputs["tau"]
        if function == "mass_matrix":
            return self.mass
        if function == "coriolis_matrix":
            return self.coriolis
        if function == "regressor_slotine_li":
            return self._slotine_li()
        return getattr(self.subject.pinocchio, function)(*self.of(function))

    def _slotine_li(self) -> Array:
        """M qdd_r + C qd_r + g, which that regressor times theta_b must be."""
        turned = np.einsum("sij,sj->si", self.mass, self.inputs["qdd_r"])
        carried = np.einsum("sij,sj->si", self.coriolis, self.inputs["qd_r"])
        return turned + carried + self.subject.pinocchio.gravity(self.inputs["q"])

    def error(self, function: str, found: Array) -> float:
        """Infinite where anything that should be a number is none."""
        expected = self.expected(function)
        if function == "forward_dynamics":
            found, expected = found[self.well_conditioned], expected[self.well_conditioned]
            assert len(found), "no state is well conditioned"
        if function.startswith("regressor"):
            found = found @ self.subject.model.theta_b
        error = np.abs(found - expected) / self._scale(function, expected)
        return float(np.max(error)) if np.isfinite(found).all() else np.inf

    def _scale(self, function: str, expected: Array) -> Array:
        if function in ("nonlinear_effects", "gravity"):
            expected = self.inputs["tau"]
        if function == "jacobian":
            return np.max(np.abs(expected))
        if function == "coriolis_matrix":
            expected = np.concatenate([expected, self.mass])
        if expected.ndim == 3:
            return np.max(np.abs(expected), axis=(0, 2))[:, None]
        return np.max(np.abs(expected), axis=0)


def numpy_answers(model: DynamicsModel, questions: Questions) -> Answers:
    """Straight from E, P and theta_b."""
    for function in ("inverse_dynamics", "mass_matrix", "nonlinear_effects", "gravity", "regressor"):
        yield function, getattr(model, function)(*questions.of(function))


def program_answers(kernels: Mapping[str, Kernel], model: DynamicsModel, questions: Questions) -> Answers:
    """The interpreted PROGRAMs: for one state and for lanes, parameters baked and given."""
    for name, kernel in kernels.items():
        function = kernel.function
        sizes = function.sizes(Sizes.of_chain(model.n, model.l))
        given = questions.inputs | ({"theta_b": model.theta_b} if kernel.theta else {})
        for form in ("single", "batch"):
            found = interpret(getattr(kernel, form), given, sizes)[function.outputs[0].name]
            yield f"{name} {form}", found.reshape(-1, *_shape(model, function.name))


def compiled_answers(robot: CompiledRobot, model: DynamicsModel, questions: Questions) -> Answers:
    """The compiled library through its batch functions, parameters baked and given; one state a call on a few."""
    for function in map(SIGNATURES.__getitem__, DEFAULT):
        given = questions.of(function.name)
        call = getattr(robot, function.name)
        found = call(*given)
        for row in (0, questions.count // 2, questions.count - 1):
            one = call(*(array[row] for array in given))
            np.testing.assert_allclose(one, found[row], rtol=1e-7, atol=1e-9 * np.max(np.abs(found)))
        yield f"{function.name} compiled", found
        if function.theta:
            yield f"{function.name} compiled_theta", call(*given, theta_b=model.theta_b)


def _shape(model: DynamicsModel, function: str) -> tuple[int, ...]:
    return Sizes.of_chain(model.n, model.l).shape(SIGNATURES[function].outputs[0].axes)


def function_of(label: str) -> str:
    return label.split()[0].removesuffix("_theta")


def errors(questions: Questions, answers: Answers) -> dict[str, float]:
    return {label: questions.error(function_of(label), found) for label, found in answers}


def too_large(found: Mapping[str, float]) -> dict[str, float]:
    """Errors beyond what is promised."""
    return {label: e for label, e in found.items() if not e < LIMIT.get(function_of(label), STRICT)}
