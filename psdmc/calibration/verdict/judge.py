"""Determines the verdict on a calibration from its record and from its log.

A calibration is not usable for any of these reasons: too few samples, a joint whose torque has the wrong size or sign
compared with the robot file's, friction that generates power, or held-out data that the model does not predict. Doubts
are a moderate fit, a joint that hardly moves, an effect that the model lacks, and parameters that the data do not
determine. docs/calibration.md lists the limits, and decision 0021 gives the reasons for them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace

import numpy as np

from psdmc.calibration.identify.four_steps import Runs
from psdmc.calibration.identify.motor_model import Motors, coupling_of
from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.identify.residuals import CORRELATED
from psdmc.calibration.logs.log import AnyLog
from psdmc.calibration.logs.low_pass import FilterOptions
from psdmc.calibration.verdict.couplings import proposed_coupling
from psdmc.calibration.verdict.delivered import delivered, sprung
from psdmc.calibration.verdict.evidence import Evidence, Motion, evidence_of
from psdmc.calibration.verdict.findings import Demand, Findings
from psdmc.calibration.verdict.log_errors import log_errors, unstated_load
from psdmc.calibration.verdict.record import Calibration, with_verdict
from psdmc.calibration.verdict.suspects import suspect, unit_suspect
from psdmc.calibration.verdict.verdict_limits import VerdictOptions
from psdmc.model.calibrated import FRICTION_DRIFT, LOG_INFORMATION, PROPOSED_COUPLING, Verdict
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.grounds import Delay, Ground

NOT_PHYSICAL = "not_physical"
"""Name of the fact that tells why a record has no physically consistent version."""
ODD_LOGS = "odd_logs"
"""Name of the fact that holds the logs which contradict the others of their fit."""
ALONE = ("Motor", "Friction")
"""Steps that move one joint alone, so that each of them must fit."""


def with_verdict_on_logs(
    record: Calibration,
    model: DynamicsModel,
    regressor: Regressor,
    logs: Sequence[AnyLog],
    motors: Motors,
    options: FilterOptions,
    limits: VerdictOptions,
) -> Calibration:
    """Return the record of a fit of plain logs with its verdict.

    model   the model before the calibration, whose theta_b is the robot file's; the record holds the calibrated one
    """
    matrix = () if record.prediction is None else record.prediction.coupling
    springs = sprung(delivered(record.model))
    motions = [Motion(log) for log in logs]
    evidence = evidence_of(model, regressor, motions, motors, options, coupling_of(matrix), springs)
    demand = Demand("linear fit", _fitted(record, "All"), record.facts["rank"])
    proposed = proposed_coupling(evidence)
    if proposed is not None and all(
        each.explains < proposed.explains for each in log_errors(evidence, record.model)
    ):
        record = replace(record, facts={**record.facts, PROPOSED_COUPLING: proposed.values})
    return with_verdict(record, judge(record, evidence, [demand], limits))


def with_verdict_on_campaign(
    record: Calibration,
    model: DynamicsModel,
    regressor: Regressor,
    runs: Runs,
    motors: Motors,
    options: FilterOptions,
    limits: VerdictOptions,
) -> Calibration:
    """Return the record of a campaign with its verdict. Gains and friction are judged on its exciting motions."""
    motions = [Motion(run.log, run.tool) for run in runs.inertial]
    evidence = evidence_of(model, regressor, motions, motors, options)
    demands = [
        Demand("gravity", _fitted(record, "Gravity"), record.facts["gravity_rank"]),
        Demand("inertial", _fitted(record, "All"), record.facts["inertial_rank"]),
    ]
    return with_verdict(record, judge(record, evidence, demands, limits))


def _fitted(record: Calibration, step: str) -> int:
    """Independent samples that a step was fitted to, all joints together."""
    samples = next(found.samples for found in record.steps if found.step == step)
    return sum(int((~sample.held_out).sum()) for sample in samples)


def judge(
    record: Calibration,
    evidence: Evidence,
    demands: Sequence[Demand],
    options: VerdictOptions | None = None,
) -> Verdict:
    """Return the verdict. `evidence` holds the model before the calibration, whose theta_b is that of the robot file."""
    found = Findings(record, evidence, tuple(demands), options or VerdictOptions())
    against, doubted = list(reasons(found)), list(doubts(found))
    likely = _suspects(found)
    if likely and not against:
        (against if fits_poorly(found) else doubted).append(Ground("contradicted"))
    proposed = record.facts.get(PROPOSED_COUPLING)
    if not against and proposed is None:
        for ground, is_certain in hidden_errors(found):
            (against if is_certain else doubted).append(ground)
    if proposed is not None:
        coupled = Ground("undescribed_coupling", proposed)
        likely, doubted = ((coupled, *likely), doubted) if against else (likely, [coupled, *doubted])
    return Verdict(
        against=tuple(against),
        doubted=tuple(doubted),
        suspected=likely,
        joints=tuple(found.figures(k) for k in range(len(found.names))),
        samples_per_unknown=min((demand.per_unknown for demand in found.demands), default=float("inf")),
        delays=found.delays,
    )


def _suspects(found: Findings) -> tuple[Ground, ...]:
    """Explanations of a bad fit; none for a log too short to tell."""
    if found.starved:
        return ()
    gains = [gain for k, gain in enumerate(found.gains) if k not in found.file_errors]
    named = (suspect(found.evidence), unit_suspect(gains))
    return tuple(ground for ground in named if ground is not None)


def hidden_errors(found: Findings) -> Iterator[tuple[Ground, bool]]:
    """Yield errors of a log that otherwise looks good, and whether each of them makes the log unusable."""
    errors = log_errors(found.evidence, found.record.model)
    if errors:
        names = ("kind", "joint", "value", "std", "unit", "explains", "felt")
        items = [{name: getattr(each, name) for name in names} for each in errors]
        yield Ground("log_error", {"items": items}), errors[0].certain
        return
    load = unstated_load(found.evidence)
    if load is not None:
        yield Ground("unstated_load", asdict(load)), False


# Reasons


def reasons(found: Findings) -> Iterator[Ground]:
    """Yield the reasons why a calibration is not usable; there are none if it is usable."""
    if any(each.certain for each in found.evidence.saturated):
        yield _at_a_level("saturated", found)
    for delay in found.delays:
        if delay.shown and abs(delay.value) > found.limits.late:
            yield late(delay)
    failed = found.record.facts.get(NOT_PHYSICAL)
    if failed:
        yield Ground("not_physical", {"why": failed})
    least = found.limits.fewest_samples
    for demand in found.demands:
        if demand.per_unknown < least:
            yield Ground("starved", {**asdict(demand), "limit": least})
    yield from _wrong_gains(found)
    yield from _powered(found)
    yield from _poor(found)


def _at_a_level(code: str, found: Findings) -> Ground:
    """The reason or doubt about efforts that stay at an extreme value."""
    names = ("joint", "level", "unit", "share")
    return Ground(
        code, {"items": [{name: getattr(each, name) for name in names} for each in found.evidence.saturated]}
    )


def late(delay: Delay) -> Ground:
    """Return the reason or doubt of a verdict for a delay between motion and torque.

    The text of the verdict states the delay and the change of the log that removes it.
    """
    return Ground("late", {"log": delay.log, "seconds": delay.value, "std": delay.std})


def _wrong_gains(found: Findings) -> Iterator[Ground]:
    low, high = found.limits.gains
    wrong = [
        k
        for k, gain in enumerate(found.gains)
        if k in found.overscaled
        or (gain.visible and not low <= gain.value <= high and k not in found.file_errors)
    ]
    if wrong:
        yield Ground("wrong_gains", {"items": found.gained(wrong), "low": low, "high": high})


def _powered(found: Findings) -> Iterator[Ground]:
    motor = found.limits.friction_share * found.variation * found.speed
    giving = [
        {"joint": found.names[k], "power": power.value, "std": power.std}
        for k, power in enumerate(found.powers)
        if power.value < -max(found.limits.sure * power.std, motor[k])
    ]
    if giving:
        yield Ground("friction_gives_power", {"items": giving})


def _poor(found: Findings) -> Iterator[Ground]:
    poor = [k for k in range(len(found.names)) if found.follows_badly(k)]
    named = [k for k in poor if not found.excused(k)]
    if named:
        yield Ground("low_r2", {"items": found.followed(named), "limit": found.limits.poor_r2})
    elif len(poor) == len(found.names):
        yield Ground("nothing_followed", {"items": found.followed(poor)})


# Doubts


def doubts(found: Findings) -> Iterator[Ground]:
    """Yield all doubts about a calibration."""
    yield from _of_logs(found)
    yield from _sampled_slowly(found)
    for demand in found.demands:
        if found.limits.fewest_samples <= demand.per_unknown < found.limits.few_samples:
            yield Ground("few_samples", {**asdict(demand), "limit": found.limits.few_samples})
    yield from _fair(found)
    yield from _earlier_steps(found)
    yield from _odd_gains(found)
    yield from _of_scales(found)
    slow = [{"joint": name} for k, name in enumerate(found.names) if found.speed[k] < found.limits.hardly]
    if slow:
        yield Ground("hardly_moving", {"items": slow, "limit": found.limits.hardly})
    yield from _lacking(found)
    yield from _not_carried_over(found)
    yield from _open_parameters(found)
    mass = found.record.facts.get("mass_matrix", {})  # empty if it was not tested
    if mass.get("failing"):
        yield Ground("indefinite", {"failing": mass["failing"], "poses": mass["poses"]})
    if found.evidence.model.theta_b is None and not found.record.motors:
        yield Ground("unchecked")
    turned = [{"joint": row.joint} for row in found.record.motors if row.value < 0]
    if turned:
        yield Ground("negative_constants", {"items": turned})


def _of_logs(found: Findings) -> Iterator[Ground]:
    """Doubts about logs that contradict the others, over which friction changes, or whose efforts are clipped or late."""
    odd = found.record.facts.get(ODD_LOGS, {"items": []})
    for item in odd["items"]:
        fitted = len(found.record.facts[LOG_INFORMATION]["logs"])
        yield Ground("logs_disagree" if odd["disagree"] else "odd_log", {**item, "logs": fitted})
    drifts = [each for each in found.record.facts.get(FRICTION_DRIFT, ()) if each["shown"]]
    for log in dict.fromkeys(each["log"] for each in drifts):
        items = [each for each in drifts if each["log"] == log]
        yield Ground("friction_drifts", {"log": log, "seconds": items[0]["seconds"], "items": items})
    piled = found.evidence.saturated
    if piled and not any(each.certain for each in piled):  # friction of a constant size explains them as well
        yield _at_a_level("perhaps_saturated", found)
    for delay in found.delays:
        if delay.shown and found.limits.hardly_late < abs(delay.value) <= found.limits.late:
            yield late(delay)


def fits_poorly(found: Findings) -> bool:
    """Return whether R^2 or gains raise a doubt. Only then does psdmc look for exchanged columns and reversed signs."""
    return any(True for _ in (*_fair(found), *_odd_gains(found)))


def _sampled_slowly(found: Findings) -> Iterator[Ground]:
    """Doubts about plain logs whose differences are no good accelerations up to the filter's cut-off."""
    step = None if found.record.prediction is None else found.record.prediction.steps.get("all")
    logs = [log for log in found.record.logs if log.use != "with_load" and log.seconds > 0]
    rates = [(log.rows - 1) / log.seconds for log in logs]
    if step is None or not rates:
        return
    rate, cutoff = min(rates), step.cutoff
    lost = acceleration_lost(cutoff / rate)
    sound = cutoff_for(found.limits.acceleration_lost) * rate
    if lost > found.limits.acceleration_lost:
        values = {"rate": rate, "cutoff": cutoff, "lost": lost, "sound": sound}
        yield Ground("sampled_slowly", values)


