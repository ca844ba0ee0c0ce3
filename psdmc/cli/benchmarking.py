"""psdmc bench: generated code beside its rivals."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from psdmc.bench.defaults import ROUNDS
from psdmc.cli.output import check_output, say_next
from psdmc.cli.progress import steps

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
    from psdmc.atomic import write_whole
    from psdmc.bench.case import Case
    from psdmc.bench.results import as_text
    from psdmc.bench.run import Settings, run
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
