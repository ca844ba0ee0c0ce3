"""The functions that make robots for array frameworks. The frameworks are optional, and imported when they are asked for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from psdmc.errors import ToolchainError
from psdmc.lower.kernels import Lowering
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.target.native import NATIVE
from psdmc.target.target import Real, Target, Trig

if TYPE_CHECKING:
    from psdmc.frameworks.jax_robot import JaxRobot


def jax(
    model: DynamicsModel | str | Path,
    lowering: Lowering = "auto",
    real: Real | None = None,
    trig: Trig | None = None,
    target: str | Target = NATIVE,
) -> JaxRobot:
    """Return the functions of a model as functions of JAX, which run compiled code on the CPU.

    The result has a method for each generated function, such as `robot.forward_dynamics(q, qd, tau)`. The methods work
    inside jax.jit, vmap, grad, jvp, jacfwd, jacrev, lax.scan and lax.map. psdmc compiles a function when JAX
    first traces it.

    model  a model, or the path of a model file
    real   precision of all arrays, "float64" or "float32"; None: float64

    `compile` and `emit_c` explain the other options. Raises InputError if the precision is float64 and JAX's option
    jax_enable_x64 is off. Raises ToolchainError if JAX is not installed.

    >>> robot = psdmc.jax("kr6.npz", real="float32")  # doctest: +SKIP
    >>> jax.grad(lambda q: robot.potential_energy(q))(q)  # doctest: +SKIP
    """
    try:
        from psdmc.frameworks.jax_robot import jax_robot
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] not in ("jax", "jaxlib"):
            raise
        raise ToolchainError(
            "psdmc.jax needs JAX, which is not installed", "pip install 'psdmc[jax]'"
        ) from error
    return jax_robot(model, lowering, real, trig, target)
