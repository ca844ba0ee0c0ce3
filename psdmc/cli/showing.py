"""The commands that show: `psdmc show` in text, `view` in space, and `figures` the results of a calibration."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from psdmc.cli.arguments import check_output
from psdmc.cli.console import one_line, say_next, steps
from psdmc.cli.pipeline import (
    Packages,
    RootBody,
    XacroArguments,
    XacroOption,
    package_folders,
    say_what_a_model_is_for,
    xacro_arguments,
)
from psdmc.errors import InputError

if TYPE_CHECKING:
    from psdmc.lower.kernels import Lowering
    from psdmc.robot.mechanism import Mechanism

ROBOT_SUFFIXES = (".urdf", ".xacro", ".xml", ".mjcf", ".sdf", ".toml")
"""Endings of files that `psdmc show` reads as a robot; all others are models."""

LARGEST_EXPANDED = 2000
"""`show --cost` prints the expanded lowering too up to this many monomials; beyond, it takes minutes."""


def show(
    model: Annotated[
        Path,
        typer.Argument(
            metavar="MODEL", help="model file (.npz), or a robot file (.urdf, .xacro, .xml, .toml)"
        ),
    ],
    arguments: XacroArguments = None,
    terms: Annotated[bool, typer.Option("--terms", help="list the monomials y")] = False,
    cost: Annotated[bool, typer.Option("--cost", help="operations per function and lowering")] = False,
    json: Annotated[bool, typer.Option("--json", help="one JSON document instead, all digits")] = False,
    latex: Annotated[bool, typer.Option("--latex", help="the base parameters in LaTeX instead")] = False,
    root: RootBody = None,
    xacro_arg: XacroOption = None,
    package: Packages = None,
) -> None:
    """Print a model: joints, sizes, base parameters with equations, values and units, certificate. Of a robot file: all of
    its joints, what each hangs on and follows."""
    asked = [f"--{word}" for word, given in (("terms", terms), ("cost", cost), ("latex", latex)) if given]
    if len(asked) > 1 or (latex and json):
        both = " and ".join([*asked, *(["--json"] if latex and json else [])])
        raise InputError(f"{both} are several questions", "ask one at a time")
    if model.suffix.lower() in ROBOT_SUFFIXES:
        from psdmc.robot.load import load_robot

        if asked:
            raise InputError(f"{model}: {asked[0]} is of models", "derive one first: psdmc derive")
        found = load_robot(
            model,
            root=root,
            xacro_args=xacro_arguments(arguments, xacro_arg),
            packages=package_folders(package),
        )
        _show_robot(found.mechanism, json)
        if not json:
            flags = [
                word for one in (*(arguments or ()), *(xacro_arg or ())) for word in ("--xacro-arg", one)
            ]
            say_next("view", model, *_again(root, flags, package or ()))
            say_next("derive", model, *_again(root, [*(arguments or ()), *(xacro_arg or ())], package or ()))
    elif root or arguments or xacro_arg or package:
        raise InputError(f"{model}: a model, which has no further arguments", "they are of robot files")
    elif latex:
        from psdmc.model.load import load

        print(load(model).to_latex())
    else:
        _show_model(model, terms, cost, json)


def _again(root: str | None, arguments: Sequence[str], packages: Sequence[str]) -> list[str]:
    """The words by which another command reads the same robot."""
    body = [] if root is None else ["--root", root]
    return [*arguments, *body, *(word for one in packages for word in ("--package", one))]


def _show_robot(found: Mechanism, json: bool) -> None:
    if json:
        from psdmc.cli.show import mechanism_json, print_json

        print_json("robot", mechanism_json(found))
        return
    from psdmc.cli.show import print_mechanism

    print_mechanism(found)


def _show_model(path: Path, terms: bool, cost: bool, json: bool) -> None:
    from psdmc.cli.show import print_model, print_terms
    from psdmc.model.load import load

    found = load(path)
    if cost:
        from psdmc.cli.show import cost_json, print_cost, print_json

        small = found.p is not None and found.p <= LARGEST_EXPANDED
        both: tuple[Lowering, ...] = ("factored", "expanded") if small else ("factored",)
        with steps() as progress:
            progress("lowering")
            if json:
                print_json("cost", cost_json(found, both))
            else:
                print_cost(found, both)
    elif json:
        from psdmc.cli.show import model_json, print_json, terms_json

        print_json(*(("terms", terms_json(found)) if terms else ("model", model_json(found))))
    elif terms:
        print_terms(found)
    else:
        print_model(found)
    if not json:
        say_next("view", path)
        say_what_a_model_is_for(path, found)


def view(
    model: Annotated[
        Path,
        typer.Argument(
            metavar="MODEL",
            help="model or calibrated file (.npz), or a robot file (.urdf, .xacro, .xml, .toml)",
        ),
    ],
    log: Annotated[
        Path | None,
        typer.Argument(metavar="[LOG]", help="log whose motion is shown: one that psdmc calibrate takes"),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE.html", help="page to write; default: MODEL.html"),
    ] = None,
    root: RootBody = None,
    xacro_arg: XacroOption = None,
    package: Packages = None,
) -> None:
    """Draw a robot on one HTML page: links, axes, frames, masses and inertias of its file and of a calibration."""
    from psdmc.model.load import load
    from psdmc.report.view import require_own_page, viewed, write_view
    from psdmc.robot.load import load_robot

    target = output or Path(Path(model.name.removesuffix(".xacro")).stem + ".html")
    check_output(target, model, *([] if log is None else [log]))
    require_own_page(target)
    is_robot = model.suffix.lower() in ROBOT_SUFFIXES
    if not is_robot and (root or xacro_arg or package):
        raise InputError(f"{model}: a model, which has no further options", "they are of robot files")
    with steps() as progress:
        found = viewed(
            load_robot(
                model,
                root=root,
                xacro_args=xacro_arguments(None, xacro_arg),
                packages=package_folders(package),
            )
            if is_robot
            else load(model),
            log,
            progress,
        )
        progress("writing the page")
        write_view(found, target)
    for fault in found.faults:
        print(one_line(f"not physical: {fault}"))
    for note in found.notes:
        print(f"note: {one_line(note)}")
    print(f"{target}: open it in a browser")


def figures(
    model: Annotated[
        Path, typer.Argument(metavar="CALIBRATED", help="model file that psdmc calibrate wrote (.npz)")
    ],
    log: Annotated[
        Path | None,
        typer.Argument(
            metavar="[LOG]", help="log, log description or campaign: measured and predicted torque are drawn"
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="DIR", help="folder to write; default: CALIBRATED_figures"),
    ] = None,
) -> None:
    """Write figures (PDF, SVG) and tables (LaTeX) of a calibration, for a report or a paper."""
    from psdmc.model.load import load
    from psdmc.report.figures import require_own_folder, write_figures

    folder = output or Path(f"{model.stem}_figures")
    require_own_folder(folder)
    found = load(model)
    with steps() as progress:
        written = write_figures(found, folder, log, progress)
    for path in written:
        print(f"{path}: written")
