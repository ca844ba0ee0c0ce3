"""Commands that write a model in a format for other programs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from psdmc.cli.output import check_output, say_next
from psdmc.cli.progress import steps

if TYPE_CHECKING:
    from psdmc.cli.tables import Table
    from psdmc.export.export_urdf import Exported
    from psdmc.export.read_back import Reading
    from psdmc.model.dynamics_model import DynamicsModel


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
