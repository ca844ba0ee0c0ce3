"""Limits of joints that a user gives, in place of or beside those of the robot's file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from psdmc.calibration.motions.excite import require_limits
from psdmc.errors import InputError
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import Joint, Limits, Mechanism

LARGEST_LIMIT = 1e6
"""rad/s^2, m/s^2, rad/s, N m: above any joint's."""


@dataclass(frozen=True, slots=True)
class GivenLimits:
    """By joint name, SI. A range may only be narrower than the file's; a speed, too.

    ranges         lowest and highest position, rad (m)
    speeds         rad/s (m/s)
    accelerations  rad/s^2 (m/s^2)
    acceleration   of the joints that have none otherwise; None: refuse them
    efforts        N m (N)
    """

    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    speeds: Mapping[str, float] = field(default_factory=dict)
    accelerations: Mapping[str, float] = field(default_factory=dict)
    acceleration: float | None = None
    efforts: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        sizes = {
            "acceleration": [self.acceleration] if self.acceleration is not None else [],
            "speed": self.speeds.values(),
            "accelerations": self.accelerations.values(),
            "effort": self.efforts.values(),
        }
        for what, values in sizes.items():
            _require_sizes(what, values)

    @property
    def names(self) -> tuple[str, ...]:
        named = (self.ranges, self.speeds, self.accelerations, self.efforts)
        return tuple(dict.fromkeys(name for given in named for name in given))


def _require_sizes(what: str, values: Iterable[float]) -> None:
    for value in values:
        if not 0 < value <= LARGEST_LIMIT:
            raise InputError(
                f"{what} is {value:g}, expected more than 0, at most {LARGEST_LIMIT:g}",
                "in rad/s^2, rad/s or N m; m/s^2, m/s or N where a joint slides",
            )


def bounded(chain: Mechanism, given: GivenLimits) -> Mechanism:
    """The chain with the given limits, and half a turn either way for joints that turn freely.

    InputError where a limit is still missing, a range is none or beyond the file's, or a joint does not exist.
    """
    unknown = [shown(name) for name in given.names if name not in chain.joint_names]
    if unknown:
        known = ", ".join(map(shown, chain.joint_names))
        raise InputError(
            f"limits for joint(s) {', '.join(unknown)}, which the model does not have", f"it has {known}"
        )
    joints = tuple(replace(joint, limits=_limits(joint, given)) for joint in chain.joints)
    require_limits(joints)
    return replace(chain, joints=joints)


def _limits(joint: Joint, given: GivenLimits) -> Limits:
    limits, name = joint.limits, joint.name
    if name in given.ranges:
        limits = _ranged(joint, *given.ranges[name])
    elif joint.type.comes_round and not np.isfinite([limits.lower, limits.upper]).any():
        limits = replace(limits, lower=-joint.type.free_range, upper=joint.type.free_range)
    if name in given.speeds:
        if given.speeds[name] > limits.speed:
            raise InputError(
                f"joint {shown(name)}: speed {given.speeds[name]:g}, the file's limit is {limits.speed:g}",
                "give a smaller --speed",
            )
        limits = replace(limits, speed=given.speeds[name])
    if name in given.accelerations:
        limits = replace(limits, acceleration=given.accelerations[name])
    elif not np.isfinite(limits.acceleration) and given.acceleration is not None:
        limits = replace(limits, acceleration=given.acceleration)
    return replace(limits, effort=given.efforts.get(name, limits.effort))


def _ranged(joint: Joint, low: float, high: float) -> Limits:
    limits = joint.limits
    if not (np.isfinite([low, high]).all() and low < high):
        raise InputError(
            f"joint {shown(joint.name)}: range {low:g} to {high:g} is none",
            "give --range JOINT=LOW:HIGH, rad (m)",
        )
    if low < limits.lower or high > limits.upper:
        raise InputError(
            f"joint {shown(joint.name)}: range {low:g} to {high:g} exceeds the file's, {limits.lower:.4g} to"
            f" {limits.upper:.4g}",
            "ranges are in rad (m), and within the file's",
        )
    return replace(limits, lower=low, upper=high)
