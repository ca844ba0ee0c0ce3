"""Writes the table of docs/how-to/springs-and-friction.md from the friction laws: python docs/friction_table.py."""

from __future__ import annotations

from pathlib import Path

from psdmc.friction.law import Law, Term, Value
from psdmc.friction.laws import LAWS

PAGE = Path(__file__).parent / "how-to" / "springs-and-friction.md"
HEAD = "| law | what it is | torque | found for each joint |"
SAMPLE = 0.15
"""A number for laws that need one."""


def table() -> str:
    """The table, laws of every joint first."""
    order = sorted(LAWS.values(), key=lambda law: (law.state is not None, not law.word))
    return "\n".join([HEAD, "|---|---|---|---|", *map(_row, order)]) + "\n"


def _row(law: Law) -> str:
    term = Term(law, None if law.number is None else law.number.usual or SAMPLE)
    size = f"s ({term.formula})" if law.against else term.formula
    rows = zip(term.names, term.units(), law.values, strict=True)
    found = ", ".join(
        f"`{name}` ({unit}{_bound(value) if law.state is None else ''})" for name, unit, value in rows
    )
    cells = (f"`{law.name}`", law.about, size.replace("|", r"\|"), found)
    return f"| {' | '.join(cells)} |"


def _bound(value: Value) -> str:
    if value.above:
        return f", at least {value.above}"
    if value.within:
        return f", at most {value.within} in size"
    return ", not negative" if value.low >= 0.0 else ""


def with_table(text: str) -> str:
    """The page with this table in the place of its own."""
    before, _, rest = text.partition(HEAD)
    lines = rest.splitlines(keepends=True)
    behind = next(i for i, line in enumerate(lines) if i and not line.startswith("|"))
    return before + table() + "".join(lines[behind:])


if __name__ == "__main__":
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
