"""Friction of a model that was calibrated from one log: Coulomb, viscous terms and a constant, per joint; where they were
fitted, Coulomb friction that differs between the directions and the Stribeck effect."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import frozen_array

Array = NDArray[np.float64]

MOST_TERMS = 8
"""Viscous terms of a joint: fits have one or two."""
LARGEST_EXPONENT = 8.0
ASYMMETRY = "coulomb_asymmetry"
STRIBECK = "stribeck_"
"""Before a Stribeck velocity in the name of a value."""
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
    kept = model.provenance.get("calibration")
    if not isinstance(kept, Mapping):
        return ()
    springs = len({str(row.get("spring")) for row in kept.get("springs", [])})
    joints = sum(row.get("name") == LOAD for row in kept.get("friction", []))
    by_load = f"friction that grows with the load, of {joints} joint(s)" if joints else ""
    return tuple(filter(None, (f"{springs} spring(s)" if springs else "", by_load)))


def viscous_name(exponent: float) -> str:
    """The name of the term |v|^exponent: viscous alone is the one that grows with the speed itself."""
    return "viscous" if exponent == 1.0 else f"viscous^{exponent:g}"


def with_names_of_exponents(calibration: Mapping[str, Any]) -> Mapping[str, Any]:
    """A calibration as model files hold it, its viscous terms called by their exponents. psdmc 0.1 called the first one
    viscous, whatever its exponent."""
    exponents, rows = calibration["prediction"].get("exponents", ()), calibration["friction"]
    if not exponents or viscous_name(exponents[0]) in {row["name"] for row in rows}:
        return calibration
    first = float(exponents[0])
    units = {"Nms/rad": f"Nm (s/rad)^{first:g}", "Ns/m": f"N (s/m)^{first:g}"}
    renamed = {"viscous": viscous_name(first), "viscous^1": "viscous"}
    found = [
        row | {"name": renamed[row["name"]], "unit": units.get(row["unit"], row["unit"])}
        if row["name"] in renamed
        else row
        for row in rows
    ]
    return {**calibration, "friction": found}


def linear_friction(model: DynamicsModel) -> LinearFriction:
    """The friction that the model's calibration found; InputError where it was not calibrated from plain logs, or what its
    file says of friction is damaged."""
    name = shown(model.mechanism.name)
    kept = model.provenance.get("calibration")
    if not isinstance(kept, Mapping):
        raise InputError(f"{name}: not calibrated: its friction is unknown", "run `psdmc calibrate` first")
    if kept.get("prediction", {}).get("law") != "linear":
        raise InputError(
            f"{name}: calibrated by a campaign: its friction is LuGre's, with a state",
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
        return replace(_read(kept, model.joint_names), beyond=beyond_friction(model))
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{name}: the friction in the model file is damaged: {error}", "calibrate again"
        ) from None


def _read(kept: Mapping[str, Any], joints: tuple[str, ...]) -> LinearFriction:
    values = {(row["joint"], row["name"]): _finite(row["value"], row["name"]) for row in kept["friction"]}
    law = kept["prediction"]
    exponents = tuple(_finite(d, "an exponent") for d in law["exponents"])
    speed = _finite(law["sign_speed"], "sign_speed")
    if not speed > 0.0 or len(exponents) > MOST_TERMS:
        raise ValueError(f"sign_speed {speed:g}, {len(exponents)} exponents")
    if any(not 0.0 <= d <= LARGEST_EXPONENT for d in exponents):
        raise ValueError(f"exponents {exponents}")
    names = [viscous_name(d) for d in exponents]
    return LinearFriction(
        coulomb=np.array([values[joint, "coulomb"] for joint in joints]),
        viscous=np.array([[values[joint, name] for name in names] for joint in joints]).reshape(
            len(joints), -1
        ),
        offset=np.array([values.get((joint, "offset"), 0.0) for joint in joints]),
        exponents=exponents,
        sign_speed=speed,
        **_further(values, joints),
    )


def _further(values: Mapping[tuple[str, str], float], joints: tuple[str, ...]) -> dict[str, Any]:
    """Asymmetry and the Stribeck effect, which only some joints may have; nothing where none has."""
    names = {name for _, name in values}
    found: dict[str, Any] = {}
    if ASYMMETRY in names:
        found["asymmetry"] = np.array([values.get((joint, ASYMMETRY), 0.0) for joint in joints])
    speeds = sorted(_stribeck_speed(name) for name in names if str(name).startswith(STRIBECK))
    if len(speeds) > MOST_TERMS:
        raise ValueError(f"{len(speeds)} Stribeck velocities")
    if speeds:
        peaks = [[values.get((joint, f"{STRIBECK}{v!r}"), 0.0) for v in speeds] for joint in joints]
        found |= {"stribeck": np.array(peaks), "stribeck_speeds": tuple(speeds)}
    return found


def _stribeck_speed(name: str) -> float:
    speed = float(name.removeprefix(STRIBECK))
    if not 0.0 < speed < math.inf or f"{STRIBECK}{speed!r}" != name:
        raise ValueError(f"a Stribeck velocity is {shown(name)}")
    return speed


def _finite(value: object, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"{what} is {shown(value)}")
    return float(value)
