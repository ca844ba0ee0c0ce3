"""The command `psdmc calibrate`, which identifies a model's parameters from logs, and what it prints."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from psdmc.cli.arguments import (
    assignments,
    check_output,
    check_report,
    names,
    numbers,
    parsed_torque_constants,
)
from psdmc.cli.console import one_line, say_next, steps
from psdmc.errors import InputError

if TYPE_CHECKING:
    from psdmc.calibration.description.description import FitChoice
    from psdmc.calibration.sources import LogNaming
    from psdmc.model.calibrated import Calibrated, Verdict

Topic = Annotated[
    str | None, typer.Option(metavar="TOPIC", help="topic of joint states, if a bag has several")
]
JointMap = Annotated[
    list[str] | None,
    typer.Option(metavar="LOGGED=JOINT,...", help="joint names of the log and of the model"),
]


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
        typer.Option(
            metavar="JOINT=KT,...",
            help="joint torque per ampere in N m/A, gear included, for logs of currents; default: the model's",
        ),
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
    warm: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", min=0.0, help="leave out the first seconds of each log"),
    ] = None,
    friction: Annotated[
        list[str] | None,
        typer.Option(metavar="TERM,...", help="friction terms: coulomb,viscous,viscous^2,offset"),
    ] = None,
    topic: Topic = None,
    joint_map: JointMap = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS", help="let the workers of this Dask scheduler compute, such as tcp://host:8786"
        ),
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
            "--warm": warm is not None,
            "--joint-map": joint_map,
            "--scheduler": scheduler,
        }
        require_none([flag for flag, value in of_a_fit.items() if value])
        describe_logs(given, output, topic)
        return
    if len(given) < 2 or output is None:
        lacks = "no LOG" if len(given) < 2 else "no -o MODEL.npz"
        raise InputError(f"calibrate: {lacks}", "psdmc calibrate MODEL.npz LOG... -o CALIBRATED.npz")
    logs = given[1:]
    choice = fit_choice(cutoff, split, friction, warm)
    from psdmc.calibration.calibrate import CalibrateOptions
    from psdmc.calibration.identify.visibility import EssentialOptions
    from psdmc.calibration.verdict.record import DROPPED_LINKS, dropped_links, verdict_of
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
            naming=naming_of(topic, joint_map),
            loaded=loaded or (),
            load_on=load,
            scheduler=scheduler,
        )
    verdict = verdict_of(record)
    print_verdict(verdict)
    print_proposal(record)
    print_accuracy(record)
    print_torque_constants(record)
    print_elasticity(record)
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
    is_report = report is not None and report.resolve() == Path(f"{output.stem}.html").resolve()
    say_next("view", output, *logs[:1], *(["-o", f"{output.stem}_view.html"] if is_report else []))
    say_next("emit-c", output, "-o", output.stem)


DRAFT = Path("log.toml")


def describe_logs(given: Sequence[Path], output: Path | None, topic: str | None) -> None:
    """Write a draft of a log description; the first path may be a model. Never overwrite a file."""
    from psdmc.report.calibrate_commands import describe_command

    output = output or DRAFT
    check_output(output, *given)
    model, missing = describe_command(given, output, topic or "")
    print(f"{output}: log description drafted: read it, and correct what is guessed")
    for what in missing:
        print(f"note: no column was found for the {one_line(what)}: name it where the draft has '?'")
    calibrated = "calibrated.npz" if model is None else f"{model.stem}_calibrated.npz"
    say_next("calibrate", model or "MODEL.npz", output, "-o", calibrated)


def require_none(flags: Sequence[str]) -> None:
    """Raise InputError if options of a calibration are given with --describe, which calibrates nothing."""
    if flags:
        raise InputError(
            f"--describe drafts a description, and reads no {', '.join(flags)}",
            "give them to the command that it prints, or write them into the draft",
        )


def fit_choice(
    cutoff: float | None, split: str | None, friction: Sequence[str] | None, warm: float | None
) -> FitChoice:
    """Return the options of the linear fit that the command line gives. Raise InputError if a value is wrong."""
    from psdmc.calibration.description.description import FitChoice, split_of
    from psdmc.friction.terms import EXAMPLE, options_of

    exponents, offset = None, None
    if friction:
        terms = options_of(names(friction))
        if isinstance(terms, str):
            raise InputError(f"--friction: {terms}", f"write --friction {EXAMPLE}")
        exponents, offset = terms
    shares = numbers([split] if split else None, "--split", SPLIT_HINT)
    chosen = None if shares is None else split_of(shares)
    if isinstance(chosen, str):
        raise InputError(f"--split: {chosen}", SPLIT_HINT)
    return FitChoice(cutoff, chosen, exponents, offset, warm=warm)


SPLIT_HINT = "write --split 0.3 for the last 30 %, or --split 0.15,40 for 15 % in 40 blocks"


def parsed_joint_map(given: Sequence[str] | None) -> dict[str, str]:
    """Return the model's joint name by the log's joint name, from 'LOGGED=JOINT,...'."""
    found: dict[str, str] = {}
    for word in assignments(given):
        logged, _, joint = (part.strip() for part in word.rpartition("="))
        if not logged or not joint or logged in found or joint in found.values():
            what = "names no joint" if not logged or not joint else "names a joint twice"
            raise InputError(f"--joint-map: {word!r} {what}", "write LOGGED=JOINT,LOGGED=JOINT")
        found[logged] = joint
    return found


def naming_of(topic: str | None, joint_map: Sequence[str] | None) -> LogNaming:
    """Return the names in the logs that the options --topic and --joint-map give."""
    from psdmc.calibration.sources import LogNaming

    return LogNaming(topic or "", parsed_joint_map(joint_map))


def print_verdict(verdict: Verdict) -> None:
    """Print whether a calibration can be used, with reasons and doubts."""
    for line in verdict.lines():
        print(one_line(line))


def print_proposal(record: Calibrated) -> None:
    """Print the lines of a log description that describe a coupling which the calibration found; nothing if it found
    none."""
    from psdmc.model.calibrated import PROPOSED_COUPLING

    proposed = record.facts.get(PROPOSED_COUPLING)
    if proposed is not None:
        print("# proposed for log.toml, not applied:")
        print(proposed["toml"])


def print_accuracy(record: Calibrated) -> None:
    """Print R^2 on held-out data for each joint and step of the calibration."""
    from psdmc.cli.tables import Table, print_table

    rows = []
    for joint in record.joint_names:
        both = [step.joints.get(joint) for step in record.steps]
        rows.append((joint, *("" if b is None else f"{b.held_out.r2:.4f}" for b in both)))
    print_table(Table(("joint", *(f"{step.step} R^2" for step in record.steps)), rows))


def print_elasticity(record: Calibrated) -> None:
    """Print stiffness and damping of the joints with two encoders; nothing if there are none."""
    from psdmc.cli.tables import Table, print_table

    rows = [
        (
            row.joint,
            row.name,
            f"{row.value:.6g}",
            f"{row.std:.2g}",
            f"{row.std / abs(row.value):.2%}",
            row.unit,
        )
        if math.isfinite(row.std)
        else (row.joint, row.name, "not determined", "", "", row.unit)
        for row in record.elasticity
    ]
    if rows:
        print_table(Table(("joint", "elasticity", "value", "standard deviation", "of it", "unit"), rows))


def print_torque_constants(record: Calibrated) -> None:
    """Print the torque constants that the calibration found, with standard deviations; nothing if it found none."""
    from psdmc.cli.tables import Table, print_table

    found = [row for row in record.motors if row.seen]
    rows = [
        (row.joint, f"{row.value:.6g}", f"{row.std:.2g}", f"{row.std / abs(row.value):.2%}") for row in found
    ]
    if rows:
        print_table(Table(("joint", "torque constant [N m/A]", "standard deviation", "of it"), rows))
