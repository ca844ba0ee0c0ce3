"""The commands and their arguments. The modules of a command are imported when it runs, so that `--version` and
`--help` are fast."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from psdmc.cli.output import check_output
from psdmc.cli.progress import steps
from psdmc.errors import InputError
from psdmc.robot.load_options import DEFAULT_SNAP
from psdmc.target.native import NATIVE
from psdmc.target.presets import PRESETS
from psdmc.version import psdmc_version

if TYPE_CHECKING:
    from psdmc.lower.kernels import Lowering

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="A compiler for robot dynamics: a robot in; small, fast, verified C out.",
)

CHECK_FAILED_STATUS = 5
LARGEST_EXPANDED = 2000
"""`show --cost` prints the expanded lowering too up to this many monomials; beyond, it takes minutes."""

ROBOT_SUFFIXES = (".urdf", ".xml", ".toml")
"""Endings of files that `show` reads as a robot; all others are models."""

RobotFile = Annotated[Path, typer.Argument(metavar="ROBOT", help="URDF, or DH table (.toml)")]
ModelFile = Annotated[Path, typer.Argument(metavar="MODEL", help="model file made by psdmc derive (.npz)")]


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


@app.command()
def derive(
    robot: RobotFile,
    output: Annotated[Path | None, typer.Option("-o", "--output", metavar="MODEL.npz")] = None,
    base: Annotated[
        str | None, typer.Option(metavar="LINK", help="link that a chain starts at; default: the whole tree")
    ] = None,
    tip: Annotated[str | None, typer.Option(metavar="LINK", help="link that it ends at")] = None,
    gravity: Annotated[
        tuple[float, float, float] | None,
        typer.Option(metavar="GX GY GZ", help="m/s^2 in the file's root frame"),
    ] = None,
    drive_inertia: Annotated[
        str | None,
        typer.Option(
            metavar="I1,I2,...", help="joints' drive inertias as parameters, kg m^2; 'all': values zero"
        ),
    ] = None,
    assume_zero: Annotated[
        str, typer.Option(metavar="NAME,...", help="parameters assumed zero, such as link5:mx,link5:Ixz@com")
    ] = "",
    snap: Annotated[
        float, typer.Option(metavar="RAD", help="make rotations exact that are this near to exact; 0: off")
    ] = DEFAULT_SNAP,
    expand: Annotated[
        bool | None,
        typer.Option(
            "--expand/--no-expand", help="derive E and P beside theta_b", show_default="for serial chains"
        ),
    ] = None,
    frames: Annotated[
        str,
        typer.Option(
            metavar="LINK,...", help="links that kinematic functions are about; default: the tip, or all ends"
        ),
    ] = "",
    tool: Annotated[
        tuple[float, float, float, float, float, float] | None,
        typer.Option(
            metavar="X Y Z R P Y", help="one more such frame, 'tool', in the tip's: m, rad as in URDF"
        ),
    ] = None,
    lock: Annotated[
        list[str] | None,
        typer.Option(metavar="JOINT=VALUE", help="hold a joint there, rad or m; may be given several times"),
    ] = None,
    floating: Annotated[
        bool,
        typer.Option(
            "--floating", help="put the root link on a free joint, as of a robot that walks or flies"
        ),
    ] = False,
) -> None:
    """Derive a robot's model (E, P, theta_b) and save it."""
    from psdmc import compiler
    from psdmc.robot.lock import parsed as parsed_lock

    target = output or Path(robot.stem + ".npz")
    check_output(target, robot)
    with steps() as progress:
        model = compiler.derive(
            robot,
            base,
            tip,
            gravity,
            _drive_inertia(drive_inertia),
            tuple(name.strip() for name in assume_zero.split(",") if name.strip()),
            snap,
            expand,
            progress,
            tuple(name.strip() for name in frames.split(",") if name.strip()),
            tool,
            parsed_lock(lock or ()),
            floating,
        )
    model.save(target)
    sizes = f"l = {model.l}" if model.p is None else f"p = {model.p}, l = {model.l}"
    own = f" with {model.nv} coordinates" if model.mechanism.has_followers else ""
    print(f"{target}: {model.n} joints{own}, {sizes}, largest torque error {model.certificate.max():.1e}")
    for note in model.mechanism.notes:
        print(f"note: {note}")


def _drive_inertia(text: str | None) -> bool | tuple[float, ...]:
    if text is None:
        return False
    if text == "all":
        return True
    try:
        return tuple(float(word) for word in text.split(","))
    except ValueError:
        raise InputError(
            f"--drive-inertia is {text!r}", "give numbers separated by commas, one a joint, or 'all'"
        ) from None


