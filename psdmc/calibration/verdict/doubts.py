"""Doubts about a calibration: a line each, for its user."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from psdmc.calibration.identify.residuals import CORRELATED
from psdmc.calibration.verdict.findings import Findings
from psdmc.calibration.verdict.reasons import late
from psdmc.calibration.verdict.verdict import listed

ALONE = ("Motor", "Friction")
"""Steps that move one joint alone, so that each of them must fit."""
MOST_LISTED = 4
"""Names in one line; the rest is counted."""


def doubts(found: Findings) -> Iterator[str]:
    """All doubts."""
    yield from _perhaps_saturated(found)
    yield from _a_little_late(found)
    yield from _sampled_slowly(found)
    yield from _few(found)
    yield from _fair(found)
    yield from _earlier_steps(found)
    yield from _odd_gains(found)
    yield from _unlike_limits(found)
    yield from _hardly_moving(found)
    yield from _lacking(found)
    yield from _not_carried_over(found)
    yield from _open_parameters(found)
    yield from _indefinite(found)
    yield from _unchecked(found)


def _perhaps_saturated(found: Findings) -> Iterator[str]:
    """A doubt about efforts that friction of a constant size explains as well as a limit does."""
    piled = found.evidence.saturated
    if piled and not any(each.certain for each in piled):
        yield (
            "the effort may be cut off at a limit, or this may be friction alone: joint "
            f"{', '.join(each.words for each in piled)} of its moving rows: if the drive or sensor has that limit, "
            "record again with slower motions"
        )


def _a_little_late(found: Findings) -> Iterator[str]:
    for delay in found.delays:
        if delay.shown and found.limits.hardly_late < abs(delay.value) <= found.limits.late:
            yield late(delay)


def fits_poorly(found: Findings) -> bool:
    """Whether R^2 or gains raise a doubt. Only then are other readings of the log's columns considered."""
    return any(True for _ in (*_fair(found), *_odd_gains(found)))


def _sampled_slowly(found: Findings) -> Iterator[str]:
    """Doubts about plain logs whose differences are no good accelerations up to the filter's cut-off."""
    step = None if found.record.prediction is None else found.record.prediction.steps.get("all")
    rates = [
        (log["rows"] - 1) / log["seconds"] for log in found.record.facts.get("data", ()) if log["seconds"] > 0
    ]
    if step is None or not rates:
        return
    rate, cutoff = min(rates), step.filter.cutoff
    lost = acceleration_lost(cutoff / rate)
    sound = cutoff_for(found.limits.acceleration_lost) * rate
    if lost > found.limits.acceleration_lost:
        yield (
            f"sampled at {rate:.3g} Hz and filtered at {cutoff:g} Hz: accelerations of the fastest motion come out up to "
            f"{lost:.0%} too small, and inertias too large; a cut-off of {sound:.2g} Hz or less avoids that"
        )


def acceleration_lost(share: float) -> float:
    """Share by which a second difference is smaller than the second derivative of a sine, whose frequency is `share` of
    the sampling rate: 1 - (2 - 2 cos w) / w^2, w = 2 pi share."""
    w = 2.0 * np.pi * share
    return float(1.0 - (2.0 - 2.0 * np.cos(w)) / w**2)


def cutoff_for(lost: float) -> float:
    """The largest frequency, in units of the sampling rate, whose acceleration loses no more than this share: by the
    first terms of the series, w^2 / 12 - w^4 / 360."""
    return float(np.sqrt(15.0 - np.sqrt(225.0 - 360.0 * lost)) / (2.0 * np.pi))


def _few(found: Findings) -> Iterator[str]:
    for demand in found.demands:
        if found.limits.fewest_samples <= demand.per_unknown < found.limits.few_samples:
            yield (
                f"{demand.samples} independent samples for {demand.unknowns} unknowns ({demand.step}): "
                f"few, {found.limits.few_samples:g} each are sound"
            )


def _fair(found: Findings) -> Iterator[str]:
    named = [
        k
        for k in range(len(found.names))
        if (found.follows_badly(k) and found.excused(k))
        or found.limits.poor_r2 <= found.held_out[k].r2 < found.limits.fair_r2
    ]
    if named:
        yield f"R^2 on held-out data below {found.limits.fair_r2:g}: {found.followed(named)}"


def _earlier_steps(found: Findings) -> Iterator[str]:
    """Doubts about motors and friction. Gravity and inertia are left out, as they may be too small at a joint to fit."""
    for step in found.record.steps[:-1]:
        named = [
            f"joint {name} {both.held_out.r2:.3g}"
            for name, both in step.joints.items()
            if step.step in ALONE and not both.held_out.r2 >= found.limits.fair_r2
        ]
        if named:
            yield f"R^2 on held-out data in step {step.step.lower()}: {listed(named)}"


