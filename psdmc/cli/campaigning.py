"""The commands psdmc excite, which plans a calibration campaign, and psdmc simulate, which records it on a virtual
robot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from psdmc.calibration.motions.excite_options import (
    LARGEST_MARGIN,
    LONGEST_DURATION,
    MOST_HARMONICS,
    SMALLEST_MARGIN,
    ExciteOptions,
    chosen_objective,
)
from psdmc.cli.arguments import assignments, names
from psdmc.cli.console import quoted, say_next_line, steps
from psdmc.errors import InputError

USUAL_LOAD = "3.5,0.08,0,0.06"
"""kg and m, of the tip."""


def excite(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="model file")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="folder to write")],
    one_log: Annotated[
        bool, typer.Option("--one-log", help="plan one motion and one log instead of four steps")
    ] = False,
    validation: Annotated[
        bool, typer.Option("--validation", help="also plan a second motion, to test the calibration with")
    ] = False,
    load: Annotated[
        str | None,
        typer.Option(
            metavar="MASS,X,Y,Z",
            help=f"load of the motor runs: kg, and m in the tip's frame; or none; default: {USUAL_LOAD}",
        ),
    ] = None,
    rate: Annotated[
        float,
        typer.Option(
            min=1.0,
            max=20_000.0,
            help="rows per second of the trajectories; at least 160, or 32 with --one-log",
        ),
    ] = 1000.0,
    duration: Annotated[
        float, typer.Option(min=0.1, max=LONGEST_DURATION, help="period of the exciting motion, s")
    ] = 10.0,
    repeats: Annotated[
        int, typer.Option(min=1, max=100, help="number of periods of the exciting motion")
    ] = 6,
    harmonics: Annotated[
        int, typer.Option(min=1, max=MOST_HARMONICS, help="number of sines per joint")
    ] = len(ExciteOptions().harmonics),
    margin: Annotated[
        float,
        typer.Option(
            min=SMALLEST_MARGIN,
            max=LARGEST_MARGIN,
            help="share of the limits of position, speed and acceleration that is used",
        ),
    ] = ExciteOptions().margin,
    torque_margin: Annotated[
        float, typer.Option(min=SMALLEST_MARGIN, max=1.0, help="share of the torque limits that is used")
    ] = ExciteOptions().torque_margin,
    ranges: Annotated[
        list[str] | None,
        typer.Option("--range", metavar="JOINT=LOW:HIGH", help="narrower range of a joint, rad or m"),
    ] = None,
    speed: Annotated[
        list[str] | None,
        typer.Option(
            metavar="JOINT=V,...",
            help="speed limit of a joint, rad/s or m/s, if the robot file has none or a higher one",
        ),
    ] = None,
    acceleration: Annotated[
        list[str] | None,
        typer.Option(
            metavar="A or JOINT=A,...",
            help="acceleration limit, rad/s^2 or m/s^2; one number: for all joints without one",
        ),
    ] = None,
    effort: Annotated[
        list[str] | None, typer.Option(metavar="JOINT=NM,...", help="torque limit of a joint, N m or N")
    ] = None,
    floor: Annotated[
        float | None, typer.Option(metavar="HEIGHT", help="height of a floor above the base's origin, m")
    ] = None,
    meshes: Annotated[
        list[Path] | None, typer.Option(metavar="DIR", help="folder of the meshes of collision shapes")
    ] = None,
    collisions: Annotated[
        bool, typer.Option("--collisions/--no-collisions", help="check self-collision, or not")
    ] = True,
    formats: Annotated[
        list[str] | None,
        typer.Option(
            "--format",
            metavar="NAME,...",
            help="also write each trajectory for a controller: ros2, urscript, rsi (KUKA), franka",
        ),
    ] = None,
    seconds: Annotated[
        float,
        typer.Option(min=1.0, help="most CPU time of the search, s"),
    ] = ExciteOptions().seconds,
    condition: Annotated[
        bool, typer.Option("--condition", help="minimise the condition number only; the motion may be slow")
    ] = False,
    log_det: Annotated[
        bool, typer.Option("--log-det", help="maximise log det instead of minimising standard deviations")
    ] = False,
    seed: Annotated[int, typer.Option(min=1, help="seed of the random search")] = 1,
    force: Annotated[
        bool, typer.Option("--force", help="replace the campaign in DIR, but not its logs")
    ] = False,
) -> None:
    """Plan a calibration campaign: gravity sweeps, friction sines, and an exciting motion within the limits."""
    from psdmc.calibration.campaign import CampaignOptions, summary
    from psdmc.calibration.identify.steps import Load
    from psdmc.calibration.motions.allowed import GivenLimits
    from psdmc.calibration.motions.sweeps import SineOptions, SweepOptions
    from psdmc.cli.tables import print_line
    from psdmc.report.calibrate_commands import excite_command

    if one_log and (load or "none").strip() != "none":
        raise InputError("--load is for motor runs, and --one-log has none", "leave one of them out")
    if meshes and not collisions:
        raise InputError("--meshes has no effect with --no-collisions", "leave one of them out")
    search = ExciteOptions(
        duration=duration,
        harmonics=tuple(range(1, harmonics + 1)),
        objective=chosen_objective(condition, log_det),
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
    carried = load_numbers(load or USUAL_LOAD)
    options = CampaignOptions(
        sweep=SweepOptions(period=1.0 / rate),
        sines=SineOptions(period=1.0 / rate),
        excite=search,
        load=None if carried is None else Load(*carried),
        repeats=repeats,
        one_log=one_log,
        validation=validation,
        limits=limits,
        shapes=tuple(meshes or ()) if collisions else None,
        floor=floor,
        formats=names(formats),
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
    campaign: Annotated[Path, typer.Argument(metavar="DIR", help="campaign that excite wrote")],
    ideal: Annotated[bool, typer.Option("--ideal", help="simulate sensors without noise")] = False,
    harness: Annotated[
        bool, typer.Option("--harness", help="add a cable harness, an effect that models lack")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="seed of the sensor noise")] = 0,
    workers: Annotated[int, typer.Option(min=1, help="number of processes")] = 1,
) -> None:
    """Write a campaign's logs from a virtual robot that shares no code with what is calibrated."""
    from psdmc.calibration.campaign_file import listed_runs
    from psdmc.calibration.simulate_campaign import SimulateOptions, simulate_campaign, torque_constants_for

    with steps() as progress:
        count = simulate_campaign(plant, campaign, SimulateOptions(ideal, harness, seed, workers), progress)
    total = len(listed_runs(campaign))
    rest = f", {total - count} up to date" if count < total else ""
    print(f"{campaign}: {count} run{'' if count == 1 else 's'} simulated{rest}")
    words = torque_constants_for(plant, campaign)
    given = f" --torque-constants {quoted(','.join(words))}" if words else ""
    say_next_line(
        f"psdmc calibrate MODEL.npz {quoted(campaign)}{given} -o calibrated.npz --report calibrated.html"
    )


