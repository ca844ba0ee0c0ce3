"""Limits of a planned motion: joint limits, torque limits, and collisions. The first motion that keeps them is
selected from several, which use smaller and smaller parts of the joints' ranges."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from psdmc.calibration.identify.predictor import Regressor, payload_torque
from psdmc.calibration.identify.steps import Load
from psdmc.calibration.logs.log import Array
from psdmc.calibration.motions.clearance import Clearance, FloorPoints
from psdmc.calibration.motions.criterion import SPEED_STEP
from psdmc.calibration.motions.trajectory import Trajectory, limit_faults
from psdmc.errors import InputError
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import Joint, Limits, Mechanism

LOOKED_AT = 0.01
"""s between the rows whose torque is computed: a hundred per second, ten per period of the fastest sine."""


@dataclass(frozen=True, slots=True, eq=False)
class Allowed:
    """Limits on planned motions of a robot.

    chain          the robot, with the limits of its joints
    torques        torque limits; None: torques are not checked
    torque_margin  share of the torque limits that a motion may use
    clearance      shapes that may not collide, or a floor; None: collisions are not checked
    """

    chain: Mechanism
    torques: TorqueLimits | None = None
    torque_margin: float = 1.0
    clearance: Clearance | FloorPoints | None = None

    def faults(self, motion: Trajectory, load: Load | None = None) -> list[str]:
        """Return a sentence for each limit that the motion violates. After a fault, costlier checks are skipped."""
        found = limit_faults(motion, self.chain)
        if not found and self.torques is not None:
            taken = slice(None, None, max(1, round(LOOKED_AT / motion.period)))
            q, qd, qdd = (np.ascontiguousarray(part[taken]) for part in (motion.q, motion.qd, motion.qdd))
            found = self.torques.faults(self.torques.torque(q, qd, qdd, load), self.torque_margin)
        if not found and self.clearance is not None:
            touch = self.clearance.first_touch(motion.q)
            found = [] if touch is None else [touch]
        return found


LARGEST_LIMIT = 1e6
"""rad/s^2, m/s^2, rad/s, N m: above any joint's."""


@dataclass(frozen=True, slots=True)
class GivenLimits:
    """Limits that the user gives by joint name, SI. A range or a speed may only be narrower than that in the robot
    file.

    ranges         lowest and highest position, rad (m)
    speeds         rad/s (m/s)
    accelerations  rad/s^2 (m/s^2)
    acceleration   rad/s^2 (m/s^2), for joints without another limit of acceleration; None: such joints give an error
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
            for value in values:
                if not 0 < value <= LARGEST_LIMIT:
                    raise InputError(
                        f"{what} is {value:g}, expected more than 0, at most {LARGEST_LIMIT:g}",
                        "in rad/s^2, rad/s or N m; m/s^2, m/s or N where a joint slides",
                    )

    @property
    def names(self) -> tuple[str, ...]:
        named = (self.ranges, self.speeds, self.accelerations, self.efforts)
        return tuple(dict.fromkeys(name for given in named for name in given))


def bounded(chain: Mechanism, given: GivenLimits) -> Mechanism:
    """Return the robot with the given limits. Joints that turn without limits get a range of half a turn in each
    direction.

    Raises InputError if a limit is still missing, if a range is empty or exceeds the file's, or if a joint does not
    exist.
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


