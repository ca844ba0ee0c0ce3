"""The friction laws that psdmc offers. Each file in this folder describes one law by an object LAW."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from psdmc.errors import InternalError
from psdmc.friction.law import Law


def _law(file: str) -> Law:
    law: Law = import_module(f"{__name__}.{file}").LAW
    if law.name != file:
        raise InternalError(f"psdmc/friction/laws/{file}.py is the file of {law.name}")
    return law


LAWS: dict[str, Law] = {name: _law(name) for name in sorted(module.name for module in iter_modules(__path__))}
