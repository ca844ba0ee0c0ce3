"""The functions `psdmc.jax` and `psdmc.torch`. JAX and PyTorch are optional; `psdmc.jax` imports JAX when it is called,
and `psdmc.torch` imports PyTorch."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from psdmc.errors import ToolchainError
from psdmc.lower.kernels import Lowering
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.target.presets import NATIVE
from psdmc.target.target import Real, Target, Trig

if TYPE_CHECKING:
    from psdmc.frameworks.jax_robot import JaxRobot
    from psdmc.frameworks.torch_robot import TorchRobot


def jax(
    model: DynamicsModel | str | Path,
    lowering: Lowering = "auto",
    real: Real | None = None,
    trig: Trig | None = None,
    target: str | Target = NATIVE,
    gravity_input: bool = False,
) -> JaxRobot:
    """Return an object whose methods compute a model's dynamics on arrays of JAX. They run compiled code on the CPU.

    The object has a method for each generated function, such as `robot.forward_dynamics(q, qd, tau)`. The methods work
    inside jax.jit, vmap, grad, jvp, jacfwd, jacrev, lax.scan and lax.map. psdmc compiles a function when JAX
    first traces it.

    model          a model, or the path of a model file
    real           precision of all arrays, "float64" or "float32"; None: float64
    gravity_input  True: methods whose results depend on gravity have the argument `gravity`, (3,) or (..., 3), m/s^2, with
                   its own gradient. The default is the gravity of the model, which you derive with `gravity_input=True`

    `compile` and `emit_c` explain the other options. Raises InputError if the precision is float64 and JAX's option
    jax_enable_x64 is off. Raises ToolchainError if JAX is not installed.

    >>> robot = psdmc.jax("kr6.npz", real="float32")  # doctest: +SKIP
    >>> jax.grad(lambda q: robot.potential_energy(q))(q)  # doctest: +SKIP
    """
    try:
        from psdmc.frameworks.jax_robot import jax_robot
    except ModuleNotFoundError as error:
        raise _missing(error, "JAX", "jax", "jaxlib") from error
    return jax_robot(model, lowering, real, trig, target, gravity_input)


def torch(
    model: DynamicsModel | str | Path,
    lowering: Lowering = "auto",
    trig: Trig | None = None,
    target: str | Target = NATIVE,
    gravity_input: bool = False,
) -> TorchRobot:
    """Return an object whose methods compute a model's dynamics on tensors of PyTorch. They run compiled code on the CPU.

    The object has a method for each generated function, such as `robot.forward_dynamics(q, qd, tau)`. The methods have
    gradients. They also work inside torch.compile and torch.func.vmap, grad, jvp, jacrev and jacfwd. psdmc compiles a
    function when you first call it, separately for float32 and float64.

    model          a model, or the path of a model file
    gravity_input  True: methods whose results depend on gravity have the argument `gravity`, (3,) or (..., 3), m/s^2, with
                   its own gradient. The default is the gravity of the model, which you derive with `gravity_input=True`

    `compile` and `emit_c` explain the other options. Raises ToolchainError if PyTorch is not installed.

    >>> robot = psdmc.torch("kr6.npz")  # doctest: +SKIP
    >>> robot.inverse_dynamics(q, qd, qdd).sum().backward()  # doctest: +SKIP
    """
    try:
        from psdmc.frameworks.torch_robot import torch_robot
    except ModuleNotFoundError as error:
        raise _missing(error, "PyTorch", "torch") from error
    return torch_robot(model, lowering, trig, target, gravity_input)


def _missing(error: ModuleNotFoundError, library: str, *modules: str) -> Exception:
    """The error if a library is not installed; `error` itself if another module is missing."""
    if (error.name or "").split(".")[0] not in modules:
        return error
    extra = modules[0]
    return ToolchainError(
        f"psdmc.{extra} needs {library}, which is not installed", f"pip install 'psdmc[{extra}]'"
    )
