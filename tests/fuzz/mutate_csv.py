"""Tables as text: cells, columns, rows, separators, encodings."""

from __future__ import annotations

from random import Random

from mutate_bytes import ENCODINGS, mutate_bytes
from nasty import near, number, text

NAMES = ("time_s", "position_rad", "position_m", "velocity_rad_s", "current_a", "motor_torque_nm", "motor_torque_n",
         "joint_torque_nm", "effort_nm", "acceleration_rad_s2", "Time_s", "")  # fmt: skip


def mutate_csv(data: bytes, rng: Random) -> bytes:
    if rng.random() < 0.07:
        return mutate_bytes(data, rng)
    try:
        source = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return mutate_bytes(data, rng)
    rows = [line.split(",") for line in source.splitlines()] or [[""]]
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        rng.choice(_EDITS)(rows, rng)
        rows = rows or [[""]]
    separator = "," if rng.random() < 0.93 else rng.choice((";", "\t", " ", ", ", ",,", "|", "\u3001"))
    ending = "\n" if rng.random() < 0.93 else rng.choice(("\r\n", "\r", "\n\n", "\x0b", "\u2028", ""))
    written = ending.join(separator.join(row) for row in rows) + ending
    encoding = "utf-8" if rng.random() < 0.93 else rng.choice(ENCODINGS)
    return written.encode(encoding, errors="replace")


def _cell(rows: list[list[str]], rng: Random) -> None:
    row = rng.choice(rows)
    if row:
        at = rng.randrange(len(row))
        row[at] = near(row[at], rng)


def _header(rows: list[list[str]], rng: Random) -> None:
    head = rows[0]
    if not head:
        return
    at = rng.randrange(len(head))
    kind, _, joint = head[at].partition(".")
    head[at] = rng.choice(
        (text(rng), f"{rng.choice(NAMES)}.{joint}", f"{kind}.{text(rng)}", rng.choice(head), f'"{head[at]}"')
    )


def _column(rows: list[list[str]], rng: Random) -> None:
    """Drop, repeat, fill or scale a column."""
    at = rng.randrange(max(len(rows[0]), 1))
    choice, value, factor = rng.randrange(4), number(rng), 10.0 ** rng.randint(-300, 300)
    for k, row in enumerate(rows):
        if at >= len(row):
            continue
        if choice == 0:
            del row[at]
        elif choice == 1:
            row.append(row[at])
        elif choice == 2 and k:
            row[at] = value
        elif k:
            row[at] = _scaled(row[at], factor)


def _scaled(word: str, factor: float) -> str:
    try:
        return repr(float(word) * factor)
    except ValueError:
        return word


def _row(rows: list[list[str]], rng: Random) -> None:
    at = rng.randrange(len(rows))
    choice = rng.randrange(7)
    if choice == 0:
        del rows[at]
    elif choice == 1:
        rows.insert(rng.randrange(len(rows)), list(rows[at]))
    elif choice == 2:
        del rows[at:]
    elif choice == 3:
        rows[at] = rows[at][:-1] if rng.random() < 0.5 else [*rows[at], number(rng)]
    elif choice == 4:
        rows.insert(at, rng.choice(([""], ["#"], [" "], ["# a"], [",", ","], [text(rng)])))
    elif choice == 5:
        rows[at] = [number(rng) for _ in rows[at]]
    else:
        rows.reverse()


_EDITS = (_cell, _cell, _cell, _header, _header, _column, _row)