@app.command()
def show(
    model: Annotated[
        Path, typer.Argument(metavar="MODEL", help="model file (.npz), or a robot file (.urdf, .toml)")
    ],
    terms: Annotated[bool, typer.Option("--terms", help="list the monomials y")] = False,
    cost: Annotated[bool, typer.Option("--cost", help="operations per function and lowering")] = False,
) -> None:
    """Print a model: joints, sizes, base parameters with equations, values and units, certificate. Of a robot file: all of
    its joints, what each hangs on and follows."""
    from psdmc.cli.show import print_cost, print_mechanism, print_model, print_terms
    from psdmc.model.load import load

    if model.suffix.lower() in ROBOT_SUFFIXES:
        from psdmc.robot.load import load_robot

        if terms or cost:
            raise InputError(f"{model}: --terms and --cost are of models", "derive one first: psdmc derive")
        print_mechanism(load_robot(model).mechanism)
        return
    found = load(model)
    if terms:
        print_terms(found)
    elif cost:
        small = found.p is not None and found.p <= LARGEST_EXPANDED
        both: tuple[Lowering, ...] = ("factored", "expanded")
        with steps() as progress:
            progress("lowering")
            print_cost(found, both if small else both[:1])
    else:
        print_model(found)


@app.command()
def check(
    model: ModelFile,
    robot: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="robot file to check against instead of the embedded source"),
    ] = None,
) -> None:
    """Check a model again, independently, against Pinocchio's (and MuJoCo's) own reading of its source, and its mass
    matrix."""
    from psdmc.cli.show import print_check, print_mass_check
    from psdmc.model.load import load
    from psdmc.model.mass_check import check_mass_matrix
    from psdmc.robot.load import load_robot
    from psdmc.verification.check import check_model

    found = load(model)
    source = None
    if robot is not None:
        source = load_robot(robot, **found.provenance.get("options", {}))
    with steps() as progress:
        progress("checking against other readers")
        rows = check_model(found, source)
        mass = check_mass_matrix(found)
    print_check(rows)
    print_mass_check(mass)
    if not all(row.passed for row in rows) or (mass is not None and not mass.passed):
        raise typer.Exit(CHECK_FAILED_STATUS)


@app.command(name="emit-c")
def emit_c(
    model: ModelFile,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR")],
    lowering: Annotated[str, typer.Option(help="auto, expanded or factored")] = "auto",
    functions: Annotated[
        str, typer.Option(metavar="NAME,...", help="generate these functions; 'default', 'all'")
    ] = "",
    real: Annotated[str | None, typer.Option(help="float64 or float32; default: the target's")] = None,
    trig: Annotated[
        str | None,
        typer.Option(
            help="inline, freestanding (no libm, NaN beyond 1e5 rad) or libm; default: the target's"
        ),
    ] = None,
    name: Annotated[str | None, typer.Option(help="the robot's name in C")] = None,
    force: Annotated[bool, typer.Option(help="overwrite files that psdmc did not write")] = False,
    payload: Annotated[bool, typer.Option("--payload", help="also R_add_payload: loads at run time")] = False,
    adapters: Annotated[
        str, typer.Option("--with", metavar="NAME,...", help="also a library for another program: casadi")
    ] = "",
    target: Annotated[
        str,
        typer.Option(metavar="MACHINE", help=f"{', '.join(PRESETS)}: which machine, see docs/shipping.md"),
    ] = NATIVE.name,
) -> None:
    """Write a model's C package: header, sources, build files, self-test."""
    from psdmc import compiler
    from psdmc.lower.admitted import run_time_only
    from psdmc.model.load import load

    found = load(model)
    wanted = [word.strip() for word in functions.split(",") if word.strip()] or None
    with steps() as progress:
        changed = compiler.emit_c(
            found,
            output,
            lowering,  # type: ignore[arg-type]
            wanted,
            real,  # type: ignore[arg-type]
            trig,  # type: ignore[arg-type]
            name,
            force,
            progress,
            payload,
            [word.strip() for word in adapters.split(",") if word.strip()],
            target,
        )
    print(f"{output}: {len(changed)} files written" if changed else f"{output}: nothing changed")
    for note in run_time_only(found, wanted):
        print(f"note: {note}")


@app.command()
def build(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="folder made by emit-c")],
    edited: Annotated[
        bool, typer.Option("--edited", help="build although files are not as emit-c wrote them")
    ] = False,
) -> None:
    """Build an emitted package through its own build files and run its self-test."""
    from psdmc.toolchain.build_package import build_package

    with steps() as progress:
        progress("building")
        build_package(directory, edited)
    print(f"{directory}: built, self-test passed")


@app.command()
def cache(
    clear: Annotated[bool, typer.Option("--clear", help="remove every entry")] = False,
) -> None:
    """Show where compiled libraries are kept and how many, or remove them."""
    from psdmc.cli.show import megabytes
    from psdmc.toolchain.cache_room import cache_contents, clear_cache

    if clear:
        print(f"{clear_cache()} entries removed")
    found = cache_contents()
    print(f"{found.place}: {found.entries} entries, {megabytes(found.size)} of {megabytes(found.limit)}")


PIPELINE = frozenset({"derive", "show", "check", "emit-c", "build", "cache", "--version"})
"""First words that need no other command."""


def needs_measuring(words: list[str]) -> bool:
    """Whether a command line may be about the commands beside the pipeline, or about all commands: importing those
    takes a second."""
    first = next((word for word in words if word != "--debug"), "")
    return first not in PIPELINE
