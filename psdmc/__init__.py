"""psdmc: a compiler for robot dynamics. A robot in; small, fast, verified C out."""

from psdmc.compiler import compile, derive, emit_c
from psdmc.errors import DerivationError, InputError, InternalError, PsdmcError, ToolchainError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.store import load

__all__ = [
    "DerivationError",
    "DynamicsModel",
    "InputError",
    "InternalError",
    "PsdmcError",
    "ToolchainError",
    "compile",
    "derive",
    "emit_c",
    "load",
]
