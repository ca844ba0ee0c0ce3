"""psdmc: a compiler for robot dynamics. A robot in; small, fast, verified C out."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from psdmc.calibration.api import calibrate
    from psdmc.compiler import compile, derive, emit_c
    from psdmc.errors import DerivationError, InputError, InternalError, PsdmcError, ToolchainError
    from psdmc.model.dynamics_model import DynamicsModel
    from psdmc.model.load import load
    from psdmc.model.store import save

__all__ = [
    "DerivationError",
    "DynamicsModel",
    "InputError",
    "InternalError",
    "PsdmcError",
    "ToolchainError",
    "calibrate",
    "compile",
    "derive",
    "emit_c",
    "load",
    "save",
]

_MODULES = {name: "psdmc.errors" for name in __all__ if name.endswith("Error")}
_MODULES |= dict.fromkeys(("compile", "derive", "emit_c"), "psdmc.compiler")
_MODULES |= {
    "calibrate": "psdmc.calibration.api",
    "DynamicsModel": "psdmc.model.dynamics_model",
    "load": "psdmc.model.load",
    "save": "psdmc.model.store",
}
"""The module of each name. Modules are loaded when a name is first used, so that the command line starts fast."""


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'psdmc' has no attribute {name!r}")
    found = getattr(import_module(_MODULES[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
