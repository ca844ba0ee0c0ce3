"""The command `psdmc payload`, which identifies the load that a robot carries."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from psdmc.cli.lists import parsed_torque_constants
from psdmc.cli.output import check_output, say_next
from psdmc.cli.progress import steps


def payload(
    model: Annotated[
        Path,
        typer.Argument(metavar="MODEL", help="model of the robot without the load, best a calibrated one"),
    ],
    logs: Annotated[
        list[Path],
        typer.Argument(metavar="LOG...", help="logs recorded with the load, or a log description"),
    ],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="LOAD.toml", help="write the load to this file")
    ] = None,
    loaded: Annotated[
        Path | None,
        typer.Option("--loaded", metavar="MODEL.npz", help="write the model with the load to this file"),
    ] = None,
    frame: Annotated[
        str | None, typer.Option(metavar="NAME", help="frame in which the load is given; default: the tip's")
    ] = None,
    torque_constants: Annotated[
        list[str] | None,
        typer.Option(
            metavar="JOINT=KT,...",
            help="joint torque per ampere in N m/A, gear included; default: the model's",
        ),
    ] = None,
    keep: Annotated[
        bool, typer.Option("--keep", help="write the files even if the verdict is: not usable")
    ] = False,
) -> None:
    """Identify a load's mass, centre of mass and inertia from logs with it; the verdict comes first, exit 6: not usable."""
    from psdmc.calibration.payload import identify_payload
    from psdmc.cli.show_checks import print_verdict
    from psdmc.cli.tables import print_line
    from psdmc.model.load import load

    check_output(output, model, *logs)
    check_output(loaded, model, *logs, *([output] if output else []))
    known, constants = load(model), parsed_torque_constants(torque_constants)
    with steps() as progress:
        found = identify_payload(known, logs, frame, torque_constants=constants, progress=progress)
    print_verdict(found.verdict)
    print_line(f"on {found.frame!r} of {found.robot!r}:")
    for line in found.lines():
        print(f"  {line}")
    for note in found.notes:
        print_line(f"note: {note}")
    written = found.verdict.usable or keep
    if written and output is not None:
        found.save(output)
    if written and loaded is not None:
        found.added_to(known).save(loaded)
    for path in (output, loaded):
        if path is not None:
            print(f"{path}: {'written' if written else 'not written; --keep writes it all the same'}")
    if not found.verdict.usable:
        raise typer.Exit(found.verdict.exit_status)
    if loaded is not None:
        say_next("emit-c", loaded, "-o", loaded.stem)
