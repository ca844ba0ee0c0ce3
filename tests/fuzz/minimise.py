"""A find made small: pieces are left out as long as the same fault shows."""

from __future__ import annotations

import copy
import io
import json
import time
import zipfile
from collections.abc import Callable, Iterator
from xml.etree.ElementTree import ParseError, fromstring, tostring

Shows = Callable[[bytes], bool]


def minimised(
    data: bytes, shows: Shows, ways: tuple[Callable[[bytes], Iterator[bytes]], ...], seconds: float
) -> bytes:
    """The smallest input found within this time for which `shows` still holds; each step leaves one piece out."""
    end = time.monotonic() + seconds
    best, progress = data, True
    while progress:
        progress = False
        for way in ways:
            for candidate in way(best):
                if time.monotonic() > end:
                    return best
                if len(candidate) < len(best) and shows(candidate):
                    best, progress = candidate, True
                    break
    return best


def smaller_runs(data: bytes) -> Iterator[bytes]:
    """Without one half, quarter, ... of the bytes, down to one byte where there are few."""
    yield from _without_runs(data, lambda parts: b"".join(parts), [data[k : k + 1] for k in range(len(data))])


def smaller_lines(data: bytes) -> Iterator[bytes]:
    lines = data.splitlines(keepends=True)
    if len(lines) > 1:
        yield from _without_runs(data, b"".join, lines)
    cells = [cell for line in lines[:200] for cell in _keep_ends(line, b",")]
    if len(lines) <= 200 and 1 < len(cells) <= 2000:
        yield from _without_runs(data, b"".join, cells)


def _keep_ends(line: bytes, end: bytes) -> list[bytes]:
    parts = line.split(end)
    return [part + end for part in parts[:-1]] + parts[-1:]


def _without_runs(data: bytes, joined: Callable[[list[bytes]], bytes], parts: list[bytes]) -> Iterator[bytes]:
    run = len(parts) // 2
    smallest = max(len(parts) // 2000, 1)
    while run >= smallest:
        for at in range(0, len(parts), run):
            yield joined(parts[:at] + parts[at + run :])
        run //= 2


def smaller_xml(data: bytes) -> Iterator[bytes]:
    """Without an element, or without an attribute."""
    try:
        root = fromstring(data)
    except (ParseError, ValueError, LookupError):
        return
    elements = list(root.iter())
    for k, element in enumerate(elements):
        for number in range(len(element)):
            other = copy.deepcopy(root)
            parent = list(other.iter())[k]
            del parent[number]
            yield tostring(other, encoding="utf-8")
    for k, element in enumerate(elements):
        for name in element.attrib:
            other = copy.deepcopy(root)
            del list(other.iter())[k].attrib[name]
            yield tostring(other, encoding="utf-8")


def smaller_options(data: bytes) -> Iterator[bytes]:
    """A robot with options: without an option, or with a smaller text."""
    try:
        whole = json.loads(data)
        text, options = whole["robot"].encode(), dict(whole["options"])
    except (ValueError, RecursionError, KeyError, TypeError, AttributeError):
        return
    for name in options:
        left = {other: value for other, value in options.items() if other != name}
        yield json.dumps({"robot": text.decode(), "options": left}).encode()
    for smaller in (smaller_xml(text), smaller_lines(text)):
        for shorter in smaller:
            robot = shorter.decode(errors="replace")
            yield json.dumps({"robot": robot, "options": options}).encode()


def smaller_archive(data: bytes) -> Iterator[bytes]:
    """Without a member, and compressed."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
    except Exception:
        return
    for left_out in (None, *members):
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in members.items():
                if name != left_out:
                    archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
        yield stream.getvalue()
