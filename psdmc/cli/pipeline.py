"""The commands derive, check, build and cache. A command imports its modules when it runs."""

from __future__ import annotations

import math
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from psdmc.cli.arguments import assignments, check_output, names, numbers
from psdmc.cli.console import quoted, say_next, say_next_line, steps
from psdmc.errors import InputError
from psdmc.robot.load_options import DEFAULT_SNAP
from psdmc.target.presets import PRESETS

if TYPE_CHECKING:
    from psdmc.model.dynamics_model import DynamicsModel
    from psdmc.verification.check import CheckRow

CHECK_FAILED_STATUS = 5

PLAIN_VALUE = re.compile(r"[\w\s.,:/+\-\[\]]*")
"""Words, paths, numbers and lists of them."""

RobotFile = Annotated[
    Path, typer.Argument(metavar="ROBOT", help="URDF, xacro, MJCF (.xml), or DH table (.toml)")
]
RootBody = Annotated[
    str | None,
    typer.Option("--root", metavar="BODY", help="first body of the robot, if several bodies of an MJCF move"),
]
XacroArguments = Annotated[
    list[str] | None,
    typer.Argument(metavar="[NAME:=VALUE]...", help="arguments of a xacro file", show_default=False),
]
XacroOption = Annotated[
    list[str] | None,
    typer.Option("--xacro-arg", metavar="NAME:=VALUE", help="an argument of a xacro file, as an option"),
]
Packages = Annotated[
    list[str] | None,
    typer.Option(
        "--package", metavar="NAME=DIR", help="folder of the package that a xacro file calls $(find NAME)"
    ),
]
ModelFile = Annotated[Path, typer.Argument(metavar="MODEL", help="model file made by psdmc derive (.npz)")]


def derive(
    robot: RobotFile,
    arguments: XacroArguments = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", metavar="MODEL.npz")] = None,
    base: Annotated[
        str | None, typer.Option(metavar="LINK", help="first link of the chain; default: the whole robot")
    ] = None,
    tip: Annotated[str | None, typer.Option(metavar="LINK", help="last link of the chain")] = None,
    gravity: Annotated[
        list[str] | None,
        typer.Option(metavar="GX,GY,GZ", help="gravity in the root frame of the file, m/s^2"),
    ] = None,
    drive_inertia: Annotated[
        list[str] | None,
        typer.Option(
            metavar="I1,I2,...", help="drive inertia of each joint, kg m^2; all: unknown, starting from zero"
        ),
    ] = None,
    assume_zero: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME,...", help="assume that these parameters are zero, such as link5:mx"),
    ] = None,
    snap: Annotated[
        float,
        typer.Option(metavar="RAD", help="make nearly right angles exact, up to this error in rad; 0: never"),
    ] = DEFAULT_SNAP,
    expand: Annotated[
        bool | None,
        typer.Option(
            "--expand/--no-expand",
            help="also compute E and P, the expanded form",
            show_default="for serial chains",
        ),
    ] = None,
    frames: Annotated[
        list[str] | None,
        typer.Option(
            metavar="LINK,...",
            help="frames of poses, Jacobians and loads; default: the tip, or each branch's end",
        ),
    ] = None,
    tool: Annotated[
        list[str] | None,
        typer.Option(
            metavar="X,Y,Z,R,P,Y",
            help="add the frame 'tool', given in the tip's frame: m, and rad as in URDF",
        ),
    ] = None,
    lock: Annotated[
        list[str] | None,
        typer.Option(metavar="JOINT=VALUE,...", help="fix joints at these positions, rad or m"),
    ] = None,
    floating: Annotated[
        bool,
        typer.Option("--floating", help="let the base move freely, for a robot that walks or flies"),
    ] = False,
    root: RootBody = None,
    xacro_arg: XacroOption = None,
    package: Packages = None,
    unknown: Annotated[
        list[str] | None,
        typer.Option(
            metavar="LINK,...",
            help="links whose inertia is unknown; all: every link; missing: links without <inertial>",
        ),
    ] = None,
    contacts: Annotated[
        list[str] | None,
        typer.Option(
            metavar="LINK[:6],...",
            help="links that can touch the world, as a point or (:6) a surface; default: each frame, a point",
        ),
    ] = None,
    loops: Annotated[
        Path | None, typer.Option(metavar="LOOPS.toml", help="file with closed loops, tables [[loop]]")
    ] = None,
    gravity_input: Annotated[
        bool,
        typer.Option(
            "--gravity-input", help="base parameters for every gravity, for code with gravity as an input"
        ),
    ] = False,
) -> None:
    """Derive a robot's model (E, P, theta_b) and save it."""
    from psdmc import compiler
    from psdmc.cli.show import print_loop_base_parameters
    from psdmc.cli.tables import print_note
    from psdmc.robot.urdf.dependent_joints import parsed_lock

    target = output or Path(Path(robot.name.removesuffix(".xacro")).stem + ".npz")
    if robot.suffix == ".npz":
        raise InputError(f"{robot}: a model, which is derived already", "give the robot's file")
    check_output(target, robot)
    with steps() as progress:
        model = compiler.derive(
            robot,
            base,
            tip,
            numbers(gravity, "--gravity", "three numbers, such as --gravity 0,0,-9.81"),
            _drive_inertia(drive_inertia),
            names(assume_zero),
            snap,
            expand,
            progress,
            names(frames),
            numbers(tool, "--tool", "six numbers: x,y,z in m, roll,pitch,yaw in rad"),
            parsed_lock(assignments(lock)),
            floating,
            root,
            xacro_arguments(arguments, xacro_arg),
            package_folders(package),
            names(unknown),
            names(contacts),
            loops or (),
            gravity_input,
        )
    model.save(target)
    sizes = f"l = {model.l}" if model.p is None else f"p = {model.p}, l = {model.l}"
    own = f" with {model.nv} coordinates" if model.mechanism.has_mimic_joints else ""
    print(f"{target}: {model.n} joints{own}, {sizes}, largest torque error {model.certificate.max():.1e}")
    for note in model.mechanism.notes:
        print_note(note)
    print_loop_base_parameters(model)
    say_next("check", target)


