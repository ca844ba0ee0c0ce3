"""How many elements an MJCF file makes by repetition, and the refusal of too many: the time of MuJoCo's compiler grows with
their square, and no signal ends it.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element, ParseError

import defusedxml.ElementTree
from defusedxml.common import DefusedXmlException

from psdmc.errors import InputError
from psdmc.robot.limits import MAX_BYTES, MAX_COPIES, shown

REPEATING = ("replicate", "composite", "flexcomp")
"""Elements whose `count` says how many copies there are; of the last two, along up to three axes."""

WORD = re.compile(rb"<\s*(replicate|composite|flexcomp)\b")


class _Count(NamedTuple):
    """Elements that a part of a file stands for, and those of them that are copies."""

    elements: float
    copies: float


def refuse_many_copies(path: Path, source: str) -> None:
    """InputError where a file, with all that it includes, asks for more than MAX_COPIES elements by repetition, or repeats
    something and is no well-formed XML. Whatever else is wrong with it is left to MuJoCo."""
    copies = _of_file(path, path.parent, source, set()).copies
    if not copies <= MAX_COPIES:
        raise InputError(
            f"{source}: <replicate>, <composite> or <flexcomp> ask for {copies:.3g} elements, "
            f"expected {MAX_COPIES} at most",
            "give a smaller count",
        )


def _of_file(path: Path, folder: Path, source: str, known: set[Path]) -> _Count:
    """`folder`: what file names are relative to; a file is counted once, as MuJoCo takes it once."""
    if path in known:
        return _Count(1.0, 0.0)
    known.add(path)
    text = _text(path, source)
    try:
        root = defusedxml.ElementTree.fromstring(text)
    except (ParseError, DefusedXmlException, ValueError, LookupError) as error:
        if WORD.search(text) is None:
            return _Count(1.0, 0.0)
        raise InputError(
            f"{source}: not well-formed XML ({shown(str(error))}), so that what it repeats cannot be counted",
            "correct it, or write the copies out",
        ) from None
    return _of_element(root, folder, source, known)


def _text(path: Path, source: str) -> bytes:
    """A file's bytes; none of what is no file, or cannot be read. InputError where it is longer than robot files are."""
    try:
        if not path.is_file():
            return b""
        with path.open("rb") as file:
            text = file.read(MAX_BYTES + 1)
    except (OSError, ValueError):
        return b""
    if len(text) > MAX_BYTES:
        raise InputError(
            f"{source}: it includes {shown(path.name)}, which has more than {MAX_BYTES // 2**20} MiB",
            "include less",
        )
    return text


def _of_element(element: Element, folder: Path, source: str, known: set[Path]) -> _Count:
    inside = [_of_element(child, folder, source, known) for child in element]
    if element.tag == "include" and element.get("file"):
        inside.append(_of_file(folder / element.get("file", ""), folder, source, known))
    elements = sum(part.elements for part in inside)
    if element.tag in REPEATING:
        made = _times(element.get("count", "1")) * max(1.0, elements)
        return _Count(made, made)
    return _Count(1.0 + elements, sum(part.copies for part in inside))


def _times(count: str) -> float:
    """The product of the numbers of a `count`; one where there are none, which MuJoCo refuses."""
    try:
        return math.prod(max(1.0, float(number)) for number in count.split())
    except ValueError:
        return 1.0
