"""The commands that run a model's generated code: sample, at random states; bench, against other programs."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from psdmc.bench import ROUNDS
from psdmc.cli.arguments import check_output, names
from psdmc.cli.console import say_next, steps
from psdmc.cli.pipeline import ModelFile
from psdmc.errors import InputError


def sample(
    model: ModelFile,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="folder of the parts")],
    states: Annotated[str, typer.Option(metavar="NUMBER", help="number of states, such as 100000 or 1e8")],
    functions: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME,...", help="functions to compute", show_default="inverse_dynamics"),
    ] = None,
    draw: Annotated[
        str,
        typer.Option(
            help="how states are drawn: uniform, or sobol (more even)",
            autocompletion=lambda: ["uniform", "sobol"],
        ),
    ] = "uniform",
    seed: Annotated[int, typer.Option(help="number that the states depend on")] = 0,
    real: Annotated[
        str,
        typer.Option(help="precision: float64 or float32", autocompletion=lambda: ["float64", "float32"]),
    ] = "float64",
    position: Annotated[
        float | None,
        typer.Option(
            metavar="RAD",
            help="positions are within plus or minus this, rad or m, and within the file's limits",
        ),
    ] = None,
    speed: Annotated[
        float | None, typer.Option(metavar="RAD/S", help="likewise for rates, rad/s or m/s")
    ] = None,
    acceleration: Annotated[
        float | None, typer.Option(metavar="RAD/S2", help="likewise for accelerations, rad/s^2 or m/s^2")
    ] = None,
    effort: Annotated[float | None, typer.Option(metavar="NM", help="likewise for torques, N m or N")] = None,
    theta_spread: Annotated[
        float,
        typer.Option(
            metavar="SHARE", help="vary the mass and inertia of each link by up to this share, per state"
        ),
    ] = 0.0,
    part_states: Annotated[
        str | None,
        typer.Option(
            metavar="NUMBER",
            help="states of a file, such as 32768 or 1e5",
            show_default="a file has up to 64 MiB",
        ),
    ] = None,
    along: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="draw states at random times of this motion: a .csv, .parquet or .npz as of excite",
        ),
    ] = None,
    noise: Annotated[
        float,
        typer.Option(
            metavar="SHARE", help="with --along: add noise, as a share of each value's standard deviation"
        ),
    ] = 0.0,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS", help="let the workers of this Dask scheduler compute, such as tcp://host:8786"
        ),
    ] = None,
) -> None:
    """Compute functions at random states within the robot's limits, and write Parquet files. An interrupted run goes on."""
    from psdmc.model.load import load
    from psdmc.sampling import Motion, Sampling
    from psdmc.sampling import sample as write

    robot, motion = load(model), None
    if along is not None:
        from psdmc.calibration.motions.trajectory import read_motion

        joints, time, parts = read_motion(along, robot.mechanism)
        motion = Motion(str(along), joints, time, *parts)  # type: ignore[arg-type]
    limits = {"position": position, "speed": speed, "acceleration": acceleration, "effort": effort}
    what = Sampling(
        _count("--states", states),
        ("inverse_dynamics",) if functions is None else names(functions),
        draw,  # type: ignore[arg-type]
        seed,
        real,  # type: ignore[arg-type]
        theta_spread,
        {word: value for word, value in limits.items() if value is not None},
        None if part_states is None else _count("--part-states", part_states),
        motion,
        noise,
    )
    with steps() as progress:
        found = write(robot, output, what, progress, scheduler)
    before = f"; {found.before} of them were there" if found.before else ""
    files = "1 part" if found.parts == 1 else f"{found.parts} parts"
    print(f"{output}: {found.states} states in {files}, {found.bytes / 1e6:.1f} MB{before}")
    print(f"columns: {', '.join(f'{name} ({size})' for name, size in found.columns.items())}")


def _count(option: str, text: str) -> int:
    """A number of states, also as 1e8."""
    with suppress(ValueError):
        return int(text)
    with suppress(ValueError):
        if (value := float(text)).is_integer():
            return int(value)
    raise InputError(f"{option} is {text!r}", "give a whole number, such as 100000 or 1e8")


WRONG_STATUS = 5
"""A contestant's results disagreed with the others'."""


def bench(
    models: Annotated[list[Path], typer.Argument(metavar="MODEL...", help="model files")],
    report: Annotated[
        Path | None, typer.Option(metavar="FILE.html", help="write the results as a page")
    ] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE.json", help="write all numbers")] = None,
    rounds: Annotated[int, typer.Option(min=1, help="number of timed trials")] = ROUNDS,
    counts: Annotated[
        bool, typer.Option("--counts", help="also count instructions (needs valgrind)")
    ] = False,
) -> None:
    """Time generated code against Pinocchio, CasADi and MuJoCo in the same run."""
    from psdmc.bench.case import Case
    from psdmc.bench.results import as_text
    from psdmc.bench.run import Settings, run
    from psdmc.files import write_whole
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
