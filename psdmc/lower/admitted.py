"""Which functions a model can have: forward dynamics needs a positive definite mass matrix, baked code known parameters."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.errors import InputError
from psdmc.lower.kernels import ALL_FUNCTIONS
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.mass_check import check_mass_matrix
from psdmc.program.functions import BY_NAME

FORWARD = "forward_dynamics"


def require_forward_dynamics(model: DynamicsModel, functions: Sequence[str] | None) -> None:
    """InputError where forward dynamics is wanted (functions None: all) and `check_mass_matrix` fails."""
    reason = None if functions is not None and FORWARD not in functions else _without_forward(model)
    if reason is None:
        return
    others = ",".join(name for name in functions or ALL_FUNCTIONS if name != FORWARD)
    raise InputError(
        f"{model.chain.name}: no {FORWARD}: {reason}",
        f"correct the inertias, or calibrate with physical consistency; or leave it out: --functions {others}",
    )


def admitted(model: DynamicsModel) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of all functions that the model can have, and a sentence for each restriction."""
    reason = _without_forward(model)
    if reason is None:
        return ALL_FUNCTIONS, run_time_only(model, ALL_FUNCTIONS)
    names = tuple(name for name in ALL_FUNCTIONS if name != FORWARD)
    return names, (f"{FORWARD} is left out: {reason}", *run_time_only(model, names))


def run_time_only(model: DynamicsModel, functions: Sequence[str] | None) -> tuple[str, ...]:
    """A sentence that names those of `functions` (None: all) that only take parameters at run time, as theta_b is
    unknown; none where it is known or no function needs it."""
    wanted = ALL_FUNCTIONS if functions is None else functions
    names = [name for name in wanted if name in BY_NAME and BY_NAME[name].theta]
    if model.theta_b is not None or not names:
        return ()
    return (f"the base parameters are unknown: {', '.join(names)} take them at run time only, as NAME_theta",)


def _without_forward(model: DynamicsModel) -> str | None:
    """Why the model can have no forward dynamics; None where it can, or while its parameters are unknown."""
    mass = check_mass_matrix(model)
    return None if mass is None or mass.passed else mass.reason
