"""The commands that compare a model with further logs. validate tests a calibrated model, compare compares two models,
payload identifies the load that a robot carries."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from psdmc.cli.arguments import check_output, check_report, parsed_torque_constants
from psdmc.cli.calibrating import JointMap, Topic, naming_of, print_verdict
from psdmc.cli.console import say_next, steps

if TYPE_CHECKING:
    from psdmc.calibration.compared import Comparison
    from psdmc.calibration.validation import Validation
    from psdmc.model.dynamics_model import DynamicsModel

Report = Annotated[
    Path | None, typer.Option(metavar="FILE.html", help="write a report, and FILE.json with the same numbers")
]
AsJson = Annotated[bool, typer.Option("--json", help="print one JSON document instead of text")]
Constants = Annotated[
    list[str] | None,
    typer.Option(metavar="JOINT=KT,...", help="joint torque per ampere, gear included; default: the model's"),
]


def validate(
    calibrated: Annotated[Path, typer.Argument(metavar="CALIBRATED", help="calibrated model")],
    logs: Annotated[
        list[Path],
        typer.Argument(
            metavar="LOG...", help="logs that were not used to calibrate it, or a log description"
        ),
    ],
    report: Report = None,
    as_json: AsJson = False,
    torque_constants: Constants = None,
    topic: Topic = None,
    joint_map: JointMap = None,
) -> None:
    """Test a calibrated model on other logs; exit 5: the robot has drifted or carries a load, 6: log not usable."""
    from psdmc.calibration.validation import CHANGED_STATUS
    from psdmc.calibration.validation import validate as run
    from psdmc.model.load import load
    from psdmc.report.calibrate_commands import CompiledWhenAsked

    _check(report, calibrated, *logs)
    known = load(calibrated)
    with steps() as progress:
        found = run(
            calibrated,
            logs,
            parsed_torque_constants(torque_constants),
            regressor=CompiledWhenAsked(known, progress),
            naming=naming_of(topic, joint_map),
            progress=progress,
        )
    _deliver(found, report, as_json)
    own = {"--torque-constants": torque_constants, "--topic": [topic or ""], "--joint-map": joint_map}
    options = [
        word for flag, values in own.items() for value in values or () if value for word in (flag, value)
    ]
    if found.load is not None:
        say_next("payload", calibrated, *logs_of(known, logs), *options, "-o", "load.toml")
    elif found.exit_status == CHANGED_STATUS:
        say_next("calibrate", calibrated, *logs, *options, "-o", f"{calibrated.stem}_new.npz")
    if found.exit_status:
        raise typer.Exit(found.exit_status)


def compare(
    a: Annotated[Path, typer.Argument(metavar="A", help="model, best a calibrated one")],
    b: Annotated[Path, typer.Argument(metavar="B", help="another model of the robot, or its robot file")],
    logs: Annotated[
        list[Path] | None, typer.Argument(metavar="LOG...", help="logs on which both models are tested")
    ] = None,
    report: Report = None,
    as_json: AsJson = False,
    torque_constants: Constants = None,
    topic: Topic = None,
    joint_map: JointMap = None,
) -> None:
    """Compare two models of one robot: parameters in standard deviations, friction, torques, errors on logs."""
    from psdmc.calibration.comparison import compare as run

    _check(report, a, b, *(logs or []))
    constants = parsed_torque_constants(torque_constants)
    with steps() as progress:
        found = run(a, b, logs or [], constants, naming=naming_of(topic, joint_map), progress=progress)
    _deliver(found, report, as_json)


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
    topic: Topic = None,
    joint_map: JointMap = None,
) -> None:
    """Identify a load's mass, centre of mass and inertia from logs with it; the verdict comes first, exit 6: not usable."""
    from psdmc.calibration.payload import identify_payload
    from psdmc.cli.tables import print_line
    from psdmc.model.load import load

    check_output(output, model, *logs)
    check_output(loaded, model, *logs, *([output] if output else []))
    known, constants = load(model), parsed_torque_constants(torque_constants)
    with steps() as progress:
        found = identify_payload(
            known,
            logs,
            frame,
            torque_constants=constants,
            progress=progress,
            naming=naming_of(topic, joint_map),
        )
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


def logs_of(model: DynamicsModel, given: Sequence[Path]) -> Sequence[Path]:
    """The logs that test a model, without their campaign."""
    from psdmc.calibration.campaign_file import tested_logs
    from psdmc.calibration.sources import campaign_of

    campaign = campaign_of(given)
    return given if campaign is None else tested_logs(campaign, model.v_names)


def _check(report: Path | None, *inputs: Path) -> None:
    from psdmc.report.validate_report import require_free

    check_report(report, *inputs)
    if report is not None:
        require_free(report)


def _deliver(found: Validation | Comparison, report: Path | None, as_json: bool) -> None:
    """Print a result, and write its page."""
    from psdmc.cli.show import print_json
    from psdmc.cli.tables import Table, print_line, print_table
    from psdmc.report.validate_report import page_of, write_page

    page = page_of(found)
    if report is not None:
        write_page(page, found, report)
    if as_json:
        print_json(page.document, found.as_json())
        return
    for line in page.text:
        print_line(line)
    for table in page.tables:
        if table.short:
            print_line(f"{table.title}:")
            print_table(Table(table.head, table.short, prose=table.prose))
    for path in [] if report is None else [report, report.with_suffix(".json")]:
        print(f"{path}: written")
