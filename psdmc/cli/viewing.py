"""The commands that draw: `psdmc view` a robot in space, and `psdmc figures` the results of a calibration."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from psdmc.cli.output import check_output, one_line
from psdmc.cli.pipeline import Packages, RootBody, XacroOption, package_folders, xacro_arguments
from psdmc.cli.progress import steps
from psdmc.errors import InputError
from psdmc.robot.file_kinds import ROBOT_SUFFIXES


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
