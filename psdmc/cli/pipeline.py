"""The commands derive, check, emit, emit-c, build and cache. A command imports its modules when it runs."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from functools import wraps
from inspect import Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from psdmc.cli.lists import assignments, names, numbers
from psdmc.cli.output import check_output, quoted, say_next, say_next_line
from psdmc.cli.progress import steps
from psdmc.errors import InputError
from psdmc.robot.load_options import DEFAULT_SNAP
from psdmc.target.native import NATIVE
from psdmc.target.presets import PRESETS

if TYPE_CHECKING:
    from psdmc.model.dynamics_model import DynamicsModel

CHECK_FAILED_STATUS = 5

BACK_ENDS = ("c", "rust")
"""Those of psdmc.backends.protocol, which loads slowly; a test compares."""

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
) -> None:
    """Derive a robot's model (E, P, theta_b) and save it."""
    from psdmc import compiler
    from psdmc.cli.tables import print_note
    from psdmc.robot.lock import parsed as parsed_lock

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
        )
    model.save(target)
    sizes = f"l = {model.l}" if model.p is None else f"p = {model.p}, l = {model.l}"
    own = f" with {model.nv} coordinates" if model.mechanism.has_followers else ""
    print(f"{target}: {model.n} joints{own}, {sizes}, largest torque error {model.certificate.max():.1e}")
    for note in model.mechanism.notes:
        print_note(note)
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
    from psdmc.cli.show_checks import print_check, print_mass_check
    from psdmc.model.load import load
    from psdmc.model.mass_check import check_mass_matrix
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
    print_check(rows)
    print_mass_check(mass)
    if not all(row.passed for row in rows) or (mass is not None and not mass.passed):
        raise typer.Exit(CHECK_FAILED_STATUS)
    say_what_a_model_is_for(model, found)


class EmitCommand(TyperCommand):
    """A command whose option --friction has a value or none: `--friction MODEL` is no value MODEL."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the command line."""
        return super().parse_args(ctx, [f"{word}=" if word == "--friction" else word for word in args])


def _chosen_friction(value: str | None) -> Any:
    """What the compiler takes: True for --friction alone, else its word."""
    if value not in (None, "", "in-dynamics"):
        raise InputError(f"--friction={value}", "type --friction or --friction=in-dynamics")
    return True if value == "" else value


def emit(
    context: typer.Context,
    model: ModelFile,
    backend: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help=f"language of the package: {' or '.join(BACK_ENDS)}",
            autocompletion=lambda: list(BACK_ENDS),
        ),
    ] = BACK_ENDS[0],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="DIR", help="folder to write; default: the model's name"),
    ] = None,
    lowering: Annotated[
        str,
        typer.Option(
            help="form of the code: auto, expanded or factored",
            autocompletion=lambda: ["auto", "expanded", "factored"],
        ),
    ] = "auto",
    functions: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME,...", help="functions to generate; also default, all, NAME_theta_rows"),
    ] = None,
    real: Annotated[
        str | None,
        typer.Option(
            help="precision: float64 or float32; default: the target's",
            autocompletion=lambda: ["float64", "float32"],
        ),
    ] = None,
    trig: Annotated[
        str | None,
        typer.Option(
            help="sine and cosine: inline, freestanding (no libm, NaN above 1e5 rad) or libm; default: the target's",
            autocompletion=lambda: ["inline", "freestanding", "libm"],
        ),
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(
            help="name of the robot in the code, in C the prefix of all symbols; default: the model's"
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="write into a folder with other files, and replace edited files")
    ] = False,
    payload: Annotated[
        bool, typer.Option("--payload", help="also write R_add_payload, for loads at run time")
    ] = False,
    bodies: Annotated[
        bool,
        typer.Option("--bodies", help="also write R_theta_from_bodies: theta_b from masses and inertias"),
    ] = False,
    friction: Annotated[
        str | None,
        typer.Option(
            "--friction",
            metavar="[=in-dynamics]",
            help="also write R_friction, for a model calibrated from logs; =in-dynamics: instead, torques contain friction",
            callback=_chosen_friction,
            show_default=False,
        ),
    ] = None,
    smoothing_speed: Annotated[
        float | None,
        typer.Option(
            metavar="V",
            help="rad/s (m/s), with --friction=in-dynamics: the sign of a speed v is tanh(v / V); default: as calibrated",
        ),
    ] = None,
    estimator: Annotated[
        str | None,
        typer.Option(
            metavar="KIND",
            help="also write R_estimate_step, which estimates a load; mass: its mass and centre, inertia: all of it",
            autocompletion=lambda: ["mass", "inertia"],
        ),
    ] = None,
    adapters: Annotated[
        list[str] | None,
        typer.Option(
            "--with",
            metavar="NAME,...",
            help="also write files for another program: casadi, casadi_theta, casadi_hessian, wheel, fmu",
        ),
    ] = None,
    target: Annotated[
        str,
        typer.Option(
            metavar="MACHINE",
            help=f"{', '.join(PRESETS)}: processor to generate for",
            autocompletion=lambda: list(PRESETS),
        ),
    ] = NATIVE.name,
    check: Annotated[
        bool,
        typer.Option(
            "--check", help="write nothing; say if the package in DIR is up to date (exit status 5: no)"
        ),
    ] = False,
) -> None:
    """Write a model's package in a language of choice: sources, build files, self-test."""
    if check:
        _compare_emitted(model, output or Path(model.stem), context)
        return
    from psdmc import compiler
    from psdmc.backends.c.adapters import remarks
    from psdmc.backends.protocol import back_end
    from psdmc.backends.write import require_own_folder
    from psdmc.cli.output import one_line
    from psdmc.lower import kernels
    from psdmc.lower.admitted import run_time_only
    from psdmc.model.linear_friction import beyond_friction
    from psdmc.model.load import load

    language = back_end(backend)
    folder = output or Path(model.stem)
    require_own_folder(folder, force)
    found = load(model)
    wanted = names(functions) if functions else None
    with steps() as progress:
        changed = compiler.emit(
            found,
            folder,
            backend,
            lowering,  # type: ignore[arg-type]
            wanted,
            real,  # type: ignore[arg-type]
            name,
            force,
            progress,
            trig,  # type: ignore[arg-type]
            target,
            **{"payload": payload, "with": names(adapters), "friction": friction or False, "bodies": bodies},
            **{"smoothing-speed": smoothing_speed},
            estimator=estimator,
        )
    written = len(changed) - len(changed.removed)
    print(f"{folder}: {written} files written" if changed else f"{folder}: nothing changed")
    if changed.removed:
        print(f"{folder}: removed, because the package no longer has them: {', '.join(changed.removed)}")
    for path, name_now in changed.kept.items():
        print(f"note: {path} was not written by psdmc; the old file is now {name_now}")
    for before, now in changed.renamed:
        print(f"note: {before} of the old package is now called {now}")
    asked = name or found.mechanism.name
    written_as = language.identifier(asked)
    file, use = language.entry(written_as)
    print(f"{folder / file}: {use}")
    if written_as != asked:
        print(f"note: the {language.language} name of '{one_line(asked)}' is {written_as}")
    elif output is None and asked != folder.name:
        print(f"note: the {language.named} is {asked}; --name changes it")
    shown = kernels.wanted(wanted, found.mechanism)
    for remark in remarks(found.mechanism, names(adapters), shown, found.l):
        print(f"note: {remark}")
    ending = "; write --with casadi_theta to call them in CasADi" if names(adapters) == ("casadi",) else ""
    for note in run_time_only(found, wanted):
        print(f"note: {note}{ending}")
    for what in beyond_friction(found):
        print(f"note: not in the package, though calibrated: {what}; add its torque to inverse dynamics'")
    say_next_line(language.next(quoted(folder)))


