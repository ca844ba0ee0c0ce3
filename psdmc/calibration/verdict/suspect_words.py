"""Hypotheses on a log's columns in words."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.calibration.verdict.verdict import listed


def in_words(
    names: Sequence[str],
    order: Sequence[int],
    signs: Sequence[int],
    effort_order: Sequence[int],
    effort_signs: Sequence[int],
) -> str:
    """A sentence for the hypothesis that joint k's position is signs[k] times column order[k] of the log, and its
    effort likewise."""
    parts = []
    if order == effort_order:
        parts += _permutation(order, names, "position and effort")
    else:
        parts += _permutation(order, names, "position")
        parts += _permutation(effort_order, names, "effort")
    parts += _signs(signs, effort_signs, names)
    return ", and ".join(parts)


def _signs(signs: Sequence[int], effort_signs: Sequence[int], names: Sequence[str]) -> list[str]:
    if all(sign < 0 for sign in effort_signs) and all(sign > 0 for sign in signs):
        return ["the effort of every joint has the opposite sign"]
    kinds = {
        "position and effort": [p < 0 and e < 0 for p, e in zip(signs, effort_signs, strict=True)],
        "position": [p < 0 < e for p, e in zip(signs, effort_signs, strict=True)],
        "effort": [e < 0 < p for p, e in zip(signs, effort_signs, strict=True)],
    }
    found = []
    for what, turned in kinds.items():
        joints = [name for name, yes in zip(names, turned, strict=True) if yes]
        if joints:
            verb = "have" if " and " in what or len(joints) > 1 else "has"
            found.append(f"{what} of {listed(joints)} {verb} the opposite sign")
    return found


def _permutation(order: Sequence[int], names: Sequence[str], what: str) -> list[str]:
    found = []
    for cycle in cycles(order):
        joints = listed([names[k] for k in cycle])
        word = "swapped" if len(cycle) == 2 else "permuted"
        found.append(f"{joints} look {word} ({what})")
    return found


def cycles(order: Sequence[int]) -> list[list[int]]:
    """The cycles of a permutation that are longer than one."""
    seen: set[int] = set()
    found = []
    for start in range(len(order)):
        cycle = []
        k = start
        while k not in seen:
            seen.add(k)
            cycle.append(k)
            k = order[k]
        if len(cycle) > 1:
            found.append(cycle)
    return found


def exchanges(order: Sequence[int]) -> int:
    """Number of exchanges of pairs that make a permutation."""
    return sum(len(cycle) - 1 for cycle in cycles(order))
