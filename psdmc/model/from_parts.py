"""Construction of a model from the arrays and the manifest (a JSON text) of a file. All values are checked, because the
file may be forged.

The checks cover everything that other parts of psdmc assume: types, shapes, ranges and finite numbers. Base parameters
must also have pivots within the standard parameters that the robot's assumptions allow.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.model import json_values as json
from psdmc.model.calibrated import Calibrated
from psdmc.model.calibrated_json import from_json
from psdmc.model.chain_json import chain_from_json
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.expansion import BLOCKS, Entries, Expansion
from psdmc.robot.load_options import LoadOptions
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, Mechanism
from psdmc.robot.zeros import leading_rows

Arrays = Mapping[str, NDArray[Any]]

KINDS = {
    "E": (np.uint8, 2),
    "theta_b": (np.float64, 1),
    "P_joint": (np.int32, 1),
    "P_row": (np.int32, 1),
    "P_col": (np.int32, 1),
    "P_value": (np.float64, 1),
    "B": (np.float64, 2),
}
"""Type and axes of each array."""

MOST_ROWS = 1_000_000
"""Largest number of rows of a table in the provenance."""


HIGHEST_POWER = 2
"""Of a factor of a monomial: torques are quadratic in rates, and in each joint's sine and cosine."""


def model_from(arrays: Arrays, manifest: Mapping[str, Any]) -> DynamicsModel:
    """Return the model from the arrays and the manifest (a JSON text) of a file. Raises ValueError that says which part
    is wrong, what was found and what was expected."""
    _check_kinds(arrays)
    chain = chain_from_json(json.part(manifest, "chain", "the manifest"))
    l = arrays["B"].shape[0]
    is_expanded = json.flag(json.part(manifest, "expanded", "the manifest"), "'expanded'")
    is_known = json.flag(json.part(manifest, "theta_b_known", "the manifest"), "'theta_b_known'")
    certificate = json.part(manifest, "certificate", "the manifest")
    _check_base_parameters(arrays, chain, l, is_known)
    if is_expanded and not all(kind.about_z for kind in chain.types):
        raise ValueError("E and P are of joints of one coordinate, and a joint has several")
    return DynamicsModel(
        expansion=_expansion(arrays, chain.nv, l) if is_expanded else None,
        theta_b=arrays["theta_b"] if is_known else None,
        B=arrays["B"],
        mechanism=chain,
        certificate=json.numbers(certificate, "the certificate", chain.nv),
        provenance=_provenance(json.part(manifest, "provenance", "the manifest"), chain),
        calibrated=_calibrated(manifest, chain),
    )


def _calibrated(manifest: Mapping[str, Any], chain: Mechanism) -> Calibrated | None:
    """What a calibration found; ValueError unless its joints are the chain's."""
    if "calibration" not in manifest:
        return None
    found = from_json(manifest["calibration"])
    joints = {joint.name for joint in chain.joints}
    foreign = [row.joint for row in (*found.motors, *found.friction) if row.joint not in joints]
    if foreign:
        raise ValueError(f"the calibration has joint {foreign[0]!r}, which the chain has not")
    return found


def _check_kinds(arrays: Arrays) -> None:
    for name, (dtype, axes) in KINDS.items():
        found = arrays[name]
        if found.dtype != dtype or found.ndim != axes:
            raise ValueError(
                f"{name} has type {found.dtype} and {found.ndim} axes, expected {np.dtype(dtype)} and {axes}"
            )


def _check_base_parameters(arrays: Arrays, chain: Mechanism, l: int, is_known: bool) -> None:
    B, span = arrays["B"], chain.parameter_span
    if B.shape[1] != PARAMETERS_PER_LINK * len(chain) or l > B.shape[1]:
        raise ValueError(f"B has shape {B.shape} for {len(chain)} joints")
    if not np.isfinite(B).all() or (is_known and not np.isfinite(arrays["theta_b"]).all()):
        raise ValueError("B or theta_b is not finite")
    alone = (B != 0.0).sum(axis=0) == 1
    first = np.argmax(alone & (B == 1.0), axis=1) if B.shape[1] else np.zeros(0, int)
    if not (alone[first] & (B[np.arange(l), first] == 1.0)).all():
        raise ValueError("a base parameter has no standard parameter of its own")
    leads = leading_rows(span) if span.size else np.zeros(0, int)
    if not np.isin(first, leads).all():
        raise ValueError("a base parameter lies outside the parameters' span")


