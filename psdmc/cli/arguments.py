"""Read options that take a list: separated by commas, given several times, and for numbers also as several words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from psdmc.errors import InputError

SEVERAL_WORDS: Mapping[str, int] = {"--gravity": 3, "--tool": 6}
"""Options of as many numbers, which may stand side by side: `--gravity 0 0 -9.81`."""


def names(given: Sequence[str] | None) -> tuple[str, ...]:
    """Return the names in all values of an option, in order."""
    return tuple(name for value in given or () for word in value.split(",") if (name := word.strip()))


def numbers(given: Sequence[str] | None, option: str, hint: str) -> tuple[float, ...] | None:
    """Return the numbers in all values of an option; None if it is not given. Raise InputError for other words."""
    if not given:
        return None
    text = ",".join(given)
    try:
        return tuple(float(word) for word in text.split(","))
    except ValueError:
        raise InputError(f"{option} is {text!r}", hint) from None


def assignments(given: Sequence[str] | None) -> tuple[str, ...]:
    """Return the texts NAME=VALUE in all values of an option, in order. A comma separates two texts only if the next
    word has a "=", as names in robot files may contain commas."""
    found: list[str] = []
    for value in given or ():
        pending: list[str] = []
        for word in value.split(","):
            pending.append(word)
            if "=" in word:
                found.append(",".join(pending).strip())
                pending = []
        if pending:
            found.append(",".join(pending).strip())
    return tuple(word for word in found if word)


def with_numbers_joined(words: Sequence[str]) -> list[str]:
    """Return the command line with the numbers after some options joined by commas.

    For example, `--gravity 0 0 -9.81` becomes `--gravity 0,0,-9.81`.
    """
    joined: list[str] = []
    rest = list(words)
    while rest:
        word = rest.pop(0)
        joined.append(word)
        most = SEVERAL_WORDS.get(word, 0)
        taken: list[str] = []
        while rest and sum(map(_count, taken)) < most and _is_numeric(rest[0]):
            taken.append(rest.pop(0))
        if taken:
            joined.append(",".join(part.strip(",") for part in taken))
    return joined


def _count(word: str) -> int:
    return len(word.strip(",").split(","))


def _is_numeric(word: str) -> bool:
    try:
        [float(part) for part in word.strip(",").split(",")]
    except ValueError:
        return False
    return True


def parsed_torque_constants(given: list[str] | None) -> dict[str, float] | None:
    """Return the torque constants by joint from 'joint=36.1,...'; None if nothing is given."""
    found: dict[str, float] = {}
    for word in assignments(given):
        name, _, value = word.rpartition("=")
        try:
            constant = float(value)
        except ValueError:
            raise InputError(f"--torque-constants: {word!r}", "write JOINT=NUMBER,JOINT=NUMBER") from None
        name = name.strip()
        if not name or name in found:
            what = f"joint {name!r} twice" if name else f"{word!r} names no joint"
            raise InputError(f"--torque-constants: {what}", "write JOINT=NUMBER,JOINT=NUMBER")
        found[name] = constant
    return found or None
