"""Reasons why a calibration cannot be used: a line each."""

from __future__ import annotations

from collections.abc import Iterator

from psdmc.calibration.verdict.findings import Findings
from psdmc.calibration.verdict.verdict import Delay, listed

NOT_PHYSICAL = "not_physical"
"""Name of the fact that tells why a record has no physically consistent version."""


def reasons(found: Findings) -> Iterator[str]:
    """All reasons; none where it is usable."""
    yield from _saturated(found)
    yield from _late(found)
    yield from _unphysical(found)
    yield from _too_few(found)
    yield from _wrong_gains(found)
    yield from _powered(found)
    yield from _poor(found)


def _saturated(found: Findings) -> Iterator[str]:
    piled = found.evidence.saturated
    if any(each.certain for each in piled):
        yield (
            f"the effort is cut off at a limit: joint {', '.join(each.words for each in piled)} of the rows in which it "
            "moves: record slower motions or smaller loads, or raise the limit of the drive or the sensor"
        )


def _late(found: Findings) -> Iterator[str]:
    for delay in found.delays:
        if delay.shown and abs(delay.value) > found.limits.late:
            yield late(delay)


def late(delay: Delay) -> str:
    """A delay, and how to take it out."""
    columns = "[effort]" if delay.value > 0 else "[position] and [velocity]"
    return (
        f"{delay.log}: the torque is logged {delay.words} than the motion it belongs to: set `delay = {delay.size}` of "
        f"{columns} in a log description (psdmc calibrate --describe), or add it to the delay there"
    )


def _unphysical(found: Findings) -> Iterator[str]:
    failed = found.record.facts.get(NOT_PHYSICAL)
    if failed:
        yield f"no mass distribution of a real robot is near the fit ({failed})"


def _too_few(found: Findings) -> Iterator[str]:
    for demand in found.demands:
        if demand.per_unknown < found.limits.fewest_samples:
            yield (
                f"{demand.samples} independent samples for {demand.unknowns} unknowns ({demand.step}): "
                f"{demand.per_unknown:.1f} each, at least {found.limits.fewest_samples:g} are needed"
            )


def _wrong_gains(found: Findings) -> Iterator[str]:
    low, high = found.limits.gains
    wrong = [k for k, gain in enumerate(found.gains) if gain.visible and not low <= gain.value <= high]
    if wrong:
        yield (
            f"measured torque over the torque by the file's parameters: {found.gained(wrong)}; "
            f"expected {low:g} to {high:g}"
        )


def _powered(found: Findings) -> Iterator[str]:
    motor = found.limits.friction_share * found.variation * found.speed
    giving = [
        f"joint {found.names[k]} {power.value:.2g} +- {power.std:.1g} W"
        for k, power in enumerate(found.powers)
        if power.value < -max(found.limits.sure * power.std, motor[k])
    ]
    if giving:
        yield (
            f"friction would give power instead of taking it: {listed(giving)}: "
            "effort and motion have opposite signs there, or belong to different joints"
        )


def _poor(found: Findings) -> Iterator[str]:
    poor = [k for k in range(len(found.names)) if found.follows_badly(k)]
    named = [k for k in poor if not found.excused(k)]
    if named:
        yield f"R^2 on held-out data below {found.limits.poor_r2:g}: {found.followed(named)}"
    elif len(poor) == len(found.names):
        yield f"no joint's torque is followed: R^2 on held-out data {found.followed(poor)}"