def xacro_arguments(words: list[str] | None, options: list[str] | None) -> dict[str, str]:
    """Return the values of xacro arguments by name, from the words after the robot's file and from --xacro-arg."""
    from psdmc.robot.xacro_file import parsed_arguments

    return parsed_arguments([*(words or ()), *(options or ())])


def package_folders(given: list[str] | None) -> dict[str, Path]:
    """Folders by package, of --package."""
    found = {}
    for text in assignments(given):
        name, equals, folder = text.partition("=")
        if not equals or name in found:
            what = f"{name!r} is named twice" if equals else f"{text!r} is no NAME=DIR"
            raise InputError(f"--package: {what}", "such as --package ur_description=DIR")
        found[name] = Path(folder)
    return found


def _drive_inertia(given: list[str] | None) -> bool | tuple[float, ...]:
    if given == ["all"]:
        return True
    return (
        numbers(given, "--drive-inertia", "give numbers separated by commas, one a joint, or 'all'") or False
    )


def say_what_a_model_is_for(path: Path, model: DynamicsModel) -> None:
    """Print the next command for a model: emit-c if its parameters are known, else excite, which plans a calibration."""
    unknown = model.theta_b is None
    if unknown and all(joint.type.about_z for joint in model.mechanism.joints):
        say_next("excite", path, "-o", f"{path.stem}_campaign")
    else:
        say_next("emit-c", path, "-o", path.stem)