def acceleration_lost(share: float) -> float:
    """Return the share by which a second difference is smaller than the second derivative of a sine.

    The result is 1 - (2 - 2 cos w) / w^2, w = 2 pi share, for a sine with a frequency of `share` of the sampling rate.
    """
    w = 2.0 * np.pi * share
    return float(1.0 - (2.0 - 2.0 * np.cos(w)) / w**2)


def cutoff_for(lost: float) -> float:
    """Return the largest frequency, in units of the sampling rate, at which second differences lose at most this share
    of the acceleration. It follows from the first terms of the series, w^2 / 12 - w^4 / 360."""
    return float(np.sqrt(15.0 - np.sqrt(225.0 - 360.0 * lost)) / (2.0 * np.pi))


def _fair(found: Findings) -> Iterator[Ground]:
    named = [
        k
        for k in range(len(found.names))
        if (found.follows_badly(k) and found.excused(k))
        or found.limits.poor_r2 <= found.held_out[k].r2 < found.limits.fair_r2
    ]
    if named:
        yield Ground("low_r2", {"items": found.followed(named), "limit": found.limits.fair_r2})


def _earlier_steps(found: Findings) -> Iterator[Ground]:
    """Doubts about motors and friction. Gravity and inertia are left out, as they may be too small at a joint to fit."""
    for step in found.record.steps[:-1]:
        named = [
            {"joint": name, "r2": both.held_out.r2}
            for name, both in step.joints.items()
            if step.step in ALONE and not both.held_out.r2 >= found.limits.fair_r2
        ]
        if named:
            yield Ground("low_r2_of_step", {"step": step.step, "items": named})


