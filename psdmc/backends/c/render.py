"""Fills the Jinja templates for C. The filters `comment` and `string` of the templates make untrusted text safe."""

from __future__ import annotations

from functools import cache

from jinja2 import Environment

from psdmc.backends.c.names import c_comment, c_string
from psdmc.backends.render import environment_with


@cache
def environment() -> Environment:
    """The one environment of C's templates."""
    return environment_with(comment=c_comment, string=c_string)


def render(template: str, **view: object) -> str:
    """Fill a C template with the data that its variables name, and return the text."""
    return environment().get_template(template).render(**view)
