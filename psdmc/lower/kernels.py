"""From a model to the kernels that emission prints: each function by its cheapest lowering."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Literal

from psdmc.errors import InputError
from psdmc.lower.expanded import SUPPORTED, lower_expanded
from psdmc.lower.factored import Arrangement, trace_jacobian, trace_regressor
from psdmc.lower.search import BATCH, SINGLE, Search, Spaces, Target
from psdmc.lower.solve import SingularMassMatrix
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program.functions import BY_NAME, FUNCTIONS, Function
from psdmc.program.kernel import Kernel
from psdmc.program.pipeline import ordered, shortened
from psdmc.program.program import Program
from psdmc.robot.derivable import require_derivable

Lowering = Literal["auto", "expanded", "factored"]

EXPANDED_LIMIT = 600
"""`auto` tries the expanded lowering up to this many functions p; beyond, it has never been the cheaper."""

ALL_FUNCTIONS = tuple(function.name for function in FUNCTIONS)

REGRESSORS = ("regressor", "regressor_slotine_li")

WORTH_TWO_BODIES = 1.03
"""Lanes get a body of their own only where it saves them this much: the C of both is long."""

GEOMETRY = "inverse_dynamics"
"""The function whose search decides where frames sit and the unit of length, for all functions."""

SHARED = {
    "nonlinear_effects": "inverse_dynamics",
    "gravity": "inverse_dynamics",
    "coriolis_matrix": "inverse_dynamics",
}
"""Functions that run another's recursion: its arrangement is taken over, only the choices in it are made anew."""


def lower(
    model: DynamicsModel,
    lowering: Lowering = "auto",
    functions: Sequence[str] | None = None,
    progress: Callable[[str], None] = lambda message: None,
    theta_variants: bool = True,
) -> dict[str, Kernel]:
    """Kernels by name, `_theta` variants included where wanted, in the order of FUNCTIONS.

    functions  names of FUNCTIONS; None takes all; without theta_b only those variants that need none are made
    Raises InputError for an unknown function, and for forward dynamics where the mass matrix is singular for every q.
    """
    require_derivable(model.chain)
    wanted = _wanted(model, functions)
    lowered = _Lowered(model, lowering)
    kernels: dict[str, Kernel] = {}
    for name in wanted:
        for theta in (False, True) if BY_NAME[name].theta and theta_variants else (False,):
            if not theta and model.theta_b is None and BY_NAME[name].theta:
                continue
            progress(name + ("_theta" if theta else ""))
            try:
                kernel = lowered.kernel(BY_NAME[name], theta)
            except SingularMassMatrix as singular:
                raise _refusal(model, singular) from singular
            kernels[kernel.name] = kernel
    return kernels


def _wanted(model: DynamicsModel, functions: Sequence[str] | None) -> tuple[str, ...]:
    if functions is None:
        return ALL_FUNCTIONS
    unknown = [name for name in functions if name not in BY_NAME]
    if unknown:
        raise InputError(
            f"function {unknown[0]!r} is not known", f"psdmc generates {', '.join(ALL_FUNCTIONS)}"
        )
    return tuple(name for name in ALL_FUNCTIONS if name in functions)


def _refusal(model: DynamicsModel, singular: SingularMassMatrix) -> InputError:
    joint = model.joint_names[singular.joint]
    return InputError(
        f"{model.chain.name}: forward_dynamics: joint {joint!r} moves no inertia, the mass matrix is singular for every q",
        "give its link an inertia, add --drive-inertia, or leave forward_dynamics out of --functions",
    )


def _kernel(function: Function, theta: bool, single: Program, batch: Program, lowering: str) -> Kernel:
    for_one, shared = ordered(shortened(single))
    if batch == single:
        return Kernel(function, theta, for_one, shared, lowering)
    for_lanes = ordered(shortened(batch))[1]
    if shared == for_one and BATCH.score(for_one) <= WORTH_TWO_BODIES * BATCH.score(for_lanes):
        for_lanes = shared
    return Kernel(function, theta, for_one, for_lanes, lowering)


class _Lowered:
    """One model's programs; searches are shared between the functions that run the same recursion."""

    def __init__(self, model: DynamicsModel, lowering: Lowering) -> None:
        self.model, self.lowering = model, lowering
        self._spaces: Spaces = {}
        self._searches: dict[bool, Search] = {}
        self._arrangements: dict[tuple[str, bool], Arrangement] = {}
        self._traced: dict[tuple[str, bool], tuple[Program, ...]] = {}

    def kernel(self, function: Function, theta: bool) -> Kernel:
        candidates: list[Kernel] = []
        if self._may_expand(function):
            program = lower_expanded(self.model, function.name, theta)
            candidates.append(_kernel(function, theta, program, program, "expanded"))
        if self.lowering != "expanded" or not candidates:
            single = self._factored(function.name, theta, SINGLE)
            batch = self._factored(function.name, theta, BATCH)
            candidates.append(_kernel(function, theta, single, batch, "factored"))
        return min(candidates, key=lambda kernel: SINGLE.score(kernel.single))

    def _may_expand(self, function: Function) -> bool:
        if self.lowering == "factored" or function.name not in SUPPORTED or self.model.p is None:
            return False
        return self.lowering == "expanded" or self.model.p <= EXPANDED_LIMIT

    def _factored(self, name: str, theta: bool, target: Target) -> Program:
        return min(self._candidates(name, theta), key=target.score)

    def _candidates(self, name: str, theta: bool) -> tuple[Program, ...]:
        """What the targets choose from; traced once for all of them."""
        if (name, theta) not in self._traced:
            self._traced[name, theta] = tuple(self._traces(name, theta))
        return self._traced[name, theta]

    def _traces(self, name: str, theta: bool) -> Iterator[Program]:
        search = self._search(theta)
        if name == "jacobian" or name in REGRESSORS:
            for feet in search.feet():
                reframed, _ = search.space(feet)
                yield (
                    trace_jacobian(reframed)
                    if name == "jacobian"
                    else trace_regressor(name, reframed, self.model.representative)
                )
        else:
            yield from search.rearrangements(name, self._arrangement(SHARED.get(name, name), theta))

    def _arrangement(self, name: str, theta: bool) -> Arrangement:
        if (name, theta) not in self._arrangements:
            start = None if name == GEOMETRY else self._arrangement(GEOMETRY, theta)
            self._arrangements[name, theta] = self._search(theta).best(name, SINGLE, start)
        return self._arrangements[name, theta]

    def _search(self, theta: bool) -> Search:
        if theta not in self._searches:
            baked = None if theta else self.model.theta_b
            self._searches[theta] = Search(
                self.model.chain, self.model.representative, baked, spaces=self._spaces
            )
        return self._searches[theta]