def _odd_gains(found: Findings) -> Iterator[Ground]:
    (low, high), (least, most) = found.limits.sure_gains, found.limits.gains
    odd = [
        k
        for k, gain in enumerate(found.gains)
        if gain.visible
        and least <= gain.value <= most
        and not low <= gain.value <= high
        and k not in found.file_errors
    ]
    if odd:
        yield Ground("odd_gains", {"items": found.gained(odd)})


def _of_scales(found: Findings) -> Iterator[Ground]:
    """Doubts about the robot file, and about the scale of efforts.

    The file is wrong at joints whose effort has the scale of the other joints' efforts. The scale is unknown at joints
    where nothing shows it. Torques may be far below the file's limits for the motors, or several times as large.
    """
    scales = found.file_errors
    if scales:
        items = found.gained(list(scales))
        more = [{"scale": scale.value, "scale_std": scale.std} for scale in scales.values()]
        yield Ground("wrong_file", {"items": [a | b for a, b in zip(items, more, strict=True)]})
    if found.unjudged:
        yield Ground("unjudged_scale", {"items": [{"joint": found.names[k]} for k in found.unjudged]})
    limits = np.array([joint.limits.effort for joint in found.evidence.model.mechanism.leading_joints])
    known = np.isfinite(limits) & (limits > 0)
    if not known.any():
        return
    share = np.abs(found.evidence.torque).max(axis=0)[known] / limits[known]
    low, high = found.limits.of_limit
    if share.max() < low or share.max() > high:
        yield Ground("unlike_limits", {"share": float(share.max())})


