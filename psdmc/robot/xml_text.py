"""XML that is looked at before anything else reads it, and numbers in its attributes."""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element, ParseError

import defusedxml.ElementTree
from defusedxml.common import DefusedXmlException

from psdmc.errors import InputError


def parse_xml(text: str, source: str, root_tag: str) -> Element:
    """The root element; InputError where it is no XML, has another root, or defines or fetches entities."""
    try:
        root: Element = defusedxml.ElementTree.fromstring(text)
    except DefusedXmlException as error:
        kind = type(error).__name__
        raise InputError(
            f"{source}: XML entities are not allowed ({kind})", "remove the <!DOCTYPE> with its entities"
        ) from None
    except (ParseError, ValueError) as error:
        raise InputError(
            f"{source}: not well-formed XML: {error}", "give a URDF or a DH .toml file"
        ) from None
    if root.tag != root_tag:
        raise InputError(f"{source}: the root element is <{root.tag}>, expected <{root_tag}>", "give a URDF")
    if any("xacro" in str(element.tag) for element in root.iter()):
        raise InputError(
            f"{source}: this is a xacro file, not a URDF", "expand it first: xacro FILE > robot.urdf"
        )
    return root


def numbers(element: Element | None, attribute: str, default: tuple[float, ...]) -> tuple[float, ...]:
    """Finite numbers from an attribute, as many as `default` has; ValueError says what was found."""
    text = None if element is None else element.get(attribute)
    if element is None or text is None:
        return default
    values = [_number(word) for word in text.split()]
    finite = [value for value in values if value is not None]
    if len(finite) != len(values) or len(values) != len(default):
        wanted = "a finite number" if len(default) == 1 else f"{len(default)} finite numbers"
        raise ValueError(f"<{element.tag}> {attribute}='{text}', expected {wanted}")
    return tuple(finite)


def number(element: Element | None, attribute: str, default: float) -> float:
    return numbers(element, attribute, (default,))[0]


def required_number(element: Element | None, tag: str, attribute: str) -> float:
    """A number that must be there; ValueError where it is not."""
    if element is None:
        raise ValueError(f"<{tag}> is missing")
    if element.get(attribute) is None:
        raise ValueError(f"<{tag}> has no {attribute}")
    return number(element, attribute, math.nan)


def _number(word: str) -> float | None:
    try:
        value = float(word)
    except ValueError:
        return None
    return value if math.isfinite(value) and "_" not in word else None
