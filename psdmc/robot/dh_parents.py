"""The parent of each row of a DH table: the row before, unless the row names another."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.robot.limits import shown
from psdmc.robot.mechanism import BASE

BASE_NAME = "base"
"""The name of the base in `parent`, as in messages and frames."""


def parents_of(names: Sequence[str], given: Sequence[object]) -> tuple[tuple[int, ...], list[str]]:
    """Each row's parent, counted from 0, or BASE; and faults, one sentence each.

    names   of the rows' joints
    given   each row's `parent` as the file has it: the name of a joint, or "base"; None: the row before

    The rows of a branch stand together: a row's parent is the row before it, or one that carries that row.
    """
    parents: list[int] = []
    faults: list[str] = []
    if BASE_NAME in names and BASE_NAME in given:
        faults.append(f"a joint is called '{BASE_NAME}', and a parent: rename the joint")
    for i, parent in enumerate(given):
        open_rows = [BASE, *_carriers(parents, i - 1)]
        where = i - 1 if parent is None else _row(names, parent)
        if where is None:
            said = f"found {shown(parent)}, expected '{BASE_NAME}' or the name of a joint"
        elif where not in open_rows:
            can = ", ".join(shown(BASE_NAME if k == BASE else names[k]) for k in open_rows)
            said = f"{shown(parent)} is not open here: a branch's joints follow one another; expected one of {can}"
        else:
            parents.append(where)
            continue
        faults.append(f"joint {shown(names[i])}: parent: {said}")
        parents.append(i - 1)
    return tuple(parents), faults


def _row(names: Sequence[str], parent: object) -> int | None:
    if parent == BASE_NAME:
        return BASE
    return names.index(parent) if isinstance(parent, str) and parent in names else None


def _carriers(parents: Sequence[int], row: int) -> list[int]:
    """A row and the rows that carry it, from the base outward."""
    found: list[int] = []
    while row != BASE:
        found.append(row)
        row = parents[row]
    return found[::-1]