def check(
    model: ModelFile,
    arguments: XacroArguments = None,
    robot: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="robot file to compare with; default: the source in the model"),
    ] = None,
    xacro_arg: XacroOption = None,
    package: Packages = None,
) -> None:
    """Check a model again, independently, against Pinocchio's (and MuJoCo's) own reading of its source, and its mass
    matrix."""
    from psdmc.model.load import load
    from psdmc.model.parameter_checks import check_mass_matrix
    from psdmc.robot.load import load_robot
    from psdmc.verification.check import check_model

    found = load(model)
    given, folders, source = xacro_arguments(arguments, xacro_arg), package_folders(package), None
    if robot is None and (given or folders):
        raise InputError("xacro arguments or packages are given, but no xacro file", "add --robot FILE.xacro")
    if robot is not None:
        options = dict(found.provenance.get("options", {}))
        kept = options.pop("xacro_args", {})
        kept = kept if robot.suffix.lower() == ".xacro" else {}
        # A model may be forged, and xacro evaluates values: kept ones are taken only where they cannot call anything.
        for name, value in kept.items():
            if name not in given and not PLAIN_VALUE.fullmatch(value):
                raise InputError(
                    f"the model's value of xacro argument {name!r} is more than a word or numbers",
                    f"give it again: {name}:=VALUE",
                )
        source = load_robot(robot, **options, xacro_args={**kept, **given}, packages=folders)
    with steps() as progress:
        progress("checking against other readers")
        rows = check_model(found, source)
        progress("checking the mass matrix")
        mass = check_mass_matrix(found)
    _print_check(rows)
    if mass is None:
        print("mass matrix: not tested, for the base parameters are unknown")
    else:
        print(f"{'pass' if mass.passed else 'FAIL'}: {mass.reason}")
    if not all(row.passed for row in rows) or (mass is not None and not mass.passed):
        raise typer.Exit(CHECK_FAILED_STATUS)
    say_what_a_model_is_for(model, found)


def _print_check(rows: Sequence[CheckRow]) -> None:
    """Print the result of each comparison, and which programs read the robot file."""
    from psdmc.cli.tables import Table, print_line, print_table
    from psdmc.verification.check import readers

    texts = []
    for row in rows:
        limit = "" if row.limit is None else f"{row.limit:.0e}"
        error = "" if math.isnan(row.error) and row.limit is None else f"{row.error:.1e}"
        verdict = "" if row.limit is None else "pass" if row.passed else "FAIL"
        remark = f" ({row.remark})" if row.remark else ""
        texts.append((verdict, error, limit, f"{row.name}: {row.against}{remark}"))
    print_table(
        Table(("result", "error", "limit", "relative error of what, against what"), texts, prose=True)
    )
    print_line(readers(rows))


def build(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="folder made by emit-c")],
    edited: Annotated[
        bool, typer.Option("--edited", help="build even if files of the package were edited")
    ] = False,
) -> None:
    """Build an emitted package through its own build files and run its self-test."""
    from psdmc.toolchain.build_package import build_package, checks_of

    with steps() as progress:
        built = build_package(directory, edited, progress)
    print(f"{directory}: built, self-test passed ({checks_of(built)})")
    for library in sorted((directory / "build").glob("lib*.a")):  # which CMake and make both write
        print(f"{library}: written")
    say_next_line(_after_building(directory))


def _after_building(package: Path) -> str:
    """The command that puts a built package to use: installed for its user; compiled for the board that it is made for."""
    from psdmc.backends.manifest import target_of

    target = PRESETS.get(target_of(package) or "")
    if target is not None and target.tools:
        compilers = f"CC={target.tools}gcc AR={target.tools}ar"
        return f"BUILD=board {compilers} make -C {quoted(package)} all"
    if shutil.which("make") is None:
        return f'cmake --install {quoted(package / "build")} --prefix "$HOME/.local"'
    return f'make -C {quoted(package)} install PREFIX="$HOME/.local"'


def cache(
    clear: Annotated[bool, typer.Option("--clear", help="remove every entry")] = False,
) -> None:
    """Show where compiled libraries are kept and how many, or remove them."""
    from psdmc.toolchain.cache_room import cache_contents, clear_cache

    if clear:
        print(f"{clear_cache()} entries removed")
    found = cache_contents()
    size, limit = (f"{count / 2**20:.1f} MiB" for count in (found.size, found.limit))
    print(f"{found.place}: {found.entries} entries, {size} of {limit}")
    if found.entries:
        say_next("cache", "--clear")
