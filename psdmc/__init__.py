"""psdmc: a compiler for robot dynamics. A robot in; small, fast, verified C out."""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from psdmc.calibrate.api import calibrate
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
    "calibrate",
    "compile",
    "derive",
    "emit_c",
    "load",
]

_MODULES = {name: "psdmc.errors" for name in __all__ if name.endswith("Error")}
_MODULES |= dict.fromkeys(("compile", "derive", "emit_c"), "psdmc.compiler")
_MODULES |= {
    "calibrate": "psdmc.calibrate.api",
    "DynamicsModel": "psdmc.model.dynamics_model",
    "load": "psdmc.model.store",
}
"""Where each name is: loaded when it is first used, so that the command line's first words cost nothing."""


class _Package(ModuleType):
    """The package, in which the functions `calibrate` and `derive` are not hidden by the folders of these names."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _MODULES and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'psdmc' has no attribute {name!r}")
    found = getattr(import_module(_MODULES[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


sys.modules[__name__].__class__ = _Package
