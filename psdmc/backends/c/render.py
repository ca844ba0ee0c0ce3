"""The Jinja environment: undefined names are errors, and every template is read from the installed package."""

from __future__ import annotations

from functools import cache
from importlib import resources
from pathlib import Path

from jinja2 import Environment, FunctionLoader, StrictUndefined

from psdmc.backends.c.kept_templates import CodeBesideTemplates
from psdmc.backends.c.names import c_comment, c_string


def _source(name: str) -> str | None:
    file = resources.files("psdmc.templates").joinpath(name)
    return file.read_text(encoding="utf-8") if file.is_file() else None


def _kept() -> CodeBesideTemplates | None:
    """None where templates are no files, as in a zipped installation."""
    folder = resources.files("psdmc.templates")
    return CodeBesideTemplates(folder) if isinstance(folder, Path) else None


@cache
def environment() -> Environment:
    """The one environment; filters `comment` and `string` make untrusted text safe in C."""
    made = Environment(
        loader=FunctionLoader(_source),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
        bytecode_cache=_kept(),
    )
    made.filters["comment"] = c_comment
    made.filters["string"] = c_string
    return made


def render(template: str, **view: object) -> str:
    """A template's text, filled from its view objects."""
    return environment().get_template(template).render(**view)