# Values of joints on the command line: JOINT=NUMBER and JOINT=LOW:HIGH, and a load.
LARGEST_LOAD, SMALLEST_LOAD = 1e4, 1e-3
"""kg"""
LARGEST_ARM = 100.0
"""m, of a load's centre of mass from the tip."""


def joint_numbers(given: Sequence[str] | None, option: str) -> dict[str, float]:
    """Return the numbers by joint of an option JOINT=NUMBER,... Raise InputError for other words, or a joint twice."""
    hint = "write JOINT=NUMBER,JOINT=NUMBER"
    return {name: _number(value, option, hint) for name, value in _named(given, option, hint).items()}


def acceleration_limits(given: Sequence[str] | None) -> tuple[float | None, dict[str, float]]:
    """Return the limit for all joints without one, and the limits by joint, from NUMBER and JOINT=NUMBER."""
    words = [word for value in given or () for word in ([value] if "=" in value else value.split(","))]
    alone = [word for word in words if "=" not in word]
    if len(alone) > 1:
        raise InputError(
            f"--acceleration: {len(alone)} numbers without a joint",
            "give one for all joints, or JOINT=NUMBER",
        )
    for_all = _number(alone[0], "--acceleration", "give a number, or JOINT=NUMBER") if alone else None
    return for_all, joint_numbers([word for word in words if "=" in word], "--acceleration")


def joint_ranges(given: Sequence[str] | None) -> dict[str, tuple[float, float]]:
    """JOINT=LOW:HIGH,... by joint."""
    hint = "write JOINT=LOW:HIGH, rad (m), as in --range elbow=-1.5:0.5"
    found: dict[str, tuple[float, float]] = {}
    for name, value in _named(given, "--range", hint).items():
        low, colon, high = value.partition(":")
        if not colon:
            raise InputError(f"--range: {value!r} is no range", hint)
        found[name] = (_number(low, "--range", hint), _number(high, "--range", hint))
    return found


def load_numbers(given: str | None) -> tuple[float, tuple[float, float, float]] | None:
    """Return the load MASS,X,Y,Z in kg and m, or None for the word none."""
    if given is None or given.strip() == "none":
        return None
    hint = "write MASS,X,Y,Z: kg, and m in the tip's frame; or none, where the robot logs torques"
    words = given.split(",")
    if len(words) != 4:
        raise InputError(f"--load is {given!r}", hint)
    mass, *com = (_number(word, "--load", hint) for word in words)
    if not SMALLEST_LOAD <= mass <= LARGEST_LOAD:
        raise InputError(f"--load: {mass:g} kg, expected {SMALLEST_LOAD:g} to {LARGEST_LOAD:g}", hint)
    if not all(abs(value) <= LARGEST_ARM for value in com):
        raise InputError(f"--load: its centre of mass is more than {LARGEST_ARM:g} m away", hint)
    return mass, (com[0], com[1], com[2])


def _named(given: Sequence[str] | None, option: str, hint: str) -> dict[str, str]:
    found: dict[str, str] = {}
    for word in assignments(given):
        name, _, value = word.rpartition("=")
        name = name.strip()
        if not name or name in found:
            what = f"joint {name!r} twice" if name else f"{word!r} names no joint"
            raise InputError(f"{option}: {what}", hint)
        found[name] = value
    return found


def _number(text: str, option: str, hint: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{option}: {text!r} is no number", hint) from None