def _exponents(E: NDArray[Any], n: int) -> NDArray[np.uint8]:
    if E.shape[0] != BLOCKS * n:
        raise ValueError(f"E has {E.shape[0]} rows for {n} joints")
    if E.size and E.max() > HIGHEST_POWER:
        raise ValueError(f"E has exponents up to {E.max()}, expected {HIGHEST_POWER} at most")
    return E


def _expansion(arrays: Arrays, n: int, l: int) -> Expansion:
    shape = (arrays["E"].shape[1], l)
    ranges = {"P_joint": n, "P_row": shape[0], "P_col": shape[1]}
    values = arrays["P_value"]
    for name, count in ranges.items():
        if arrays[name].shape != values.shape:
            raise ValueError(f"{name} has {len(arrays[name])} entries, P_value {len(values)}")
        if values.size and not 0 <= arrays[name].min() <= arrays[name].max() < count:
            raise ValueError(f"{name} has entries outside 0 to {count - 1}")
    if not np.isfinite(values).all():
        raise ValueError("P is not finite")
    if (np.diff(arrays["P_joint"]) < 0).any():
        raise ValueError("P_joint is not in order")
    entries = Entries(arrays["P_joint"], arrays["P_row"], arrays["P_col"], values)
    return Expansion(_exponents(arrays["E"], n), entries, l)


def _provenance(value: object, chain: Mechanism) -> dict[str, Any]:
    """The model's origin, checked as far as psdmc reads it again."""
    found = json.record(value, "the provenance")
    for name in ("source_text", "source_sha256", "source_name"):
        if found.get(name) is not None:
            json.text(found[name], f"the provenance's {name}")
    if found.get("source_format", "urdf") not in ("urdf", "dh"):
        raise ValueError("the provenance's source_format is neither urdf nor dh")
    if "options" in found:
        _check_options(json.record(found["options"], "the provenance's options"), chain)
    for snap in json.entries(found.get("snapped", []), "the provenance's snapped", MOST_ROWS):
        json.text(json.part(snap, "where", "a snapped rotation"), "a snapped rotation's place")
        json.number(json.part(snap, "angle_rad", "a snapped rotation"), "a snapped rotation's angle")
    if found.get("snap_torque_change") is not None:
        json.numbers(found["snap_torque_change"], "the provenance's snap_torque_change", chain.nv)
    return found


def _check_options(options: dict[str, Any], chain: Mechanism) -> None:
    """ValueError unless these are keyword arguments of load_robot, of kinds that it takes or refuses with a message."""
    foreign = [name for name in options if name not in {field.name for field in fields(LoadOptions)}]
    if foreign:
        raise ValueError(f"the provenance has an option '{foreign[0]}'")
    for name in ("base", "tip", "root"):
        if options.get(name) is not None:
            json.text(options[name], f"the option {name}")
    if options.get("gravity") is not None:
        json.numbers(options["gravity"], "the option gravity", 3)
    if not isinstance(options.get("drive_inertia", False), bool):
        driven = sum(kind.about_z for kind in chain.types)
        json.numbers(options["drive_inertia"], "the option drive_inertia", driven)
    for statement in json.entries(options.get("assume_zero", []), "the option assume_zero", MOST_ROWS):
        json.text(statement, "an entry of the option assume_zero")
    json.number(options.get("snap", 0.0), "the option snap")
    for table in json.entries(options.get("loops", []), "the option loops", MOST_ROWS):
        json.record(table, "an entry of the option loops")
    for option in ("frames", "contacts"):
        for name in json.entries(options.get(option, []), f"the option {option}", MOST_ROWS):
            json.text(name, f"the option {option}")
    for value in json.record(options.get("lock", {}), "the option lock").values():
        json.number(value, "an entry of the option lock")
    for text in json.record(options.get("xacro_args", {}), "the option xacro_args").values():
        json.text(text, "an entry of the option xacro_args")
    json.flag(options.get("floating", False), "the option floating")
    if options.get("tool") is not None:
        json.numbers(options["tool"], "the option tool", 6)
