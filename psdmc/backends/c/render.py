"""Fills the Jinja templates for C. The filters `comment` and `string` of the templates make untrusted text safe."""

from __future__ import annotations

from functools import cache
from importlib import resources

from jinja2 import Environment

from psdmc.backends.render import DEVICE, environment_with, identifier_of, utf8

LISTS = ("languages", "c_and_posix", "cmake", "libraries", "windows")
"""Files of reserved/: keywords of C and C++ and what compilers predefine for their platforms; everything that the C and
POSIX headers declare or define (tests/backends/c/platform_names.py makes and checks it); CMake's targets, variables and find
modules; libraries that linkers look for by themselves; Windows' devices and windows.h's macros.

A robot's name stands alone as a C++ namespace, a CMake target and package, a folder and lib<name>: there it must not meet
another's. Everywhere else it is a prefix."""


def _listed() -> frozenset[str]:
    texts = (resources.files("psdmc.backends.c").joinpath(f"reserved/{name}.txt") for name in LISTS)
    return frozenset(word for text in texts for word in text.read_text(encoding="ascii").split())


RESERVED = _listed()


def is_reserved(word: str) -> bool:
    """Return whether a robot with exactly this name would collide with a name of C, C++ or a library, or with a Windows
    device."""
    return word in RESERVED or DEVICE.fullmatch(word) is not None


def identifier(name: str) -> str:
    """Return a C and C++ identifier for `name`. It is never a name in RESERVED (words of C, C++ and their libraries)."""
    return identifier_of(name, is_reserved)


def c_string(text: str) -> str:
    """Return a C string literal of `text` as UTF-8: plain ASCII stays readable, and everything else is an octal escape.

    Octal escapes end after three digits, whatever follows. '?' is escaped too, so that no trigraph can form.
    """
    plain = {ord('"'): '\\"', ord("\\"): "\\\\", ord("?"): "\\?"}
    body = "".join(
        plain.get(byte) or (chr(byte) if 32 <= byte < 127 else f"\\{byte:03o}") for byte in utf8(text)
    )
    return f'"{body}"'


def c_comment(text: str) -> str:
    """Return `text` in a form that is safe inside a C comment: one line of ASCII that neither ends nor nests a comment.

    A '\\' could join lines, '/' next to '*' could open or close a comment, and '??' could begin a trigraph. Each of
    these is broken up.
    """
    ascii_text = "".join(chr(byte) if 32 <= byte < 127 else f"<{byte:02x}>" for byte in utf8(text))
    for dangerous, harmless in (("\\", "<5c>"), ("*/", "* /"), ("/*", "/ *"), ("??", "? ?")):
        while dangerous in ascii_text:
            ascii_text = ascii_text.replace(dangerous, harmless)
    return ascii_text


@cache
def environment() -> Environment:
    """The one environment of C's templates."""
    return environment_with(comment=c_comment, string=c_string)


def render(template: str, **view: object) -> str:
    """Fill a C template with the data that its variables name, and return the text."""
    return environment().get_template(template).render(**view)
