"""The commands psdmc validate, which tests a calibrated model on new logs, and psdmc compare, which compares two
models."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from psdmc.cli.arguments import check_report, parsed_torque_constants
from psdmc.cli.calibrating import JointMap, Topic, naming_of
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
