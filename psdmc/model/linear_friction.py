"""Friction of a calibrated model, which its calibration found in plain logs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from psdmc.errors import InputError
from psdmc.friction.joints import Friction, found_friction, found_laws
from psdmc.friction.terms import named
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.limits import shown


def beyond_friction(model: DynamicsModel) -> tuple[str, ...]:
    """What a calibration found that neither rigid bodies nor `linear_friction` have, in words without names; none where
    the model was not calibrated."""
    kept = model.provenance.get("calibration")
    if not isinstance(kept, Mapping):
        return ()
    springs = len({str(row.get("spring")) for row in kept.get("springs", [])})
    joints = len({row.get("joint") for row in kept.get("friction", []) if _by_load(kept, row)})
    by_load = f"friction that grows with the load, of {joints} joint(s)" if joints else ""
    return tuple(filter(None, (f"{springs} spring(s)" if springs else "", by_load)))


def _by_load(kept: Mapping[str, Any], row: Mapping[str, Any]) -> bool:
    """Whether a value is of a law that depends on the torque of the rigid bodies."""
    try:
        found = named(str(row.get("name")), found_laws(kept.get("prediction", {})))
    except ValueError:
        return False  # damaged: `linear_friction` says so
    return found is not None and "load" in found[0].reads


def linear_friction(model: DynamicsModel) -> Friction:
    """The friction that the model's calibration found; InputError where it was not calibrated from plain logs, or what its
    file says of friction is damaged."""
    name = shown(model.mechanism.name)
    kept = model.provenance.get("calibration")
    if not isinstance(kept, Mapping):
        raise InputError(f"{name}: not calibrated: its friction is unknown", "run `psdmc calibrate` first")
    if kept.get("prediction", {}).get("law") != "linear":
        raise InputError(
            f"{name}: calibrated by a campaign: its friction has a state",
            "`psdmc calibrate --actuators DIR` writes it as C",
        )
    if kept["prediction"].get("coupling"):
        raise InputError(
            f"{name}: calibrated with a coupling: its friction is of motors that drive several joints together, which C "
            "does not have",
            "leave --friction out; `psdmc show` has its numbers",
        )
    if model.mechanism.has_followers:
        raise InputError(f"{name}: friction is of joints that follow no other", "lock those that do")
    try:
        found = found_friction(kept, model.joint_names)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{name}: the friction in the model file is damaged: {error}", "calibrate again"
        ) from None
    return replace(found, beyond=beyond_friction(model))
