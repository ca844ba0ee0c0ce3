"""psdmc is a compiler for robot dynamics: it reads a robot file and writes small, fast and verified C code."""

from __future__ import annotations

import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

from psdmc.model import answers
from psdmc.version import VERSION as __version__

if TYPE_CHECKING:
    from psdmc.calibration.api import calibrate
    from psdmc.calibration.comparison import compare
    from psdmc.calibration.payload import identify_payload
    from psdmc.calibration.validation import validate
    from psdmc.compiler import compile, derive, emit_c
    from psdmc.errors import DerivationError, InputError, InternalError, PsdmcError, ToolchainError
    from psdmc.export.export_urdf import export_urdf
    from psdmc.frameworks.api import jax, torch
    from psdmc.model.dynamics_model import DynamicsModel
    from psdmc.model.load import load
    from psdmc.model.store import save
    from psdmc.toolchain.call import CompiledRobot

__all__ = [
    "CompiledRobot",
    "DerivationError",
    "DynamicsModel",
    "InputError",
    "InternalError",
    "PsdmcError",
    "ToolchainError",
    "__version__",
    "calibrate",
    "compare",
    "compile",
    "derive",
    "emit_c",
    "export_urdf",
    "identify_payload",
    "jax",
    "load",
    "save",
    "torch",
    "validate",
]

_MODULES = {"CompiledRobot": "psdmc.toolchain.call"}
_MODULES |= {name: "psdmc.errors" for name in __all__ if name.endswith("Error")}
_MODULES |= dict.fromkeys(("compile", "derive", "emit_c"), "psdmc.compiler")
_MODULES |= {
    "calibrate": "psdmc.calibration.api",
    "compare": "psdmc.calibration.comparison",
    "export_urdf": "psdmc.export.export_urdf",
    "identify_payload": "psdmc.calibration.payload",
    "jax": "psdmc.frameworks.api",
    "DynamicsModel": "psdmc.model.dynamics_model",
    "load": "psdmc.model.load",
    "save": "psdmc.model.store",
    "torch": "psdmc.frameworks.api",
    "validate": "psdmc.calibration.validation",
}
"""The module of each name. Modules are loaded when a name is first used, so that the command line starts fast."""


if not TYPE_CHECKING:  # a type checker would take any name that there is none of

    def __getattr__(name: str) -> Any:
        if name not in _MODULES:
            raise AttributeError(f"module 'psdmc' has no attribute {name!r}")
        found = getattr(import_module(_MODULES[name]), name)
        globals()[name] = found
        return found


answers.provide(lambda: import_module("psdmc.model_functions").provider())


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


_MOVED = {
    "psdmc.derive": "psdmc.derivation",
    "psdmc.calibrate": "psdmc.calibration",
    "psdmc.derivation.functions": "psdmc.derivation.monomials",
    "psdmc.emit": "psdmc.backends.c",
    "psdmc.model.check": "psdmc.verification.check",
    "psdmc.calibration.identify.physical_links": "psdmc.links.physical_links",
    "psdmc.calibration.identify.prediction": "psdmc.model.calibrated",
    "psdmc.calibration.verdict.verdict": "psdmc.model.calibrated",
    "psdmc.program.functions": "psdmc.program.signature",
    "psdmc.robot.chain": "psdmc.robot.mechanism",
}
"""Packages and modules of psdmc 0.1 and 0.2 that have another name now."""


class _Moved:
    """Import finder that raises ModuleNotFoundError with the new name of a moved module; Python asks it last."""

    @staticmethod
    def find_spec(name: str, path: object = None, target: object = None) -> None:
        for old, new in _MOVED.items():
            if name == old or name.startswith(f"{old}."):
                raise ModuleNotFoundError(
                    f"no module {old!r}: after psdmc 0.1 it was renamed {new!r}", name=name
                )


sys.meta_path.append(_Moved)
