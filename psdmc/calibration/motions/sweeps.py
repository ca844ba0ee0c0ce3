"""Slow sweeps, and sines of single joints: the motions of Denso-2022 3.1 to 3.3."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from psdmc.calibration.logs.log import Array
from psdmc.calibration.motions.trajectory import Trajectory, sliding_joints, smooth_step
from psdmc.errors import InputError
from psdmc.robot.mechanism import Joint, Mechanism

LONGEST_RUN = 3600.0
"""s: 3.6 million rows at 1 kHz."""


@dataclass(frozen=True, slots=True)
class SweepOptions:
    """Options of sweeps at constant speed.

    speed     share of each joint's speed limit; fast enough to avoid static friction, slow enough for small inertial torque
    range     share of the position range that is swept, centred
    blend     s, over which a speed changes sign
    seconds   s, of the forward half of a gravity sweep
    period    s between rows
    """

    speed: float = 0.08
    range: float = 0.95
    blend: float = 0.5
    seconds: float = 90.0
    period: float = 1e-3


@dataclass(frozen=True, slots=True)
class SineOptions:
    """Options of sines with growing amplitude, one joint at a time.

    smallest, largest  amplitudes, rad. The smallest lies in pre-sliding (elastic deflection before the joint slides);
                       limits may reduce the largest
    ratio              ratio of one amplitude to the one before
    frequencies        Hz; each amplitude is run at each frequency that the limits allow, or at the largest possible one
    cycles             number of periods at full amplitude; one more period before them fades the sine in, one after
                       them fades it out
    margin             share of the speed and acceleration limits that is used
    period             s between rows
    """

    smallest: float = 1e-5
    largest: float = 1.5
    ratio: float = 2.0
    frequencies: tuple[float, ...] = (1.0, 5.0)
    cycles: int = 2
    margin: float = 0.9
    period: float = 1e-3


Piece = tuple[float, float, float]
"""Duration (s), speed at its start and at its end (per s)."""


def swept_range(joint: Joint, share: float) -> tuple[float, float]:
    """Return the middle `share` of a joint's position range; half a turn in each direction if it has no limits."""
    lower, upper = joint.limits.lower, joint.limits.upper
    if not np.isfinite([lower, upper]).all():
        lower, upper = -np.pi, np.pi
    middle, half = 0.5 * (lower + upper), 0.5 * share * (upper - lower)
    return float(middle - half), float(middle + half)


def sweep_speed(joint: Joint, share: float) -> float:
    """Return a share of the joint's speed limit, rad/s or m/s; without a limit, of 2 rad/s or m/s."""
    return share * (joint.limits.speed if np.isfinite(joint.limits.speed) else 2.0)


def _require_speed(joint: Joint, speed: float) -> None:
    if not speed > 0:
        raise InputError(f"joint {joint.name}: its speed limit is {speed:g}", "correct it in the robot file")


def _require_short(joint: Joint, what: str, seconds: float) -> None:
    """InputError where a joint's limits make its motion too long to run."""
    if not seconds <= LONGEST_RUN:
        raise InputError(
            f"joint {joint.name}: its {what} would take {seconds:.3g} s, expected at most {LONGEST_RUN:g} s",
            "is its speed or acceleration limit in the robot file right?",
        )


def single_joint_sweep(chain: Mechanism, joint: int, pose: Array, options: SweepOptions) -> Trajectory:
    """Return a motion of one joint through its range and back at constant speed, while the others stay at `pose` (n,).
    Source: Denso-2022, (16)."""
    low, high = swept_range(chain.joints[joint], options.range)
    speed = sweep_speed(chain.joints[joint], options.speed)
    _require_speed(chain.joints[joint], speed)
    _require_short(chain.joints[joint], "sweep", 2.0 * (high - low) / speed)
    cruise = (high - low) / speed - options.blend
    if cruise <= 0:
        raise InputError(
            f"joint {chain.joints[joint].name}: too little range to sweep at {speed:.3g} per s",
            "widen the joint's limits in the robot's file, or sweep more slowly",
        )
    blend = options.blend
    pieces = [(blend, 0.0, speed), (cruise, speed, speed), (blend, speed, 0.0)]
    pieces += [(blend, 0.0, -speed), (cruise, -speed, -speed), (blend, -speed, 0.0)]
    time = _times(sum(piece[0] for piece in pieces), options.period)
    q = np.tile(np.asarray(pose, dtype=np.float64), (len(time), 1))
    qd, qdd = np.zeros_like(q), np.zeros_like(q)
    q[:, joint], qd[:, joint], qdd[:, joint] = _run(pieces, low, time)
    return Trajectory(chain.joint_names, time, q, qd, qdd, sliding_joints(chain))


