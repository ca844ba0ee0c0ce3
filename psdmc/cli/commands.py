"""The options before the command, and psdmc's commands in the order in which the help lists them."""

from __future__ import annotations

from typing import Annotated

import typer

from psdmc.cli.calibrating import calibrate
from psdmc.cli.campaigning import excite, simulate
from psdmc.cli.emitting import EmitCommand, emit, emit_c, export_urdf
from psdmc.cli.pipeline import build, cache, check, derive
from psdmc.cli.running import bench, sample
from psdmc.cli.showing import figures, show, view
from psdmc.cli.starting import doctor, new
from psdmc.cli.validating import compare, payload, validate
from psdmc.version import psdmc_version

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # plain help: no boxes in a pipe, and rich need not be loaded
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Turn a robot description into small, fast C code for its dynamics, and calibrate the robot from logs.",
)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"psdmc {psdmc_version()}")
        raise typer.Exit


@app.callback()
def options(
    debug: Annotated[bool, typer.Option("--debug", help="print a traceback after an error")] = False,
    version: Annotated[
        bool, typer.Option("--version", help="print the version", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """Options before the command."""


COMMANDS = (
    (new, "write a robot file to start from"),
    (derive, "derive a robot's model and save it"),
    (show, "print a model or a robot file"),
    (view, "draw a robot, its masses and inertias on one page"),
    (check, "compare a model with Pinocchio and MuJoCo"),
    (emit_c, "write a model's C package"),
    (emit, "write a model's package in another language"),
    (build, "build a package and run its self-test"),
    (bench, "measure the speed of a model's code and of other programs"),
    (sample, "compute functions at random states, as Parquet files"),
    (excite, "plan the motions of a calibration"),
    (simulate, "write a campaign's logs from a virtual robot"),
    (calibrate, "identify a model's parameters from logs"),
    (figures, "write figures and tables of a calibration"),
    (payload, "identify the mass of a load from logs"),
    (validate, "test a calibrated model on other logs"),
    (compare, "compare two models of one robot"),
    (export_urdf, "write a model as a robot file"),
    (cache, "show or clear the compile cache"),
    (doctor, "list the programs and packages that psdmc can use"),
)
"""Each command with its line in the help."""

for command, line in COMMANDS:
    kind = EmitCommand if command in (emit, emit_c) else None
    app.command(command.__name__.replace("_", "-"), cls=kind, short_help=line)(command)
