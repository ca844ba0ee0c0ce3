"""The kinds of effects that a fit can have beside rigid bodies and plain friction: one file of this folder each, described
by its KIND."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from psdmc.calibration.columns.effect import Kind, Section
from psdmc.errors import InternalError


def _kind(file: str) -> Kind:
    kind: Kind = import_module(f"{__name__}.{file}").KIND
    if kind.name != file.removesuffix("_spring"):
        raise InternalError(f"psdmc/calibration/columns/kinds/{file}.py is the file of {kind.name}")
    return kind


_FOUND = tuple(_kind(name) for name in sorted(module.name for module in iter_modules(__path__)))


def kinds_of(section: Section) -> dict[str, Kind]:
    """The kinds of one section of a description, by name."""
    return {kind.name: kind for kind in _FOUND if kind.section == section}
