"""The command line: its options before the command, and its commands in the order of its help."""

from __future__ import annotations

from typing import Annotated

import typer

from psdmc.cli.benchmarking import bench
from psdmc.cli.calibrating import calibrate
from psdmc.cli.campaigning import excite, simulate
from psdmc.cli.exporting import export_urdf
from psdmc.cli.loads import payload
from psdmc.cli.pipeline import build, cache, check, derive, emit, emit_c
from psdmc.cli.showing import show
from psdmc.cli.starting import doctor, new
from psdmc.version import psdmc_version

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # plain help: no boxes in a pipe, and rich need not be loaded
    context_settings={"help_option_names": ["-h", "--help"]},
    help="A compiler for robot dynamics: a robot in; small, fast, verified C out.",
)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"psdmc {psdmc_version()}")
        raise typer.Exit


@app.callback()
def options(
    debug: Annotated[bool, typer.Option("--debug", help="show tracebacks")] = False,
    version: Annotated[
        bool, typer.Option("--version", help="print it", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """Options before the command."""


COMMANDS = (
    (new, "write a robot file to begin with"),
    (derive, "derive a robot's model and save it"),
    (show, "print a model, or what a robot file holds"),
    (check, "check a model against other readers of its source"),
    (emit_c, "write a model's C package"),
    (emit, "write a model's package in another language"),
    (build, "build a package and run its self-test"),
    (bench, "time a model's code against its rivals"),
    (excite, "plan a calibration campaign"),
    (simulate, "write a campaign's logs from a virtual robot"),
    (calibrate, "identify a model's parameters from logs"),
    (payload, "identify a load from logs with it"),
    (export_urdf, "write a model as a robot file"),
    (cache, "show or clear the compile cache"),
    (doctor, "say what is installed, and what for"),
)
"""Each command with its line in the help."""

for command, line in COMMANDS:
    app.command(command.__name__.replace("_", "-"), short_help=line)(command)
