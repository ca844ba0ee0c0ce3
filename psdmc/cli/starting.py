"""The commands for new users: new, doctor."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from psdmc.cli.output import say_next, say_next_line

MISSING_STATUS = 4
"""Something that psdmc cannot do without is missing: change the machine."""


def new(
    robot: Annotated[
        Path, typer.Argument(metavar="ROBOT.toml", help="file to write, which does not exist yet")
    ],
) -> None:
    """Write a commented DH table of an arm of three joints, to be changed into your robot's."""
    from psdmc.robot.new_file import write_new_robot

    write_new_robot(robot)
    print(f"{robot}: written, a table of three joints; change it into your robot's")
    say_next("derive", robot)


def doctor() -> None:
    """Say what is installed, which compilers, which optional parts, and what each is needed for."""
    from psdmc.cli.doctor import findings, missing
    from psdmc.cli.tables import Table, print_line, print_table

    parts = findings()
    absent = {True: "MISSING", False: "not installed"}
    rows = []
    for part in parts:
        purpose = f" ({part.purpose})" if part.purpose else ""
        rows.append((part.part, f"{part.found or absent[part.needed]}{purpose}"))
    print_table(Table(("part", "what is found (and what needs it)"), rows, prose=True))
    lacking = missing(parts)
    for part in parts:
        if not part.found:
            print_line(f"{'error' if part.needed else 'hint'}: {part.part}: {part.remedy}")
    if lacking:
        raise typer.Exit(MISSING_STATUS)
    say_next_line("psdmc new robot.toml, or psdmc show with a robot file of yours")
