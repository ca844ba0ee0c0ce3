"""Robot files, alone and with options: read; now and then derived, checked, and held against Pinocchio's own reading."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from limits import CHECK_SECONDS, limited_time
from mutate_options import robot_and_options
from oracle import torque_error
from oracle_mjcf import mujoco_error
from outcome import BrokenRule

from psdmc.derivation.derive import derive_model, provenance_of
from psdmc.errors import DerivationError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.load import LoadedRobot, SourceFormat, load_robot
from psdmc.verification.check import check_model

MOST_EXPANDED = 4
"""joints; beyond, E and P are left out: they take seconds"""

TORQUE_LIMIT = 1e-8
"""Share of the largest torque, between psdmc without snapping and Pinocchio."""


def urdf(data: bytes, folder: Path, deep: bool) -> None:
    _robot(data, folder / "robot.urdf", "urdf", deep, {})


def dh(data: bytes, folder: Path, deep: bool) -> None:
    _robot(data, folder / "robot.toml", "dh", deep, {})


def mjcf(data: bytes, folder: Path, deep: bool) -> None:
    """As MuJoCo compiles it, held against MuJoCo's own torques, and as the URDF that psdmc keeps of it."""
    file = folder / "robot.xml"
    file.write_bytes(data)
    loaded = load_robot(file)
    if deep:
        _derived(loaded, "urdf")
        error = mujoco_error(file, _model(loaded.unsnapped() if loaded.snap_report else loaded))
        if error is not None and not error < TORQUE_LIMIT:
            raise BrokenRule(
                "WrongTorque", "psdmc/robot/mjcf/to_urdf.py", f"off MuJoCo by {error:.2g} of the largest"
            )


def with_options(data: bytes, folder: Path, deep: bool) -> None:
    """The keyword arguments of load_robot, of any JSON values, and the robot that they are for."""
    given = robot_and_options(data)
    if given is None:
        return
    text, options = given
    source_format: SourceFormat = "urdf" if text.lstrip().startswith("<") else "dh"
    suffix = "urdf" if source_format == "urdf" else "toml"
    robot = text.encode(errors="surrogatepass")
    _robot(robot, folder / f"robot.{suffix}", source_format, deep, options)


def _robot(data: bytes, file: Path, source_format: SourceFormat, deep: bool, options: dict[str, Any]) -> None:
    file.write_bytes(data)
    loaded = load_robot(file, **options)
    if deep:
        _derived(loaded, source_format)


def _derived(loaded: LoadedRobot, source_format: SourceFormat) -> None:
    """The model passes its own check; without snapping its torques are Pinocchio's."""
    model = _model(loaded)
    with limited_time(CHECK_SECONDS):
        rows = check_model(model)
    failed = [f"{row.name}: {row.error:.2g}" for row in rows if not row.passed]
    if failed:
        raise BrokenRule("CheckFails", "psdmc/verification/check.py", "; ".join(failed))
    if loaded.snap_report:
        loaded = loaded.unsnapped()
        model = _model(loaded)
    error = torque_error(loaded.source_text, source_format, model, loaded.options)
    if error is not None and not error < TORQUE_LIMIT:
        raise BrokenRule(
            "WrongTorque", "psdmc/derivation/derive.py", f"off Pinocchio by {error:.2g} of the largest"
        )


def _model(loaded: LoadedRobot) -> DynamicsModel:
    """Expanded where it is small; a refusal to expand is followed by --no-expand, as its hint says."""
    kept = provenance_of(loaded)
    if len(loaded.chain) <= MOST_EXPANDED:
        try:
            return derive_model(loaded.mechanism, provenance=kept)
        except DerivationError:
            pass
    return derive_model(loaded.mechanism, expand=False, provenance=kept)