def _lacking(found: Findings) -> Iterator[Ground]:
    """Residuals beyond noise that are correlated, or many times the sensor's noise."""
    correlation = found.record.facts.get("residual_correlation", {})
    named = []
    for k, name in enumerate(found.names):
        ratio = found.noise_ratio(k)
        correlated = correlation.get(name, 0.0) > CORRELATED and not ratio < found.limits.sure
        if found.noticeable(k) and (correlated or ratio > found.limits.noise_ratio):
            named.append({"joint": name, "ratio": ratio})
    if named:
        factor = found.record.facts.get("noise_factor", float("nan"))
        yield Ground("lacking_effect", {"items": named, "factor": factor})


def _not_carried_over(found: Findings) -> Iterator[Ground]:
    named = [
        {
            "joint": name,
            "held_out": found.held_out[k].rmse,
            "fitted": found.fitted[k].rmse,
            "unit": found.unit(k),
        }
        for k, name in enumerate(found.names)
        if found.held_out[k].rmse
        > max(found.limits.worse * found.fitted[k].rmse, found.limits.carried * found.variation[k])
    ]
    if named:
        yield Ground("not_carried_over", {"items": named})


def _open_parameters(found: Findings) -> Iterator[Ground]:
    """Parameters that the data leave open, or determine so badly that it matters to the torque."""
    rows = found.record.parameters
    fixed = np.array([np.isfinite(row.std) for row in rows])
    unseen = [{"name": row.name} for row, seen in zip(rows, fixed, strict=True) if not seen]
    if unseen:
        yield Ground("open_parameters", {"items": unseen, "count": len(rows)})
    columns = found.evidence.columns()
    share = np.sqrt(np.mean(columns**2, axis=0)) / np.maximum(found.variation, 1e-300)[:, None]
    std = np.where(fixed, [row.std for row in rows], 0.0)
    badly = np.flatnonzero(
        np.max(share * std, axis=0, initial=0.0, where=found.moved()) > found.limits.settled
    )
    if len(badly):
        names = ("name", "value", "std", "unit")
        yield Ground(
            "known_badly", {"items": [{name: getattr(rows[j], name) for name in names} for j in badly]}
        )
