"""The commands beside the pipeline: bench, excite, simulate, calibrate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from psdmc.bench.defaults import ROUNDS
from psdmc.calibration.motions.excite_options import (
    LARGEST_MARGIN,
    LONGEST_DURATION,
    MOST_HARMONICS,
    SMALLEST_MARGIN,
    ExciteOptions,
)
from psdmc.cli import interrupt
from psdmc.cli.describing import describe_logs, fit_choice, parsed_joint_map
from psdmc.cli.joint_values import acceleration_limits, joint_numbers, joint_ranges, load_numbers
from psdmc.cli.next_step import quoted, say_next, say_next_line
from psdmc.cli.one_line import one_line
from psdmc.cli.output import check_output, check_report
from psdmc.cli.progress import steps
from psdmc.cli.torque_constants import parsed_torque_constants
from psdmc.errors import InputError

WRONG_STATUS = 5
"""A contestant's results disagreed with the others'."""


def bench(
    models: Annotated[list[Path], typer.Argument(metavar="MODEL...", help="model files")],
    report: Annotated[Path | None, typer.Option(metavar="FILE.html", help="write a page")] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE.json", help="write every figure")] = None,
    rounds: Annotated[int, typer.Option(min=1, help="trials that count")] = ROUNDS,
    counts: Annotated[bool, typer.Option("--counts", help="count instructions too (valgrind)")] = False,
) -> None:
    """Time generated code against Pinocchio, CasADi and MuJoCo in the same run."""
    with interrupt.at_once():
        from psdmc.atomic import write_whole
        from psdmc.bench.case import Case
        from psdmc.bench.run import Settings, run
        from psdmc.bench.table import as_text
        from psdmc.model.load import load
        from psdmc.report.bench_page import write_page

    check_output(report, *models)
    check_output(json, *models, *([report] if report else []))
    cases = [Case(path.stem, load(path)) for path in models]
    with steps() as progress:
        result = run(cases, Settings(rounds=rounds, count=counts), progress)
    print(as_text(result))
    if report is not None:
        write_page(result, report, "psdmc bench " + " ".join(path.name for path in models))
        print(f"{report}: page written")
    if json is not None:
        write_whole(json, result.to_json())
        print(f"{json}: figures written")
    if result.wrong:
        raise typer.Exit(WRONG_STATUS)
    if report is None:
        say_next("bench", *models, "--report", f"{models[0].stem}.html")
    else:
        say_next("emit-c", models[0], "-o", models[0].stem)


def excite(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="model file")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="folder of the campaign")],
    one_log: Annotated[
        bool, typer.Option("--one-log", help="the exciting motion alone, for one linear fit of everything")
    ] = False,
    load: Annotated[
        str,
        typer.Option(metavar="MASS,X,Y,Z", help="kg and m in the tip's frame, of the motor runs; or none"),
    ] = "3.5,0.08,0,0.06",
    rate: Annotated[
        float, typer.Option(min=1.0, max=20_000.0, help="Hz, rows a second of trajectories")
    ] = 1000.0,
    duration: Annotated[
        float, typer.Option(min=0.1, max=LONGEST_DURATION, help="s, period of the exciting motion")
    ] = 10.0,
    repeats: Annotated[int, typer.Option(min=1, max=100, help="periods of the exciting motion")] = 6,
    harmonics: Annotated[int, typer.Option(min=1, max=MOST_HARMONICS, help="sines per joint")] = len(
        ExciteOptions().harmonics
    ),
    margin: Annotated[
        float,
        typer.Option(
            min=SMALLEST_MARGIN, max=LARGEST_MARGIN, help="share of position, speed and acceleration limits"
        ),
    ] = ExciteOptions().margin,
    torque_margin: Annotated[
        float, typer.Option(min=SMALLEST_MARGIN, max=1.0, help="share of torque limits, by theta_b")
    ] = ExciteOptions().torque_margin,
    ranges: Annotated[
        list[str] | None,
        typer.Option("--range", metavar="JOINT=LOW:HIGH", help="rad (m), narrower than the file's"),
    ] = None,
    speed: Annotated[
        list[str] | None, typer.Option(metavar="JOINT=V,...", help="rad/s (m/s), below the file's limits")
    ] = None,
    acceleration: Annotated[
        list[str] | None,
        typer.Option(
            metavar="A or JOINT=A,...", help="rad/s^2 (m/s^2); one number: for joints without a limit"
        ),
    ] = None,
    effort: Annotated[
        list[str] | None, typer.Option(metavar="JOINT=NM,...", help="N m (N), torque limits of joints")
    ] = None,
    floor: Annotated[
        float | None, typer.Option(metavar="HEIGHT", help="m, of a floor above the base's origin")
    ] = None,
    meshes: Annotated[
        list[Path] | None, typer.Option(metavar="DIR", help="where the meshes of collision shapes are")
    ] = None,
    collisions: Annotated[
        bool, typer.Option("--collisions/--no-collisions", help="whether self-collision is looked at")
    ] = True,
    seconds: Annotated[
        float, typer.Option(min=1.0, help="s, longest search; it ends by its count where that is sooner")
    ] = ExciteOptions().seconds,
    log_det: Annotated[
        bool, typer.Option("--log-det", help="maximise log det instead of the condition")
    ] = False,
    seed: Annotated[int, typer.Option(min=1, help="of the search")] = 1,
    force: Annotated[
        bool, typer.Option("--force", help="replace the campaign that is in DIR; its logs stay")
    ] = False,
) -> None:
    """Plan a calibration campaign: gravity sweeps, friction sines, and an exciting motion within the limits."""
    with interrupt.at_once():
        from psdmc.calibration.campaign import CampaignOptions
        from psdmc.calibration.campaign_summary import summary
        from psdmc.calibration.identify.steps import Load
        from psdmc.calibration.motions.given_limits import GivenLimits
        from psdmc.calibration.motions.sweeps import SineOptions, SweepOptions
        from psdmc.cli.tables import print_line
        from psdmc.report.calibrate_commands import excite_command

    search = ExciteOptions(
        duration=duration,
        harmonics=tuple(range(1, harmonics + 1)),
        objective="log_det" if log_det else "condition",
        margin=margin,
        torque_margin=torque_margin,
        seconds=seconds,
        seed=seed,
    )
    for_all, by_joint = acceleration_limits(acceleration)
    limits = GivenLimits(
        joint_ranges(ranges),
        joint_numbers(speed, "--speed"),
        by_joint,
        for_all,
        joint_numbers(effort, "--effort"),
    )
    carried = load_numbers(load)
    options = CampaignOptions(
        sweep=SweepOptions(period=1.0 / rate),
        sines=SineOptions(period=1.0 / rate),
        excite=search,
        load=None if carried is None else Load(*carried),
        repeats=repeats,
        one_log=one_log,
        limits=limits,
        shapes=tuple(meshes or ()) if collisions else None,
        floor=floor,
    )
    with steps() as progress:
        plan = excite_command(model, output, options, progress, force)
    for line in summary(plan, output):
        print_line(line)
    for remark in plan.remarks:
        print_line(f"note: {remark}")
    print_line(f"{output}: written")
    calibrated = f"{model.stem}_calibrated.npz"
    words = " ".join(
        quoted(word) for word in (model, output, "-o", calibrated, "--report", f"{model.stem}.html")
    )
    say_next_line(f"record the runs that {output / 'campaign.toml'} lists, then: psdmc calibrate {words}")


def simulate(
    plant: Annotated[Path, typer.Argument(metavar="PLANT", help="virtual robot (.toml)")],
    campaign: Annotated[Path, typer.Argument(metavar="DIR", help="campaign made by excite")],
    ideal: Annotated[bool, typer.Option("--ideal", help="ideal sensors")] = False,
    harness: Annotated[
        bool, typer.Option("--harness", help="with a cable harness, which no model has")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="of the sensors' noise")] = 0,
    workers: Annotated[int, typer.Option(min=1, help="processes")] = 1,
) -> None:
    """Write a campaign's logs from a virtual robot that shares no code with what is calibrated."""
    with interrupt.at_once():
        from psdmc.calibration.simulate_campaign import SimulateOptions
        from psdmc.report.calibrate_commands import simulate_command

    with steps() as progress:
        count = simulate_command(plant, campaign, SimulateOptions(ideal, harness, seed, workers), progress)
    print(f"{campaign}: {count} runs simulated, the others were up to date")
    say_next_line(f"psdmc calibrate MODEL.npz {quoted(campaign)} -o calibrated.npz --report calibrated.html")


