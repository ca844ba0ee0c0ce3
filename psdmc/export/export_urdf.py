"""`psdmc.export_urdf` writes a URDF with the model's theta_b, and an MJCF if a URDF cannot hold everything."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from psdmc.errors import InputError, InternalError
from psdmc.export.bodies import Written, calibrated_friction_notes, joint_friction, written
from psdmc.export.elements import as_text, exact, urdf_of
from psdmc.export.from_source import urdf_with
from psdmc.export.mjcf import MARK, mjcf_of
from psdmc.export.read_back import LIMIT, Reading, read_mjcf_back, read_urdf_back
from psdmc.files import check_place, refuse_foreign_file, write_together, write_whole
from psdmc.links.physical_links import PhysicalLinks, physical_links
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.progress import Progress, silent
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import DRIVE, require_axes
from psdmc.robot.xml_text import parse_xml

MJCF_SUFFIX = ".xml"
STANDARD = (0.0, 0.0, -9.81)
"""m/s^2 in the root's axes that readers of a URDF take."""
GRAVITY_ROUNDING = 1e-12
"""Share of gravity by which it may differ from what readers of a URDF take."""


@dataclass(frozen=True, slots=True, eq=False)
class Exported:
    """The result of `export_urdf`: the files, and how well the torques of other programs agree with theta_b.

    urdf, mjcf    the files; mjcf is None if no MJCF was written
    links         standard parameters of the written links, and their distance from those of the robot file
    readings      comparison of the torques of Pinocchio and MuJoCo for the URDF with those of the model
    mjcf_reading  comparison of the torques of MuJoCo for the MJCF with those of the model
    notes         what the files do not contain, and what was changed, one sentence each
    """

    urdf: Path
    mjcf: Path | None
    links: PhysicalLinks
    readings: tuple[Reading, ...]
    mjcf_reading: Reading | None
    notes: tuple[str, ...]


def export_urdf(
    model: DynamicsModel, path: str | Path, mjcf: bool | None = None, progress: Progress = silent
) -> Exported:
    """Write a model as a URDF, with masses and inertias that are physically possible and give the model's torques.

    The torques depend only on the base parameters theta_b. Many masses and inertias give the same theta_b. The export
    chooses those that are nearest to the ones in the robot file. If the model comes from a URDF, psdmc copies names,
    limits and shapes from that file. If the model is calibrated, its friction becomes the elements <dynamics>.

    Before psdmc writes the URDF, Pinocchio reads its text, and psdmc compares Pinocchio's torques with those of the model.
    If psdmc also writes an MJCF, it compares MuJoCo's torques for the MJCF with those of the model.

    Returns an object with the paths, the parameters of the links and the largest torque differences.

    path      URDF file to write
    mjcf      True: also write an MJCF with the suffix .xml; False: write no MJCF; None: write one only if the model has
              drive inertias. psdmc replaces an existing .xml file only if psdmc wrote it
    progress  function, such as print, that psdmc calls with the name of each stage

    Raises InputError if theta_b is unknown, or if psdmc cannot write a file. Raises NoSuchLinks, a kind of InputError, if
    no physically possible masses and inertias give theta_b.
    """
    target = Path(path)
    beside = target.with_suffix(MJCF_SUFFIX)
    _require_exportable(model)
    check_place(target)
    progress("finding physical links")
    links = physical_links(model)
    drives = links.parameters[:, DRIVE]
    wanted = bool(drives.any()) if mjcf is None else mjcf
    if wanted and beside == target:
        raise InputError(f"{target}: psdmc writes the MJCF to this file", "call the URDF NAME.urdf")
    if wanted:
        remedy = f"give -o another name, move {beside}, or --no-mjcf: an MJCF with drive inertia goes there"
        refuse_foreign_file(beside, MARK, remedy)
    what, text, notes = _urdf(model, links)
    progress("reading it back")
    readings = read_urdf_back(model, text, drives, what.gravity)
    if not readings[0].error <= LIMIT:
        raise InternalError(f"a written URDF's torques are {readings[0].error:.2g} away from theta_b's")
    other = as_text(mjcf_of(what)) if wanted else None
    mjcf_reading = None if other is None else read_mjcf_back(model, other)
    if other is None:
        write_whole(target, text)
    else:
        write_together(target.parent, {target.name: text, beside.name: other})
    notes = (*_drive_notes(model, drives, beside if wanted else None), *_gravity_notes(what), *notes)
    return Exported(target, beside if wanted else None, links, readings, mjcf_reading, notes)


def _require_exportable(model: DynamicsModel) -> None:
    """InputError where a joint is of a kind that is not written: all but one of one coordinate, and a floating base."""
    chain = model.mechanism
    if not all(kind.about_z for kind in chain.types[1:]) or not (
        chain.has_floating_base or chain.types[0].about_z
    ):
        require_axes(chain, "a written URDF")
    own = zip(chain.joint_names, chain.coordinates, strict=True)
    sums = [name for name, coordinate in own if coordinate.others]
    linked = [name for name in _linked_by_loops(model) if name not in sums]
    if sums or linked:
        what = (
            "several joints, which a URDF cannot contain"
            if sums
            else "another by a closed loop of another file"
        )
        raise InputError(
            f"{shown(chain.name)}: joint {shown((sums or linked)[0])} follows {what}",
            "use the robot's own file with its loops",
        )
    model.known_theta_b()


def _linked_by_loops(model: DynamicsModel) -> list[str]:
    """Joints of a URDF that follow others without <mimic>: those of parallelograms."""
    kept, chain = model.provenance, model.mechanism
    if kept.get("source_format") != "urdf" or not kept.get("options", {}).get("loops"):
        return []
    root = parse_xml(kept["source_text"], str(kept.get("source_name", "robot")), "robot")
    mimic = {joint.get("name") for joint in root.findall("joint") if joint.find("mimic") is not None}
    own = {*chain.own_joints}
    return [name for i, name in enumerate(chain.joint_names) if i not in own and name not in mimic]


def _urdf(model: DynamicsModel, links: PhysicalLinks) -> tuple[Written, str, tuple[str, ...]]:
    """Return what is written, the URDF's text, and notes on it."""
    kept = model.provenance
    from_file = kept.get("source_format") == "urdf" and {"source_text", "options"} <= set(kept)
    what = written(model, links, keep_frames=from_file)
    root, notes = urdf_with(what, kept) if from_file else (urdf_of(what), ())
    return what, as_text(root), (*notes, *calibrated_friction_notes(joint_friction(model)))


def _drive_notes(model: DynamicsModel, drives: np.ndarray, mjcf: Path | None) -> list[str]:
    if not drives.any():
        return []
    units = {0: "kg m^2", 1: "kg"}
    values = ", ".join(
        f"{shown(joint.name)} {drive:.4g} {units[joint.type.length_order]}"
        for joint, drive in zip(model.mechanism.joints, drives, strict=True)
        if drive
    )
    where = f"armature in {mjcf}" if mjcf else "in no file (--mjcf writes one with armature)"
    return [f"drive inertia, which a URDF cannot hold, is {where}: {values}"]


def _gravity_notes(what: Written) -> list[str]:
    notes = []
    if what.world is not None:
        notes.append("the base hangs on link 'world', turned so that gravity is along its -z")
    if np.abs(what.gravity - STANDARD).max() > GRAVITY_ROUNDING * abs(STANDARD[2]):
        notes.append(
            f"gravity is {exact(what.gravity)} m/s^2, which a URDF cannot hold: readers take {exact(STANDARD)}; set it there"
        )
    return notes