def gravity_sweep(chain: Mechanism, seed: int, options: SweepOptions) -> Trajectory:
    """Return a slow motion of all joints for the identification of gravity torques. Source: Denso-2022, (18).

    Each joint moves forwards and backwards at its own constant speed. Then the whole motion is repeated in reverse, so
    that friction cancels. Speeds and starts are random numbers from the seed, so the joints always meet in new poses.
    """
    rng = np.random.default_rng(seed)
    half = _times(options.seconds, options.period)
    q, qd, qdd = (np.zeros((len(half), len(chain))) for _ in range(3))
    for k, joint in enumerate(chain.joints):
        low, high = swept_range(joint, options.range)
        speed = sweep_speed(joint, options.speed) * rng.uniform(0.6, 1.0)
        _require_speed(joint, speed)
        margin = 0.5 * speed * options.blend
        start = rng.uniform(low + margin, high - margin)
        pieces = _to_and_fro(low, high, start, speed, options)
        q[:, k], qd[:, k], qdd[:, k] = _run(pieces, start, half)
    time: Array = np.arange(2 * len(half) - 1, dtype=np.float64) * options.period
    return Trajectory(
        chain.joint_names,
        time,
        np.vstack([q, q[-2::-1]]),
        np.vstack([qd, -qd[-2::-1]]),
        np.vstack([qdd, qdd[-2::-1]]),
        sliding_joints(chain),
    )


def sine_series(chain: Mechanism, joint: int, pose: Array, options: SineOptions) -> Trajectory:
    """Return a motion of one joint along sines of growing amplitude about its position in `pose`. Source: Denso-2022,
    3.3.

    The first two derivatives of each sine's envelope are zero at both ends.
    """
    runs: list[tuple[Array, Array, Array]] = []
    plan = sine_plan(chain.joints[joint], float(pose[joint]), options)
    seconds = sum((options.cycles + 2) / frequency for _, frequency in plan)
    _require_short(chain.joints[joint], "series of sines", seconds)
    for amplitude, frequency in plan:
        runs.append(_windowed_sine(amplitude, frequency, options))
    moved, rate, acceleration = (np.concatenate(parts) for parts in zip(*runs, strict=True))
    time: Array = np.arange(len(moved), dtype=np.float64) * options.period
    q = np.tile(np.asarray(pose, dtype=np.float64), (len(time), 1))
    qd, qdd = np.zeros_like(q), np.zeros_like(q)
    q[:, joint] += moved
    qd[:, joint], qdd[:, joint] = rate, acceleration
    return Trajectory(chain.joint_names, time, q, qd, qdd, sliding_joints(chain))


def sine_plan(joint: Joint, centre: float, options: SineOptions) -> list[tuple[float, float]]:
    """Return (amplitude, frequency) of each sine for the friction identification of one joint, within the joint's
    limits.

    centre  rad or m, position about which the joint oscillates
    """
    limits = joint.limits
    room = min(limits.upper - centre, centre - limits.lower, options.largest)
    if not room >= options.smallest or not min(limits.speed, limits.acceleration) > 0:
        raise InputError(
            f"joint {joint.name}: no room for sines of {options.smallest:g} about {centre:.6g}",
            "are its limits in the robot file right?",
        )
    count = max(1, int(np.floor(np.log(room / options.smallest) / np.log(options.ratio))) + 1)
    plan: list[tuple[float, float]] = []
    for amplitude in options.smallest * options.ratio ** np.arange(count):
        fastest = (
            options.margin
            * min(limits.speed / amplitude, np.sqrt(limits.acceleration / amplitude))
            / (2 * np.pi)
        )
        rates = dict.fromkeys(min(frequency, float(fastest)) for frequency in options.frequencies)
        plan += [(float(amplitude), frequency) for frequency in rates]
    return plan


