"""The commands emit, emit-c and export-urdf. They import their modules when they run."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import wraps
from inspect import Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from psdmc.backends import BACK_ENDS
from psdmc.cli.arguments import check_output, names
from psdmc.cli.console import one_line, quoted, say_next, say_next_line, steps
from psdmc.cli.pipeline import CHECK_FAILED_STATUS, ModelFile
from psdmc.errors import InputError
from psdmc.target.presets import NATIVE, PRESETS

if TYPE_CHECKING:
    from psdmc.cli.tables import Table
    from psdmc.export.export_urdf import Exported
    from psdmc.export.read_back import Reading
    from psdmc.model.dynamics_model import DynamicsModel


class EmitCommand(TyperCommand):
    """A command whose option --friction has a value or none: `--friction MODEL` is no value MODEL."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the command line."""
        return super().parse_args(ctx, [f"{word}=" if word == "--friction" else word for word in args])


def _chosen_friction(value: str | None) -> Any:
    """Return the compiler's option `friction`: True for --friction alone, else its word."""
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
            help=f"language of the package: {', '.join(BACK_ENDS)}",
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
    gravity_input: Annotated[
        bool,
        typer.Option(
            "--gravity-input",
            help="gravity is an input of functions that depend on it; for a model derived with --gravity-input",
        ),
    ] = False,
    adapters: Annotated[
        list[str] | None,
        typer.Option(
            "--with",
            metavar="NAME,...",
            help="also write files for another program: casadi, casadi_theta, casadi_hessian, wheel, fmu, fmu2, mex, ros2",
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
    from psdmc.backends.package_folder import require_own_folder
    from psdmc.backends.protocol import back_end
    from psdmc.lower import admitted
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
            **{"smoothing-speed": smoothing_speed, "gravity-input": gravity_input, "estimator": estimator},
        )
    written = len(changed) - len(changed.removed)
    print(
        f"{folder}: {written} {'file' if written == 1 else 'files'} written"
        if changed
        else f"{folder}: nothing changed"
    )
    if changed.replaced is not None:
        was, now = changed.replaced
        print(f"note: the package of robot {one_line(was)} is replaced by that of {one_line(now)}")
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
    shown = admitted.wanted(wanted, found.mechanism)
    for remark in remarks(found.mechanism, names(adapters), shown, found.l):
        print(f"note: {remark}")
    ending = "; write --with casadi_theta to call them in CasADi" if names(adapters) == ("casadi",) else ""
    for note in admitted.run_time_only(found, shown):
        print(f"note: {note}{ending}")
    for what in beyond_friction(found):
        print(f"note: not in the package, though calibrated: {what}; add its torque to inverse dynamics'")
    say_next_line(language.next(quoted(folder)))


def _compare_emitted(model: Path, folder: Path, context: typer.Context) -> None:
    """Say in which files a package differs from what the options that it records give; exit status 5 if it does."""
    from psdmc import compiler

    typed = {key for key in context.params if str(context.get_parameter_source(key)).endswith("COMMANDLINE")}
    given = {key: context.params[key] for key in sorted(typed - {"model", "output", "check"})}
    given |= {} if "backend" in context.params else {"backend": BACK_ENDS[0]}
    if given.pop("force", False):
        raise InputError(
            "--check writes nothing, and --force is about what is overwritten", "leave out --force"
        )
    given = {word.replace("_", "-"): value for word, value in given.items()}
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


def export_urdf(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="model file")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="ROBOT.urdf", help="file to write")],
    mjcf: Annotated[
        bool | None,
        typer.Option(
            "--mjcf/--no-mjcf",
            help="also write ROBOT.xml, an MJCF with drive inertia as armature",
            show_default="if the model has drive inertia",
        ),
    ] = None,
) -> None:
    """Write a model as a URDF whose links have its theta_b: the physical links nearest to the file's."""
    from psdmc.cli.tables import print_line, print_table
    from psdmc.export.export_urdf import MJCF_SUFFIX
    from psdmc.export.export_urdf import export_urdf as run
    from psdmc.model.load import load

    check_output(output, model)
    if mjcf is not False:
        check_output(output.with_suffix(MJCF_SUFFIX), model)
    found = load(model)
    with steps() as progress:
        written = run(found, output, mjcf, progress)
    print_table(_links(found, written))
    for reading in written.readings:
        print_line(_read(written.urdf, reading))
    if written.mjcf is not None and written.mjcf_reading is not None:
        print_line(_read(written.mjcf, written.mjcf_reading))
    for note in written.notes:
        print_line(f"note: {note}")
    say_next("derive", output)


def _links(model: DynamicsModel, written: Exported) -> Table:
    """Mass of every link as written and as in the model's file, and how much else of it changed."""
    from psdmc.cli.tables import Table

    chain = model.mechanism
    found = zip(
        chain.joints, written.links.parameters, chain.parameters, written.links.divergence, strict=True
    )
    rows = []
    for joint, own, known, divergence in found:
        far = "no body there" if math.isnan(divergence) else f"{divergence:.3g}"
        before = "unknown" if math.isnan(known[0]) else f"{known[0]:.5g} kg"
        rows.append((joint.link_name, f"{own[0]:.5g} kg", before, far))
    return Table(("link", "mass", "in the model's file", "divergence from it"), rows)


def _read(path: Path, reading: Reading) -> str:
    if math.isnan(reading.error):
        return f"{path}: not compared with {reading.reader}: {reading.reason}"
    return f"{path}: {reading.reader}'s torques are theta_b's to {reading.error:.1e} of each joint's largest"
