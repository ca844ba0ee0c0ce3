"""A load on a robot: the torques that a known load causes along a log, and joints that it does not load. A known load is
read from four numbers or from a file. The file is that of an identified load, with standard deviations and verdict."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from psdmc.calibration.campaign_file import LARGEST_ARM, LARGEST_MASS, SMALLEST_MASS
from psdmc.calibration.logs.filter import stretches
from psdmc.calibration.logs.log import AnyLog, Array
from psdmc.calibration.logs.log_checks import CheckOptions
from psdmc.calibration.logs.low_pass import FilterOptions
from psdmc.calibration.logs.smoothed_rows import smoothed_rows
from psdmc.calibration.logs.toml_tables import read_toml
from psdmc.dynamics.frames import frames_of
from psdmc.dynamics.kinematics import forward_kinematics
from psdmc.errors import InputError
from psdmc.files import write_whole
from psdmc.model import evaluate
from psdmc.model.bodies import body_parameters, carrying_frame, load_parameters
from psdmc.model.calibrated import Verdict
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.inertia import INERTIA_NAMES, inertia_matrix, six_of
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, Mechanism

ALONG = 0.02
"""Sine of the angle between an axis and gravity below which the axis counts as along it, or for a sliding one across it:
one degree."""
SMALL_ARM = 0.005
"""m, from an axis to a load's centre of mass: below it the load counts as hanging on the axis. A hand cannot mount it
truer."""


@dataclass(frozen=True, slots=True, eq=False)
class KnownLoad:
    """A body of known mass that is fixed to a frame of a robot.

    mass     kg
    com      (3,) m, centre of mass in the frame
    inertia  (6,) kg m^2 about the centre of mass (xx, xy, yy, xz, yz, zz); zeros: a point mass
    frame    name of the frame; None: the tip
    """

    mass: float
    com: Array
    inertia: Array
    frame: str | None = None

    @property
    def is_point(self) -> bool:
        return not np.any(self.inertia)

    def added_to(self, model: DynamicsModel) -> DynamicsModel:
        """Return the model with this load. Raises InputError if no real body has it, or the model lacks the frame."""
        return model.with_payload(self.mass, self.com, inertia_matrix(self.inertia), self.frame)

    def parameters(self, chain: Mechanism) -> Array:
        """Return the standard parameters (11 n,) of a robot with n joints whose only body is the load. Each joint has
        eleven: mass, first moments, inertia, drive inertia. Raises InputError if no real body has the mass and inertia
        of the load."""
        place = carrying_frame(chain, self.frame)
        alone = np.zeros(PARAMETERS_PER_LINK * len(chain))
        alone[body_parameters(place.joint)] = load_parameters(
            chain, self.mass, self.com, inertia_matrix(self.inertia), self.frame
        )
        return alone

    def torques(
        self, chain: Mechanism, logs: Sequence[AnyLog], options: FilterOptions, check: CheckOptions, rows: int
    ) -> Array:
        """Return the joint torques (N, n joints), N m, that the load causes at N samples of checked logs. The samples
        are those that count as independent, and the torques are filtered as the measured torques are."""
        alone = self.parameters(chain)
        found = []
        for log in logs:
            for stretch in stretches(log, options, check, rows):
                states = stretch.states

                def needed(own: slice, states=states) -> Array:  # type: ignore[no-untyped-def]
                    return evaluate.torques(chain, alone, [states.q[own], states.qd[own], states.qdd[own]])

                found.append(smoothed_rows(states, stretch.at, needed))
        return np.concatenate(found)


def unreached(chain: Mechanism, q: Array, load: KnownLoad) -> dict[str, str]:
    """Return, by joint name, why the weight of a load has (nearly) no effect on the joint in all poses q (N poses, n
    joints). An example is a joint axis along gravity. Joints on which the weight acts are left out."""
    down = chain.gravity / (np.linalg.norm(chain.gravity) or 1.0)
    weight = load.mass * float(np.linalg.norm(chain.gravity))
    still = np.zeros_like(q)
    felt = np.abs(evaluate.torques(chain, load.parameters(chain), [q, still, still])).max(axis=0)
    axes = _axes(chain, q)
    reasons = {}
    for k, joint in enumerate(chain.joints):
        slides = bool(joint.type.length_order)
        if felt[k] >= (ALONG if slides else SMALL_ARM) * weight > 0.0:
            continue
        across = np.linalg.norm(np.cross(axes[k], down), axis=-1).max()
        if not weight:
            reasons[joint.name] = NO_GRAVITY
        elif slides:
            reasons[joint.name] = LEVEL
        else:
            reasons[joint.name] = UPRIGHT if across < ALONG else ON_AXIS
    return reasons


def _axes(chain: Mechanism, q: Array) -> Array:
    """(n, N, 3) the joints' axes in the base frame."""
    frames = frames_of(chain)
    states = [q[:, k] for k in range(len(chain))]
    placed = forward_kinematics(frames, states)
    shape = (len(q),)
    return np.array(
        [[np.broadcast_to(rotation[r][2], shape) for r in range(3)] for rotation, _ in placed]
    ).transpose(0, 2, 1)


NO_GRAVITY = "there is no gravity"
LEVEL = "it slides level"
UPRIGHT = "its axis is along gravity"
ON_AXIS = "the load hangs on its axis"
REMEDIES = {
    NO_GRAVITY: "accelerate it with the load far out",
    LEVEL: "accelerate it with the load on, or tilt the base",
    UPRIGHT: "accelerate it with the load far out, or tilt the base",
    ON_AXIS: "mount the load off that axis",
}
"""What to do where the weight is not felt."""