def _compare_emitted(model: Path, folder: Path, context: typer.Context) -> None:
    """Say in which files a package differs from what the options that it records give; exit status 5 if it does."""
    from psdmc import compiler
    from psdmc.cli.output import one_line

    typed = {key for key in context.params if str(context.get_parameter_source(key)).endswith("COMMANDLINE")}
    given = {key: context.params[key] for key in sorted(typed - {"model", "output", "check"})}
    given |= {} if "backend" in context.params else {"backend": BACK_ENDS[0]}
    if given.pop("force", False):
        raise InputError(
            "--check writes nothing, and --force is about what is overwritten", "leave out --force"
        )
    if "smoothing_speed" in given:
        given["smoothing-speed"] = given.pop("smoothing_speed")
    lists = {"adapters": "with", "functions": "functions"}
    given |= {word: names(given.pop(key)) for key, word in lists.items() if key in given}
    with steps() as progress:
        found = compiler.compare_emitted(model, folder, given, progress)
    if not found:
        print(f"{folder}: up to date")
        return
    print(f"{folder}: differs from what psdmc writes for {model}")
    for kind in ("changed", "missing", "added"):
        for path in getattr(found, kind):
            print(f"  {kind:7}  {path}")
    for reason in found.reasons:
        print(f"note: {one_line(reason)}")
    raise typer.Exit(CHECK_FAILED_STATUS)


def _without_backend(command: Callable[[], None]) -> Callable[..., None]:
    """The command `emit` for C, under the name and with the words of `command`."""
    kept = [each for each in signature(emit, eval_str=True).parameters.values() if each.name != "backend"]

    @wraps(command)
    def run(**options: Any) -> None:
        emit(backend="c", **options)

    run.__signature__ = Signature(kept)  # type: ignore[attr-defined]
    run.__annotations__ = {each.name: each.annotation for each in kept}
    del run.__wrapped__
    return run


@_without_backend
def emit_c() -> None:
    """Write a model's C package: header, sources, build files, self-test."""


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
    from psdmc.backends.own_files import target_of

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
    from psdmc.cli.show_checks import megabytes
    from psdmc.toolchain.cache_room import cache_contents, clear_cache

    if clear:
        print(f"{clear_cache()} entries removed")
    found = cache_contents()
    print(f"{found.place}: {found.entries} entries, {megabytes(found.size)} of {megabytes(found.limit)}")
    if found.entries:
        say_next("cache", "--clear")