def _odd_gains(found: Findings) -> Iterator[str]:
    (low, high), (least, most) = found.limits.sure_gains, found.limits.gains
    odd = [
        k
        for k, gain in enumerate(found.gains)
        if gain.visible and least <= gain.value <= most and not low <= gain.value <= high
    ]
    if odd:
        yield f"measured torque over the torque by the file's parameters: {found.gained(odd)}"


def _unlike_limits(found: Findings) -> Iterator[str]:
    """Torques that are far below the file's limits for the motors, or several times as large."""
    limits = np.array([joint.limits.effort for joint in found.evidence.model.mechanism.joints])
    known = np.isfinite(limits) & (limits > 0)
    if not known.any():
        return
    share = np.abs(found.evidence.torque).max(axis=0)[known] / limits[known]
    low, high = found.limits.of_limit
    if share.max() < low or share.max() > high:
        yield f"the largest torque is {share.max():.2g} times the file's effort limit: another unit?"


def _hardly_moving(found: Findings) -> Iterator[str]:
    slow = [name for k, name in enumerate(found.names) if found.speed[k] < found.limits.hardly]
    if slow:
        yield (
            f"joint(s) {listed(slow)} hardly move (under {found.limits.hardly:g} rad/s or m/s RMS): "
            "their friction and drive inertia are not seen"
        )


def _lacking(found: Findings) -> Iterator[str]:
    """Residuals beyond noise that are correlated, or many times the sensor's noise."""
    correlation = found.record.facts.get("residual_correlation", {})
    named = []
    for k, name in enumerate(found.names):
        ratio = found.noise_ratio(k)
        correlated = correlation.get(name, 0.0) > CORRELATED and not ratio < found.limits.sure
        if found.noticeable(k) and (correlated or ratio > found.limits.noise_ratio):
            named.append(name if np.isnan(ratio) else f"{name} ({ratio:.3g} times the sensor noise)")
    if named:
        yield (
            f"the model lacks an effect at joint(s) {listed(named)}: the residual is no sensor noise, "
            f"and standard deviations are widened for it{_by_factor(found)}"
        )


def _by_factor(found: Findings) -> str:
    factor = found.record.facts.get("noise_factor")
    return "" if factor is None else f", by a factor of up to {factor:.1f}"


def _not_carried_over(found: Findings) -> Iterator[str]:
    named = [
        f"joint {name} {found.held_out[k].rmse:.3g} and {found.fitted[k].rmse:.3g} {found.unit(k)}"
        for k, name in enumerate(found.names)
        if found.held_out[k].rmse
        > max(found.limits.worse * found.fitted[k].rmse, found.limits.carried * found.variation[k])
    ]
    if named:
        yield f"the fit does not carry over: RMSE on held-out and on fitted data: {listed(named)}"


def _open_parameters(found: Findings) -> Iterator[str]:
    """Parameters that the data leave open, or determine so badly that it matters to the torque."""
    rows = found.record.parameters
    fixed = np.array([np.isfinite(row.std) for row in rows])
    unseen = [row.name for row, seen in zip(rows, fixed, strict=True) if not seen]
    if unseen:
        yield (
            f"{len(unseen)} of {len(rows)} base parameters are not fixed by the data: {_some(unseen)} "
            "stay near the file's values, or zero"
        )
    columns = found.evidence.columns()
    share = np.sqrt(np.mean(columns**2, axis=0)) / np.maximum(found.variation, 1e-300)[:, None]
    std = np.where(fixed, [row.std for row in rows], 0.0)
    badly = np.flatnonzero(
        np.max(share * std, axis=0, initial=0.0, where=found.moved()) > found.limits.settled
    )
    if len(badly):
        named = _some(
            [f"{rows[j].name} ({rows[j].value:.3g} +- {rows[j].std:.2g} {rows[j].unit})" for j in badly]
        )
        yield f"{len(badly)} base parameter(s) are known badly: {named}: other motions may fit worse than this one"


def _indefinite(found: Findings) -> Iterator[str]:
    """A mass matrix that is not positive definite, where that was tested."""
    mass = found.record.facts.get("mass_matrix", {})
    if mass.get("failing"):
        yield (
            f"the mass matrix is not positive definite in {mass['failing']} of {mass['poses']} poses: "
            "there is no forward dynamics"
        )


def _unchecked(found: Findings) -> Iterator[str]:
    if found.evidence.model.theta_b is None and not found.record.motors:
        yield "the file lacks inertias: a wrong unit, or all signs turned, would show in friction only"
    turned = [row.joint for row in found.record.motors if row.value < 0]
    if turned:
        yield f"the torque constant is negative at joint(s) {listed(turned)}: current counts against the joint's sense"


def _some(names: Sequence[str]) -> str:
    if len(names) <= MOST_LISTED:
        return listed(names)
    return f"{', '.join(names[:MOST_LISTED])} and {len(names) - MOST_LISTED} more"