WHAT = "a load's file (.toml), as psdmc payload writes one"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PayloadFound(KnownLoad):
    """A load that was identified from logs. A standard deviation is infinite if the logs do not determine the number by
    itself.

    visible  what the logs show of each of the ten linear parameters, in words
    notes    notes for the user, one sentence each
    """

    robot: str
    frame: str
    mass_std: float
    com_std: Array
    inertia_std: Array
    visible: Mapping[str, str]
    verdict: Verdict
    notes: tuple[str, ...]

    def lines(self) -> list[str]:
        """Return the load as lines of text: the arguments of R_add_payload with standard deviations."""
        rows = [f"mass     {_with_std(self.mass, self.mass_std)} kg"]
        rows += [
            f"com {axis}    {_with_std(value, std)} m"
            for axis, value, std in zip("xyz", self.com, self.com_std, strict=True)
        ]
        return rows + [
            f"I{name}      {_with_std(value, std)} kg m^2 about the centre of mass"
            for name, value, std in zip(INERTIA_NAMES, self.inertia, self.inertia_std, strict=True)
        ]

    def as_toml(self) -> str:
        """Return the text of the load file (TOML). A number that the logs do not determine has the deviation inf."""
        return "\n".join(
            [
                "# A load that psdmc payload identified. Lengths in m in the frame, inertia about the centre of mass:",
                "# Ixx Ixy Iyy Ixz Iyz Izz, kg m^2, the order of R_add_payload. inf: not fixed by the logs alone.",
                f"frame = {_text(self.frame)}",
                f"robot = {_text(self.robot)}",
                f"verdict = {_text(self.verdict.word)}",
                f"mass = {self.mass!r}",
                f"com = {_list(self.com)}",
                f"inertia = {_list(self.inertia)}",
                "",
                "[std]",
                f"mass = {self.mass_std!r}",
                f"com = {_list(self.com_std)}",
                f"inertia = {_list(self.inertia_std)}",
                "",
            ]
        )

    def save(self, path: str | Path) -> None:
        """Write the load file, as a whole or not at all."""
        write_whole(path, self.as_toml())


def read_load(path: str | Path) -> KnownLoad:
    """Return a load from its file. Raises InputError with what is wrong in the file."""
    content = read_toml(Path(path), WHAT)
    numbers = {
        name: _numbers(content.get(name), count) for name, count in (("mass", 1), ("com", 3), ("inertia", 6))
    }
    frame = content.get("frame")
    missing = [name for name, value in numbers.items() if value is None]
    if missing or not isinstance(frame, str):
        wrong = ", ".join([*missing, *([] if isinstance(frame, str) else ["frame"])])
        raise InputError(f"{path}: {wrong}: missing or no such numbers", f"expected {WHAT}")
    mass, com, inertia = (np.asarray(value) for value in numbers.values())
    return KnownLoad(float(mass[0]), com, inertia, frame)


def _numbers(value: Any, count: int) -> Array | None:
    values = [value] if count == 1 else value
    if not isinstance(values, list) or len(values) != count:
        return None
    if not all(isinstance(v, int | float) and not isinstance(v, bool) and math.isfinite(v) for v in values):
        return None
    return np.array(values, dtype=np.float64)


def load_numbers(load: Array) -> Array:
    """Return mass, centre of mass and inertia about the centre of mass (10,) of a load from its ten linear parameters.

    The linear parameters are mass, first moments and inertia about the frame's origin. The function is used to convert
    standard deviations.
    """
    mass, h = float(load[0]), load[1:4]
    com = h / mass
    inertia = inertia_matrix(load[4:10]) - mass * (com @ com * np.eye(3) - np.outer(com, com))
    return np.concatenate([[mass], com, six_of(inertia)])


def _with_std(value: float, std: float) -> str:
    return f"{value:9.5g} +- {std:.2g}" if math.isfinite(std) else f"{value:9.5g}, not fixed by the logs"


def _list(values: Array) -> str:
    return "[" + ", ".join(repr(float(v)) for v in values) + "]"


def _text(text: str) -> str:
    """A TOML basic string, whatever the name holds."""
    escaped = "".join(
        f"\\u{ord(c):04x}" if ord(c) < 0x20 or ord(c) == 0x7F else f"\\{c}" if c in '"\\' else c for c in text
    )
    return f'"{escaped}"'


HINT = "write MASS,X,Y,Z: kg, and m to the centre of mass in the tip's frame; or a load's file (.toml) with its inertia"


def given_load(source: str | Path | Sequence[float]) -> KnownLoad:
    """Return the known load from text 'MASS,X,Y,Z', from four numbers, or from a file that `psdmc payload` wrote. The
    numbers are the mass (kg) and the centre of mass (m, in the tip frame) of a point mass. Raises InputError if the
    load is wrong."""
    if isinstance(source, Path) or (isinstance(source, str) and source.lower().endswith(".toml")):
        return read_load(source)
    words = source.split(",") if isinstance(source, str) else source
    try:
        numbers = [float(word) for word in words]
    except (TypeError, ValueError):
        raise InputError(f"load: {source!r} is no four numbers", HINT) from None
    if len(numbers) != 4 or not all(map(math.isfinite, numbers)):
        raise InputError(f"load: {source!r} is no four numbers", HINT)
    mass, *com = numbers
    if not SMALLEST_MASS <= mass <= LARGEST_MASS or max(map(abs, com)) > LARGEST_ARM:
        raise InputError(
            f"load: {mass:g} kg at {com}: expected {SMALLEST_MASS:g} to {LARGEST_MASS:g} kg within {LARGEST_ARM:g} m",
            HINT,
        )
    return KnownLoad(mass, np.array(com), np.zeros(6))
