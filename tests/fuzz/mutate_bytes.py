"""Mutations that know nothing of the format: bits, runs, and lines."""

from __future__ import annotations

import re
from random import Random

from nasty import near, number, text

NUMBER = re.compile(r"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
WORD = re.compile(r"[A-Za-z_]\w*")
ENCODINGS = ("utf-16", "utf-16-le", "utf-32", "utf-8-sig", "latin-1", "cp1252")
LONGEST_RUN = 64


def mutate_bytes(data: bytes, rng: Random) -> bytes:
    """Flip, set, insert, drop, repeat or cut."""
    if not data:
        return bytes(rng.randrange(256) for _ in range(rng.randint(0, 8)))
    found = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 4, 8))):
        _one_edit(found, rng)
    return bytes(found)


def _one_edit(found: bytearray, rng: Random) -> None:
    at = rng.randrange(len(found) + 1)
    run = rng.randint(1, LONGEST_RUN) if rng.random() < 0.3 else 1
    choice = rng.randrange(7)
    if choice == 0 and at < len(found):
        found[at] ^= 1 << rng.randrange(8)
    elif choice == 1 and at < len(found):
        found[at] = rng.choice((0, 1, 0x20, 0x7F, 0x80, 0xFF, rng.randrange(256)))
    elif choice == 2:
        found[at:at] = bytes(rng.randrange(256) for _ in range(run))
    elif choice == 3:
        del found[at : at + run]
    elif choice == 4:
        found[at:at] = found[at : at + run]
    elif choice == 5:
        found[at : at + run] = rng.choice((b"\0", b"\xff")) * run
    elif rng.random() < 0.2:
        del found[at:]


def mutate_lines(data: bytes, rng: Random) -> bytes:
    """Numbers, words and lines of a text; now and then its encoding."""
    try:
        source = data.decode("utf-8")
    except UnicodeDecodeError:
        return mutate_bytes(data, rng)
    for _ in range(rng.choice((1, 1, 2, 3))):
        source = _text_edit(source, rng)
    if rng.random() < 0.02:
        return source.encode(rng.choice(ENCODINGS), errors="replace")
    return source.encode("utf-8", errors="replace")


def _text_edit(source: str, rng: Random) -> str:
    choice = rng.randrange(6)
    if choice < 3:
        pattern, other = (NUMBER, near) if choice < 2 else (WORD, lambda word, rng: text(rng))
        places = list(pattern.finditer(source))
        if places:
            place = rng.choice(places)
            return source[: place.start()] + other(place[0], rng) + source[place.end() :]
    lines = source.splitlines(keepends=True) or [""]
    at, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    if choice == 3:
        del lines[at]
    elif choice == 4:
        lines.insert(other, lines[at])
    else:
        lines.insert(at, rng.choice((number, text))(rng) + "\n")
    return "".join(lines)
