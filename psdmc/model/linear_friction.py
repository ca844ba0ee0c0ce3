"""Friction of a model that was calibrated from one log: Coulomb, viscous terms and a constant, per joint; where they were
fitted, Coulomb friction that differs between the directions and the Stribeck effect."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from psdmc.errors import InputError
from psdmc.model.calibrated import Calibrated, Prediction, by_joint, viscous_name
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import frozen_array

Array = NDArray[np.float64]

MOST_TERMS = 8
"""Viscous terms of a joint: fits have one or two."""
LARGEST_EXPONENT = 8.0
ASYMMETRY = "coulomb_asymmetry"
LOAD = "load_friction"


@dataclass(frozen=True, slots=True, eq=False)
class LinearFriction:
    """Friction torque of n joints, with s = tanh(v / sign_speed):

    s (coulomb + sum over k of viscous[k] |v|^exponents[k] + sum over k of stribeck[k] exp(-(v / stribeck_speeds[k])^2))
    + |s| asymmetry + offset

    coulomb, offset  (n,)    N m (N)
    viscous          (n, k)  N m (s/rad)^d
    exponents        k of them, not negative
    sign_speed       rad/s (m/s) over which friction changes sign, so that it is smooth
    asymmetry        (n,)    N m (N); empty where no joint has one
    stribeck         (n, k)  N m (N), at k stribeck_speeds, rad/s (m/s); both empty where no joint has it
    beyond           what else the calibration found beside rigid bodies, in words without names
    """

    coulomb: Array
    viscous: Array
    offset: Array
    exponents: tuple[float, ...]
    sign_speed: float
    asymmetry: Array = field(default_factory=lambda: np.zeros(0))
    stribeck: Array = field(default_factory=lambda: np.zeros((0, 0)))
    stribeck_speeds: tuple[float, ...] = ()
    beyond: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.coulomb)
        object.__setattr__(self, "coulomb", frozen_array(self.coulomb, (n,), "coulomb"))
        object.__setattr__(self, "offset", frozen_array(self.offset, (n,), "offset"))
        shape = (n, len(self.exponents))
        object.__setattr__(self, "viscous", frozen_array(self.viscous, shape, "viscous"))
        uneven = (n if len(self.asymmetry) else 0,)
        object.__setattr__(self, "asymmetry", frozen_array(self.asymmetry, uneven, "asymmetry"))
        peaks = (n, len(self.stribeck_speeds)) if self.stribeck_speeds else (0, 0)
        object.__setattr__(self, "stribeck", frozen_array(self.stribeck, peaks, "stribeck"))

    def torque(self, qd: ArrayLike) -> Array:
        """(..., n) N m (N) at speeds (..., n), to be added to what the rigid bodies take."""
        v = np.asarray(qd, dtype=np.float64)
        size = self.coulomb + sum(self.viscous[:, k] * np.abs(v) ** d for k, d in enumerate(self.exponents))
        for k, speed in enumerate(self.stribeck_speeds):
            size = size + self.stribeck[:, k] * np.exp(-((v / speed) ** 2))
        sign = np.tanh(v / self.sign_speed)
        uneven = np.abs(sign) * self.asymmetry if len(self.asymmetry) else 0.0
        return np.asarray(sign * size + uneven + self.offset)


def beyond_friction(model: DynamicsModel) -> tuple[str, ...]:
    """What a calibration found that neither rigid bodies nor `linear_friction` have, in words without names; none where
    the model was not calibrated."""
    found = model.calibrated
    if found is None:
        return ()
    springs = len({row.joint for row in found.springs})
    joints = sum(row.name == LOAD for row in found.friction)
    by_load = f"friction that grows with the load, of {joints} joint(s)" if joints else ""
    return tuple(filter(None, (f"{springs} spring(s)" if springs else "", by_load)))


def linear_friction(model: DynamicsModel) -> LinearFriction:
    """The friction that the model's calibration found; InputError where it was not calibrated from plain logs, or what its
    file says of friction is damaged."""
    name = shown(model.mechanism.name)
    found = model.calibrated
    if found is None:
        raise InputError(f"{name}: not calibrated: its friction is unknown", "run `psdmc calibrate` first")
    law = found.prediction
    if law is None or law.law != "linear":
        raise InputError(
            f"{name}: calibrated by a campaign: its friction is LuGre's, with a state",
            "`psdmc calibrate --actuators DIR` writes it as C",
        )
    if law.coupling:
        raise InputError(
            f"{name}: calibrated with a coupling: its friction is of motors that drive several joints together, which C "
            "does not have",
            "leave --friction out; `psdmc show` has its numbers",
        )
    if model.mechanism.has_followers:
        raise InputError(f"{name}: friction is of joints that follow no other", "lock those that do")
    try:
        return replace(_read(found, law, model.joint_names), beyond=beyond_friction(model))
    except (KeyError, ValueError) as error:
        raise InputError(
            f"{name}: the friction in the model file is damaged: {error}", "calibrate again"
        ) from None


def _read(found: Calibrated, law: Prediction, joints: tuple[str, ...]) -> LinearFriction:
    values = by_joint(found.friction)
    if not all(map(math.isfinite, values.values())):
        raise ValueError("a value is missing")
    if not law.sign_speed > 0.0 or len(law.exponents) > MOST_TERMS:
        raise ValueError(f"sign_speed {law.sign_speed:g}, {len(law.exponents)} exponents")
    if any(not 0.0 <= d <= LARGEST_EXPONENT for d in law.exponents):
        raise ValueError(f"exponents {law.exponents}")
    names = [viscous_name(d) for d in law.exponents]
    return LinearFriction(
        coulomb=np.array([values[joint, "coulomb"] for joint in joints]),
        viscous=np.array([[values[joint, name] for name in names] for joint in joints]).reshape(
            len(joints), -1
        ),
        offset=np.array([values.get((joint, "offset"), 0.0) for joint in joints]),
        exponents=law.exponents,
        sign_speed=law.sign_speed,
        **_further(found, joints),
    )


def _further(found: Calibrated, joints: tuple[str, ...]) -> dict[str, Any]:
    """Asymmetry and the Stribeck effect, which only some joints may have; nothing where none has."""
    values = by_joint(found.friction)
    further: dict[str, Any] = {}
    if any(row.name == ASYMMETRY for row in found.friction):
        further["asymmetry"] = np.array([values.get((joint, ASYMMETRY), 0.0) for joint in joints])
    names = {row.parameters["speed"]: row.name for row in found.friction if "speed" in row.parameters}
    if len(names) > MOST_TERMS:
        raise ValueError(f"{len(names)} Stribeck velocities")
    if names:
        peaks = [[values.get((joint, names[v]), 0.0) for v in sorted(names)] for joint in joints]
        further |= {"stribeck": np.array(peaks), "stribeck_speeds": tuple(sorted(names))}
    return further