def calibrate(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="model file")],
    logs: Annotated[
        list[Path] | None,
        typer.Argument(metavar="LOG...", help="campaign folder, a log description (log.toml), or logs"),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="MODEL.npz", help="calibrated model; with --describe the description"
        ),
    ] = None,
    report: Annotated[
        Path | None, typer.Option(metavar="FILE.html", help="write a page, with JSON beside it")
    ] = None,
    actuators: Annotated[
        Path | None, typer.Option(metavar="DIR", help="write friction and motors as C there")
    ] = None,
    physical: Annotated[
        bool | None,
        typer.Option(
            "--physical/--no-physical",
            help="only what a robot can have: bodies of mass, friction not negative (the default); or the bare fit",
        ),
    ] = None,
    torque_constants: Annotated[
        list[str] | None,
        typer.Option(metavar="JOINT=KT,...", help="N m/A, for plain logs that hold currents"),
    ] = None,
    loaded: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="LOG", help="log of currents with a known load on the tip: shows torque constants"
        ),
    ] = None,
    load: Annotated[
        str | None,
        typer.Option(
            metavar="MASS,X,Y,Z", help="that load: kg, m in the tip's frame; or a load's file (.toml)"
        ),
    ] = None,
    cutoff: Annotated[
        float | None, typer.Option(metavar="HZ", help="of the filter of plain logs; 8, or less for slow logs")
    ] = None,
    essential: Annotated[
        bool, typer.Option("--essential", help="leave out parameters that the data do not need (F-test)")
    ] = False,
    prior_confidence: Annotated[
        float | None,
        typer.Option(metavar="SHARE", help="standard deviation of the file's masses and inertias, 0.1: 10 %"),
    ] = None,
    keep: Annotated[
        bool, typer.Option("--keep", help="write the model file even where the verdict is: not usable")
    ] = False,
    validate: Annotated[
        list[Path] | None, typer.Option(metavar="LOG", help="a plain log that is held out as a whole")
    ] = None,
    split: Annotated[
        str | None,
        typer.Option(metavar="SHARE[,BLOCKS]", help="held out of plain logs: 0.3, the last part; 0.15,40"),
    ] = None,
    friction: Annotated[
        list[str] | None,
        typer.Option(metavar="TERM,...", help="of plain logs: coulomb,viscous,viscous^2,offset"),
    ] = None,
    topic: Annotated[
        str | None, typer.Option(metavar="TOPIC", help="of joint states, of bags with several")
    ] = None,
    joint_map: Annotated[
        list[str] | None,
        typer.Option(metavar="LOGGED=JOINT,...", help="plain logs' joint names, and the model's"),
    ] = None,
    describe: Annotated[
        bool,
        typer.Option("--describe", help="draft a description of [MODEL] LOG...: log.toml, or -o"),
    ] = False,
) -> None:
    """Identify base parameters, friction and motor constants from logs; the verdict comes first, exit 6: not usable."""
    given = [model, *(logs or [])]
    if describe:
        describe_logs(given, output, topic)
        return
    if len(given) < 2 or output is None:
        lacks = "no LOG" if len(given) < 2 else "no -o MODEL.npz"
        raise InputError(f"calibrate: {lacks}", "psdmc calibrate MODEL.npz LOG... -o CALIBRATED.npz")
    logs = given[1:]
    choice = fit_choice(cutoff, split, friction)
    with interrupt.at_once():
        from psdmc.calibration.calibrate import CalibrateOptions
        from psdmc.calibration.identify.essential import EssentialOptions
        from psdmc.calibration.sources import LogNaming
        from psdmc.calibration.verdict.record import verdict_of
        from psdmc.calibration.verdict.said_once import unsaid_warnings
        from psdmc.cli.show_checks import print_accuracy, print_torque_constants, print_verdict
        from psdmc.report.calibrate_commands import calibrate_command

    read = [*given, *(validate or []), *(loaded or [])]
    check_output(output, *read)
    check_report(report, output, *read)
    with steps() as progress:
        record = calibrate_command(
            model,
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
        print(f"{output}: not written; --keep writes it all the same")
    if physical:
        print("note: --physical is the default now and need not be given")
    for note in record.notes:
        print(f"note: {one_line(note)}")
    for warning in unsaid_warnings(record):
        print(f"warning: {one_line(warning)}")
    for written, what in ((report, "page"), (actuators, "friction and motors in C")):
        if written is not None and written.exists():
            print(f"{written}: {what}")
    if not verdict.usable:
        raise typer.Exit(verdict.exit_status)
    say_next("emit-c", output, "-o", output.stem)
