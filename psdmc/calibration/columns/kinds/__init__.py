"""The kinds of springs that a fit supports. Each file in this folder describes one kind, in its object KIND."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from psdmc.calibration.columns.effect import Kind
from psdmc.errors import InternalError


def _kind(file: str) -> Kind:
    kind: Kind = import_module(f"{__name__}.{file}").KIND
    if kind.name != file.removesuffix("_spring"):
        raise InternalError(f"psdmc/calibration/columns/kinds/{file}.py is the file of {kind.name}")
    return kind


KINDS = {kind.name: kind for kind in map(_kind, sorted(module.name for module in iter_modules(__path__)))}