def _windowed_sine(amplitude: float, frequency: float, options: SineOptions) -> tuple[Array, Array, Array]:
    duration = (options.cycles + 2) / frequency
    time = _times(duration, options.period)[:-1]
    w = 2.0 * np.pi * frequency
    _, rise, rise_rate, rise_acceleration = smooth_step(time * frequency)
    _, fall, fall_rate, fall_acceleration = smooth_step((duration - time) * frequency)
    envelope = rise * fall
    slope = (rise_rate * fall - rise * fall_rate) * frequency
    bend = (rise_acceleration * fall - 2 * rise_rate * fall_rate + rise * fall_acceleration) * frequency**2
    sine, cosine = np.sin(w * time), np.cos(w * time)
    return (
        amplitude * envelope * sine,
        amplitude * (slope * sine + envelope * w * cosine),
        amplitude * (bend * sine + 2.0 * slope * w * cosine - envelope * w**2 * sine),
    )


def _to_and_fro(low: float, high: float, start: float, speed: float, options: SweepOptions) -> list[Piece]:
    """Pieces that reverse at both ends of the range and end at `options.seconds`.

    A reversal covers no net distance, so it starts where the range has room for its overshoot.
    """
    blend = options.blend
    # how far a reversal overshoots its start: the integral of the speed up to its zero
    room = float(_blend(np.array([0.5]), blend, speed, -speed)[0][0])
    low, high = low + room, high - room
    start = min(max(start, low), high)
    pieces: list[Piece] = [(blend, 0.0, speed)]
    left = options.seconds - 2 * blend
    direction, where = 1.0, start + 0.5 * speed * blend
    while left > 0:
        leg = min(max((high - where) if direction > 0 else (where - low), 0.0) / speed, left)
        pieces.append((leg, direction * speed, direction * speed))
        where += direction * speed * leg
        left -= leg
        if left > blend:
            pieces.append((blend, direction * speed, -direction * speed))
            direction, left = -direction, left - blend
        elif left > 0:
            pieces.append((left, direction * speed, 0.0))
            return [*pieces, (2 * blend, 0.0, 0.0)]
    return [*pieces, (blend, direction * speed, 0.0), (blend, 0.0, 0.0)]


def _run(pieces: Sequence[Piece], start: float, time: Array) -> tuple[Array, Array, Array]:
    """Position, speed and acceleration at `time` of pieces run one after the other."""
    q, qd, qdd = np.full(len(time), start), np.zeros(len(time)), np.zeros(len(time))
    begin, where = 0.0, start
    for duration, before, after in pieces:
        inside = (time >= begin) & (time < begin + duration)
        if duration > 0:
            x = (time[inside] - begin) / duration
            moved, qd[inside], qdd[inside] = _blend(x, duration, before, after)
            q[inside] = where + moved
            where += 0.5 * (before + after) * duration
        begin += duration
    q[time >= begin] = where
    return q, qd, qdd


def _blend(x: Array, duration: float, before: float, after: float) -> tuple[Array, Array, Array]:
    """A change of speed whose acceleration is a raised cosine, zero at both ends; x from 0 to 1."""
    turn = 2.0 * np.pi
    change = after - before
    moved = before * x + change * (0.5 * x**2 + (np.cos(turn * x) - 1.0) / turn**2)
    rate = before + change * (x - np.sin(turn * x) / turn)
    return duration * moved, rate, change / duration * (1.0 - np.cos(turn * x))


def _times(duration: float, period: float) -> Array:
    return np.arange(int(np.floor(duration / period + 1e-9)) + 1, dtype=np.float64) * period
