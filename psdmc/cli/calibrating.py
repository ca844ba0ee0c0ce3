"""psdmc calibrate: a model from logs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from psdmc.cli.describing import describe_logs, fit_choice, parsed_joint_map, require_none
from psdmc.cli.next_step import say_next
from psdmc.cli.one_line import one_line
from psdmc.cli.output import check_output, check_report
from psdmc.cli.progress import steps
from psdmc.cli.torque_constants import parsed_torque_constants
from psdmc.errors import InputError


def calibrate(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="model file")],
    logs: Annotated[
        list[Path] | None,
        typer.Argument(metavar="LOG...", help="campaign folder, a log description (log.toml), or logs"),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="MODEL.npz",
            help="file to write: the calibrated model, or with --describe the description",
        ),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(metavar="FILE.html", help="write a report, and FILE.json with the same numbers"),
    ] = None,
    actuators: Annotated[
        Path | None, typer.Option(metavar="DIR", help="write C code of friction and motors into this folder")
    ] = None,
    physical: Annotated[
        bool | None,
        typer.Option(
            "--physical/--no-physical",
            help="accept only physical bodies and friction (the default), or the plain fit",
        ),
    ] = None,
    torque_constants: Annotated[
        list[str] | None,
        typer.Option(metavar="JOINT=KT,...", help="torque constants in N m/A, for logs of currents"),
    ] = None,
    loaded: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="LOG", help="log of currents with a known load on the tip, to find torque constants"
        ),
    ] = None,
    load: Annotated[
        str | None,
        typer.Option(
            metavar="MASS,X,Y,Z", help="the known load: kg, and m in the tip's frame; or a load file (.toml)"
        ),
    ] = None,
    cutoff: Annotated[
        float | None, typer.Option(metavar="HZ", help="cut-off of the filter; default: 8 Hz")
    ] = None,
    essential: Annotated[
        bool, typer.Option("--essential", help="drop parameters that the data do not need (F-test)")
    ] = False,
    prior_confidence: Annotated[
        float | None,
        typer.Option(
            metavar="SHARE", help="relative standard deviation of the file's masses and inertias, such as 0.1"
        ),
    ] = None,
    keep: Annotated[
        bool, typer.Option("--keep", help="write the model even if the verdict is: not usable")
    ] = False,
    validate: Annotated[
        list[Path] | None, typer.Option(metavar="LOG", help="log that is used for the test only")
    ] = None,
    split: Annotated[
        str | None,
        typer.Option(
            metavar="SHARE[,BLOCKS]",
            help="share of each log that is used for the test: 0.3, the last part; or 0.15,40",
        ),
    ] = None,
    friction: Annotated[
        list[str] | None,
        typer.Option(metavar="TERM,...", help="friction terms: coulomb,viscous,viscous^2,offset"),
    ] = None,
    topic: Annotated[
        str | None, typer.Option(metavar="TOPIC", help="topic of joint states, if a bag has several")
    ] = None,
    joint_map: Annotated[
        list[str] | None,
        typer.Option(metavar="LOGGED=JOINT,...", help="joint names of the log and of the model"),
    ] = None,
    describe: Annotated[
        bool,
        typer.Option("--describe", help="draft a description of LOG..., log.toml or -o, instead"),
    ] = False,
) -> None:
    """Identify base parameters, friction and motor constants from logs; the verdict comes first, exit 6: not usable."""
    given = [model, *(logs or [])]
    if describe:
        of_a_fit = {
            "--report": report,
            "--actuators": actuators,
            "--physical/--no-physical": physical is not None,
            "--torque-constants": torque_constants,
            "--loaded": loaded,
            "--load": load,
            "--cutoff": cutoff is not None,
            "--essential": essential,
            "--prior-confidence": prior_confidence is not None,
            "--keep": keep,
            "--validate": validate,
            "--split": split,
            "--friction": friction,
            "--joint-map": joint_map,
        }
        require_none([flag for flag, value in of_a_fit.items() if value])
        describe_logs(given, output, topic)
        return
    if len(given) < 2 or output is None:
        lacks = "no LOG" if len(given) < 2 else "no -o MODEL.npz"
        raise InputError(f"calibrate: {lacks}", "psdmc calibrate MODEL.npz LOG... -o CALIBRATED.npz")
    logs = given[1:]
    choice = fit_choice(cutoff, split, friction)
    from psdmc.calibration.calibrate import CalibrateOptions
    from psdmc.calibration.identify.essential import EssentialOptions
    from psdmc.calibration.sources import LogNaming
    from psdmc.calibration.verdict.record import DROPPED_LINKS, dropped_links, verdict_of
    from psdmc.cli.show_checks import print_accuracy, print_torque_constants, print_verdict
    from psdmc.model.calibrated import code_of
    from psdmc.model.load import load as load_model
    from psdmc.report.calibrate_commands import calibrate_command

    read = [*given, *(validate or []), *(loaded or [])]
    check_output(output, *read)
    check_report(report, output, *read)
    known = load_model(model)
    for warning in dropped_links(known):
        print(f"warning: {one_line(warning)}", flush=True)
    with steps() as progress:
        record = calibrate_command(
            known,
            logs,
            output,
            report,
            CalibrateOptions(
                physical=physical is not False,
                choice=choice,
                prior_confidence=prior_confidence,
                essential=EssentialOptions() if essential else None,
            ),
            parsed_torque_constants(torque_constants),
            actuators,
            progress,
            keep=keep,
            validation=validate or [],
            naming=LogNaming(topic or "", parsed_joint_map(joint_map)),
            loaded=loaded or (),
            load_on=load,
        )
    verdict = verdict_of(record)
    print_verdict(verdict)
    print_accuracy(record)
    print_torque_constants(record)
    if verdict.usable or keep:
        print(f"{output}: calibrated model")
    else:
        print(f"{output}: not written; add --keep to write it anyway")
    if physical:
        print("note: --physical is the default; you can leave it out")
    for note in record.notes:
        print(f"note: {one_line(note)}")
    for warning in record.unsaid:
        if code_of(warning) != DROPPED_LINKS:
            print(f"warning: {one_line(warning)}")
    numbers = None if report is None else report.with_suffix(".json")
    for written, what in (
        (report, "page"),
        (numbers, "the page's numbers"),
        (actuators, "friction and motors in C"),
    ):
        if written is not None and written.exists():
            print(f"{written}: {what}")
    if not verdict.usable:
        raise typer.Exit(verdict.exit_status)
    say_next("emit-c", output, "-o", output.stem)
