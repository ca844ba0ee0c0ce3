"""Parses XML after a safety check, and reads numbers from XML attributes."""

from __future__ import annotations

import math
import re
from xml.etree.ElementTree import Element, ParseError
from xml.parsers.expat import errors

import defusedxml.ElementTree
from defusedxml.common import DefusedXmlException

from psdmc.errors import InputError
from psdmc.robot.limits import MAX_CHARACTERS, Range, decimal, shown, words

UNBOUND_PREFIX = errors.codes[errors.XML_ERROR_UNBOUND_PREFIX]
"""Of a parser's error: a prefix that nothing declares."""

ROOT = re.compile(r"\s*(?:<\?xml.*?\?>|<!--.*?-->|\s+)*<\s*([\w:.-]+)", re.DOTALL)
"""Up to the name of an XML text's root element."""

PREFIX = re.compile(r"<([A-Za-z_][\w.-]*):|\s([A-Za-z_][\w.-]*):[\w.-]+\s*=")
"""The prefix of an element's or an attribute's name."""

RESERVED = ("xml", "xmlns", "xacro")
"""Prefixes that are not made up where they are not declared: what xacro must expand is no foreign word."""

UNDECLARED = "urn:psdmc:undeclared:"
"""Name spaces of prefixes that a file uses and does not declare begin so."""


def root_tag(text: str) -> str:
    """Return the name of the root element of an XML text, or '' if there is none."""
    found = ROOT.match(text.lstrip("\ufeff"))
    return found[1] if found else ""


def parse_xml(text: str, source: str, expected: str) -> Element:
    """Return the root element of an XML text, without its default name space.

    Raises InputError if the text is no XML, if the root element is not `expected`, or if it defines or fetches
    entities.
    """
    try:
        root = _without_space(_parsed(text.lstrip()))
    except DefusedXmlException as error:
        kind = type(error).__name__
        raise InputError(
            f"{source}: XML entities are not allowed ({kind})", "remove the <!DOCTYPE> with its entities"
        ) from None
    except (ParseError, ValueError, LookupError) as error:
        raise InputError(
            f"{source}: not well-formed XML: {error}", "give a URDF or a DH .toml file"
        ) from None
    if root.tag != expected:
        found = root.tag if str(root.tag).isidentifier() and len(root.tag) < 50 else shown(root.tag)
        raise InputError(f"{source}: the root element is <{found}>, expected <{expected}>", "give a URDF")
    if any("xacro" in str(element.tag) for element in root.iter()):
        raise InputError(
            f"{source}: this is a xacro file, not a URDF", "expand it first: xacro FILE > robot.urdf"
        )
    return root


def _parsed(text: str) -> Element:
    """The root element; prefixes that nothing declares, which other readers take for letters of a name, are declared."""
    try:
        root: Element = defusedxml.ElementTree.fromstring(text)
    except ParseError as error:
        start = ROOT.match(text)
        if error.code != UNBOUND_PREFIX or start is None:
            raise
        head = text[start.end() : text.find(">", start.end())]
        used = dict.fromkeys(one or other for one, other in PREFIX.findall(text))
        missing = [name for name in used if name not in RESERVED and f"xmlns:{name}" not in head]
        declared = "".join(f' xmlns:{name}="{UNDECLARED}{name}"' for name in missing)
        root = defusedxml.ElementTree.fromstring(text[: start.end()] + declared + text[start.end() :])
    return root


def _without_space(root: Element) -> Element:
    """The tree with names of the root's own name space as they are written in the file."""
    space, brace, _ = str(root.tag).rpartition("}")
    for element in root.iter() if brace else ():
        if isinstance(element.tag, str):
            element.tag = element.tag.removeprefix(space + brace)
    return root


def only(parent: Element, tag: str) -> Element | None:
    """Return the child element with this name, or None if there is none. Raises ValueError if there are several."""
    found = parent.findall(tag)
    if len(found) > 1:
        raise ValueError(f"{len(found)} <{tag}> elements, expected one")
    return found[0] if found else None


def numbers(
    element: Element | None, attribute: str, default: tuple[float, ...], accepted: Range
) -> tuple[float, ...]:
    """Return the numbers that an XML attribute lists, as many as `default` has. Raises ValueError, with the text found,
    if a number is out of range."""
    text = None if element is None else element.get(attribute)
    if element is None or text is None:
        return default
    written = f"<{element.tag}> {attribute}={_quoted(text)}"
    values = [decimal(word) for word in words(text)]
    finite = [value for value in values if value is not None]
    if len(finite) != len(values) or len(values) != len(default):
        wanted = "a finite number" if len(default) == 1 else f"{len(default)} finite numbers"
        long = (
            f" of at most {MAX_CHARACTERS} characters"
            if any(len(word) > MAX_CHARACTERS for word in words(text))
            else ""
        )
        raise ValueError(f"{written}, expected {wanted}{long}")
    for value in finite:
        fault = accepted.fault(value)
        if fault:
            raise ValueError(f"{written} {fault}")
    return tuple(finite)


def number(
    element: Element | None, attribute: str, default: float, accepted: Range, *, is_magnitude: bool = False
) -> float:
    """Return one number from an attribute. Raises ValueError out of range, or for a negative magnitude."""
    value = numbers(element, attribute, (default,), accepted)[0]
    if is_magnitude and value < 0.0 and element is not None:
        raise ValueError(f"<{element.tag}> {attribute}='{value:g}' is negative, expected no less than zero")
    return value


def required_number(element: Element | None, tag: str, attribute: str, accepted: Range) -> float:
    """Return a number from an attribute. Raises ValueError if the attribute or its element is missing."""
    if element is None:
        raise ValueError(f"<{tag}> is missing")
    if element.get(attribute) is None:
        raise ValueError(f"<{tag}> has no {attribute}")
    return number(element, attribute, math.nan, accepted)


def _quoted(text: str) -> str:
    """A text quoted for a message: printable ASCII as it is, else with escapes, because the fault may be a character
    that cannot be seen."""
    plain = text.isascii() and text.isprintable() and "'" not in text
    return shown(text) if len(text) > MAX_CHARACTERS else f"'{text}'" if plain else ascii(text)
