"""The Jinja environment. Undefined names are errors, and all templates are read from the installed package."""

from __future__ import annotations

from collections.abc import Callable
from importlib import resources
from pathlib import Path

from jinja2 import Environment, FunctionLoader, StrictUndefined

from psdmc.backends.kept_templates import CodeBesideTemplates


def _source(name: str) -> str | None:
    file = resources.files("psdmc.templates").joinpath(name)
    return file.read_text(encoding="utf-8") if file.is_file() else None


def _kept() -> CodeBesideTemplates | None:
    """None where templates are no files, as in a zipped installation."""
    folder = resources.files("psdmc.templates")
    return CodeBesideTemplates(folder) if isinstance(folder, Path) else None


def environment_with(**filters: Callable[..., str]) -> Environment:
    """Return a Jinja environment (settings for filling templates) with the filters of one language. The filters make
    untrusted text safe in this language."""
    made = Environment(
        loader=FunctionLoader(_source),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
        bytecode_cache=_kept(),
    )
    made.filters.update(filters)
    return made