@dataclass(frozen=True, slots=True, eq=False)
class TorqueLimits:
    """The largest joint torques of a robot, and the parameters with which the torques of a motion are computed.

    chain     the robot
    model     object that computes the regressor Y of the robot, with torques Y theta_b
    largest   (n,) N m (N), infinite for a joint without limit
    theta_b   (l,) base parameters
    friction  function from speeds (..., n) to friction torques (..., n); None: unknown
    """

    chain: Mechanism
    model: Regressor
    largest: Array
    theta_b: Array
    friction: Callable[[Array], Array] | None = None

    def torque(self, q: Array, qd: Array, qdd: Array, load: Load | None = None) -> Array:
        """Return the torques (N, n), N m (N), that a motion needs at N samples of n joints.

        Of a load, only the weight is included, because loads are carried in slow sweeps.
        """
        tau = self.of(self.model.regressor(q, qd, qdd), qd)
        return tau if load is None else tau + payload_torque(self.chain, q, load.mass, load.com)

    def of(self, regressor: Array, qd: Array) -> Array:
        """Return joint torques (..., n) with friction, from the regressor (..., n, l) and the speeds (..., n)."""
        tau = np.asarray(regressor @ self.theta_b)
        return tau if self.friction is None else tau + self.friction(qd)

    def excess(self, regressor: Array, qd: Array, share: float) -> tuple[float, Array, Array]:
        """Return a penalty for torques beyond `share` of the torque limits, and the derivatives of the penalty.

        The penalty is the mean over N samples of the squared relative excess, summed over the joints. The derivatives
        are those by the entries of the regressor (N, n, l) and, through friction, by the joint speeds (N, n).
        """
        tau = self.of(regressor, qd)
        usable = share * self.largest
        beyond = np.maximum(np.abs(tau) / usable - 1.0, 0.0)
        by_torque = 2.0 * beyond * np.sign(tau) / usable / len(tau)
        by_speed = np.zeros_like(qd)
        if self.friction is not None:
            rate = (self.friction(qd + SPEED_STEP) - self.friction(qd - SPEED_STEP)) / (2 * SPEED_STEP)
            by_speed = by_torque * rate
        return float(np.sum(beyond**2)) / len(tau), by_torque[..., None] * self.theta_b, by_speed

    def faults(self, tau: Array, share: float) -> list[str]:
        """Return a sentence for each joint whose largest torque in `tau` (N, n) is above `share` of its limit."""
        reach = np.abs(tau).max(axis=0)
        return [
            f"{joint.name}: torque {value:.4g} beyond {share:.0%} of {limit:g}"
            for joint, value, limit in zip(self.chain.joints, reach, self.largest, strict=True)
            if value > share * limit
        ]


def require_limits(joints: Sequence[Joint]) -> None:
    """Raise InputError with the joints that lack limits of motion, and with the limits that they lack."""
    lacking = []
    for joint in joints:
        limits = joint.limits
        named = {
            "position": limits.upper - limits.lower,
            "speed": limits.speed,
            "acceleration": limits.acceleration,
        }
        missing = [what for what, value in named.items() if not np.isfinite(value)]
        if missing:
            lacking.append(f"{joint.name} ({', '.join(missing)})")
    if lacking:
        raise InputError(
            f"joint(s) without limits to move within: {', '.join(lacking)}",
            "add them to the robot file, or give them with --speed JOINT=V and --acceleration A",
        )


# The first motion that is allowed


SHARES = (1.0, 0.85, 0.7, 0.55, 0.4, 0.28, 0.2)
"""Of each joint's range in which a motion is tried, one after the other."""
TRIES = 8
"""Places of such a part, and motions in it, that are tried before a smaller one."""

Try = tuple[float, Callable[[], Trajectory]]
"""Share of the ranges, and a motion within it."""


def first_allowed(
    what: str, tries: Iterable[Try], faults: Callable[[Trajectory], list[str]]
) -> tuple[Trajectory, float]:
    """Return the first motion that violates no limit, and the share of the joint ranges that this motion uses.

    what    kind of motion, for messages
    tries   shares of the ranges, and functions that make a motion within them
    faults  function that returns one sentence for each violated limit

    Raises InputError if all motions violate limits, or with the first error if no motion can be made.
    """
    found: list[str] = []
    for number, (share, make) in enumerate(tries):
        try:
            motion = make()
        except InputError:
            if number == 0:
                raise
            continue  # no room for the motion in so small a part of the ranges
        found = faults(motion)
        if not found:
            return motion, share
    raise InputError(
        f"no {what} is allowed, however small: {'; '.join(found)}",
        "give ranges in which the robot is free: --range JOINT=LOW:HIGH; or other limits",
    )


def smaller_boxes(chain: Mechanism, seed: int) -> Iterator[tuple[float, int, Mechanism]]:
    """Yield smaller and smaller joint ranges in which a motion may be planned.

    Each entry has the share of the full ranges, the number of the attempt with this share, and the robot with the
    smaller ranges. The first attempt takes the middle of the ranges, the others random places.
    """
    rng = np.random.default_rng(seed)
    low, high = np.array([(joint.limits.lower, joint.limits.upper) for joint in chain.joints]).T
    for share in SHARES:
        half = 0.5 * share * (high - low)
        for number in range(TRIES):
            middle = 0.5 * (low + high)
            if number and share < 1.0:
                middle = rng.uniform(low + half, high - half)
            yield share, number, _within(chain, middle - half, middle + half)


def _within(chain: Mechanism, low: np.ndarray, high: np.ndarray) -> Mechanism:
    joints = tuple(
        replace(joint, limits=replace(joint.limits, lower=float(a), upper=float(b)))
        for joint, a, b in zip(chain.joints, low, high, strict=True)
    )
    return replace(chain, joints=joints)
