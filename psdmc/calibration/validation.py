"""The function `psdmc.validate`: tests whether a calibrated model still predicts the torques of its robot in new logs.

psdmc fits changes of all calibrated values to the difference between measured and predicted torque. A chi-square test
with the covariances of the file and of the new logs distinguishes a change of the robot from chance. If the robot has
changed, psdmc determines which few values explain the difference.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from scipy import stats

from psdmc.calibration.campaign_file import tested_logs
from psdmc.calibration.description.description import FitChoice
from psdmc.calibration.identify.linear_fit import calibrate_linear
from psdmc.calibration.identify.motor_model import Motors, motors_of_logs, one_quantity
from psdmc.calibration.identify.predictor import ChainRegressor, Regressor
from psdmc.calibration.identify.residuals import qualities
from psdmc.calibration.identify.steps import judged
from psdmc.calibration.logs.foreign_bytes import listed
from psdmc.calibration.logs.log import AnyLog, Array
from psdmc.calibration.sources import LogNaming, campaign_of, log_sources
from psdmc.calibration.verdict.changes import CHANCE, MOST_NAMED, Change, Changes, Explanation, LoadChange
from psdmc.calibration.verdict.delivered import Delivered, PredictedRows, delivered, predicted_rows, reread
from psdmc.calibration.verdict.judge import with_verdict_on_logs
from psdmc.calibration.verdict.record import (
    judged_record,
    linear_record,
    logs_used,
    verdict_of,
    with_data,
)
from psdmc.calibration.verdict.verdict_limits import VerdictOptions
from psdmc.errors import InputError
from psdmc.model.calibrated import (
    NOT_USABLE_STATUS,
    LogUsed,
    OrNaN,
    Remark,
    StepQuality,
    Verdict,
)
from psdmc.model.calibrated_json import plain
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.grounds import Ground
from psdmc.model.load import model_of
from psdmc.progress import Progress, silent

Word = Literal["still valid", "drifted", "changed load", "log not usable"]
CHANGED_STATUS = 5
"""Exit status of `psdmc validate` if the robot has changed."""
MOST_WITH_LOAD = 2
"""Further changes beside a load whose torques look like another unit's."""
MOST_LINKS = 2
"""Base parameters among the named changes of a robot whose links are the same, with a cable or a part added."""
BINS = 10
"""Of speed and time, in which errors are averaged."""
SAID = (
    "perhaps_saturated",
    "late",
    "sampled_slowly",
    "few_samples",
    "starved",
    "hardly_moving",
    "lacking_effect",
)
"""Doubts of a verdict on a calibration that also matter to a validation."""


@dataclass(frozen=True, slots=True)
class Bin:
    """Errors (measured minus predicted torque) of a group of samples: their middle speed or time, mean and RMS."""

    at: float
    mean: float
    rms: float


@dataclass(frozen=True, slots=True)
class JointError:
    """How well a model file predicts the torque of one joint in new logs. Torques are in N m (N), and also in A if a
    torque constant is known; else the values in A are NaN.

    refitted_r2        R^2 that a new calibration could reach: calibrated values are fitted to these logs, R^2 is that
                       of the last 30 %
    forward, backward  mean error in either direction of motion
    by_speed, by_time  errors by signed speed (rad/s, m/s), and by time since a log's start (s)
    """

    joint: str
    unit: str
    r2: OrNaN
    rms: float
    largest: float
    rms_current: OrNaN
    largest_current: OrNaN
    refitted_r2: OrNaN
    forward: OrNaN
    backward: OrNaN
    by_speed: tuple[Bin, ...]
    by_time: tuple[Bin, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Validation:
    """The result of `validate`: whether a calibrated model is still valid, with all figures.

    word             the verdict: "still valid", "drifted", "changed load" or "log not usable"
    reasons          why the logs are not usable; empty if they are
    doubts           what a user should know before relying on the verdict
    load             change of the load at the tip that explains the logs; None: no load does
    named            the few changed values that explain the logs, the most certain first
    joints           errors of the predicted torque by joint
    changes          change of every calibrated value
    chi2, freedom    chi-square and degrees of freedom of all changes
    left             chi-square after subtraction of `load` and `named`
    chance           probability of such changes if the robot is unchanged
    logs, r2_by_log  names and lengths of the logs; R^2 by log and joint
    quality          samples to plot, which JSON does not hold
    """

    robot: str
    word: Word
    reasons: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    load: LoadChange | None = None
    named: tuple[Change, ...] = ()
    joints: tuple[JointError, ...] = ()
    changes: tuple[Change, ...] = ()
    chi2: OrNaN = float("nan")
    freedom: int = 0
    chance: OrNaN = float("nan")
    left: OrNaN = float("nan")
    logs: tuple[LogUsed, ...] = ()
    r2_by_log: Mapping[str, tuple[OrNaN, ...]] = field(default_factory=dict)
    quality: StepQuality | None = None

    @property
    def exit_status(self) -> int:
        """Exit status of the command: 0, 5 if the robot has changed, or 6 if the logs are not usable."""
        statuses = {"still valid": 0, "log not usable": NOT_USABLE_STATUS}
        return statuses.get(self.word, CHANGED_STATUS)

    @property
    def grounds(self) -> tuple[tuple[str, str], ...]:
        """Pairs (kind, sentence) in the order in which a user should read them, doubts first."""
        found = [("doubt", text) for text in self.doubts]
        found += [("not usable", text) for text in self.reasons]
        found += [("load", self.load.words)] if self.load is not None else []
        return (*found, *(("changed", change.words) for change in self.named))

    def as_json(self) -> dict[str, Any]:
        """Return the result as plain values; numbers that are not finite become null."""
        values = asdict(replace(self, quality=None)) | {"exit_status": self.exit_status}
        del values["quality"]
        for row, change in zip(values["changes"], self.changes, strict=True):
            row["sigmas"] = change.sigmas
        codes = {
            name: [getattr(text, "code", "") for text in getattr(self, name)]
            for name in ("reasons", "doubts")
        }
        found: dict[str, Any] = plain(values | {"codes": codes})
        return found


def validate(
    model: DynamicsModel | str | Path,
    logs: str | Path | Sequence[str | Path],
    torque_constants: Mapping[str, float] | None = None,
    *,
    naming: LogNaming | None = None,
    regressor: Regressor | None = None,
    progress: Progress = silent,
) -> Validation:
    """Test a calibrated model on logs that were not used to calibrate it. Returns an object with the verdict and the
    errors of the torques.

    The attribute `word` of the result is the verdict: "still valid", "drifted" (the robot has changed), "changed load" or
    "log not usable". If the robot has changed, the attribute `load` is the change of the load at the tip (None: unchanged),
    and the attribute `named` lists the other changed parameters.

    model             a calibrated model, or the path of its file
    logs              paths of logs, the path of a log description (TOML), or a campaign folder (planned motions and their
                      logs) that `psdmc excite` wrote. In a campaign folder, psdmc uses the logs of the motions that were
                      planned for validation. If there are none, psdmc uses the logs of the exciting motions (sums of sines)
                      without a load. psdmc gives one verdict on all logs together
    torque_constants  torque per current of each joint, for logs of motor currents: a dictionary from joint names to N m/A
                      at the joint (after the gear); None: those of the log description or of the model
    naming            names in the logs that differ from those of the model: psdmc.calibration.sources.LogNaming(topic,
                      joints). `topic` is the topic of the joint states in ROS bags. `joints` is a dictionary from joint
                      names in the logs to those of the model. None: no name differs
    regressor         result of psdmc.compile(model), which makes the fit faster; None: psdmc computes with NumPy
    progress          function, such as print, that psdmc calls with the name of each stage

    Raises InputError if a file is missing or cannot be read, or if the model is not calibrated.
    """
    known = reread(model) if isinstance(model, DynamicsModel) else model_of(model)
    found = delivered(known)
    progress("reading logs")
    read, constants = opened_logs(found, logs, naming or LogNaming(), progress)
    given = torque_constants or constants or found.constants
    motors = motors_of_logs(
        known.joint_names, read, (given or None) if one_quantity(read) == "current" else torque_constants
    )
    try:
        return _validated(found, read, motors, regressor or ChainRegressor(known), progress)
    except InputError as error:
        hint = f" ({error.hint})" if error.hint else ""
        reason = Remark(f"{error.message}{hint}", "refused")
        return Validation(known.mechanism.name, "log not usable", (reason,), logs=logs_used(read))


def opened_logs(
    found: Delivered, given: str | Path | Sequence[str | Path], naming: LogNaming, progress: Progress
) -> tuple[list[AnyLog], Mapping[str, float]]:
    """Return the logs of the given paths, and the torque constants (N m/A by joint name) of their log description.

    A path is a log, a log description, or a campaign folder. Of a campaign, the logs of the validation runs are used, or
    if there are none, those of the exciting motions without a load.
    """
    names = found.model.v_names
    paths = [Path(given)] if isinstance(given, str | Path) else [Path(path) for path in given]
    campaign = campaign_of(paths)
    if campaign is not None:
        paths = list(tested_logs(campaign, names))
    naming.require_bag(paths)
    read = log_sources(paths, (), names, found.linear, FitChoice(), naming, progress)
    return [replace(log, use="fit") for log in read.logs], read.constants


def _validated(
    found: Delivered, logs: Sequence[AnyLog], motors: Motors, regressor: Regressor, progress: Progress
) -> Validation:
    model, options = found.model, found.linear
    chain, kept = model.mechanism, model.calibrated
    assert kept is not None
    fit = calibrate_linear(chain, regressor, model.l, logs, options, motors, model.theta_b, progress)
    progress("verdict")
    record = with_data(linear_record(model, fit, fit.estimate.values, options), logs)
    record = judged_record(record, logs, check=options.check)
    own = verdict_of(
        with_verdict_on_logs(record, model, regressor, logs, motors, options.filter, VerdictOptions())
    )
    parts = [predicted_rows(found, log, options.check, motors) for log in logs]
    rows = PredictedRows(
        *(
            np.concatenate([getattr(p, name) for p in parts])
            for name in ("time", "qd", "measured", "predicted")
        )
    )
    test = Changes(found, fit, rows)
    refitted = [figures.r2 for figures in own.joints]
    result = Validation(
        robot=chain.name,
        word="still valid",
        joints=_joint_errors(found, motors, rows, refitted),
        changes=test.changes,
        chi2=test.chi2,
        freedom=test.freedom,
        chance=test.chance,
        logs=logs_used(logs),
        r2_by_log={
            log.name: tuple(q.r2 for q in qualities(p.measured, p.predicted))
            for log, p in zip(logs, parts, strict=True)
        },
        quality=judged(
            "All", chain.v_names, rows.time, rows.measured, rows.predicted, np.zeros(len(rows.time), bool)
        ),
    )
    why = (
        test.explanation()
        if test.chance < CHANCE and test.noticed
        else Explanation(np.zeros(test.size), np.zeros(test.size), left=test.chi2)
    )
    explained = qualities(rows.measured, rows.predicted + test.torque(why.values))
    r2 = dict(zip(chain.v_names, (q.r2 for q in explained), strict=True))
    against = [ground for ground in own.against if not _is_harmless(ground, own, r2, why)]
    harmless = [ground for ground in own.against if ground not in against]
    reasons = [
        Remark(ground.words, ground.code) for ground in (*against, *(own.suspected if against else ()))
    ]
    if not reasons and any(
        low < VerdictOptions().poor_r2 <= best for low, best in zip(r2.values(), refitted, strict=True)
    ):
        text = (
            f"no {MOST_NAMED} changed values and no load explain why the model does not predict the log: is the log another "
            "robot's, or has the robot been rebuilt? If so, calibrate again"
        )
        reasons = [Remark(text, "another_robot")]
    result = replace(result, left=why.left)
    doubts = (
        *_doubts(found, result, [*harmless, *own.doubted]),
        *(_doubts_of_changes(result, why, test, bool(reasons)) if test.chance < CHANCE else ()),
    )
    if reasons:
        return replace(result, word="log not usable", reasons=tuple(reasons), doubts=doubts)
    if why.load is None and not why.named:
        return replace(result, doubts=doubts)
    word: Word = "drifted" if why.load is None else "changed load"
    return replace(result, word=word, load=why.load, named=why.named, doubts=doubts)


def _is_harmless(ground: Ground, own: Verdict, r2: Mapping[str, float], why: Explanation) -> bool:
    """Return whether a ground that makes a log unfit for a calibration leaves it fit for a test. These are few samples, if
    the file and the explained changes predict them (r2, by joint), and torques of an odd size, if a load explains them."""
    limits = VerdictOptions()
    fair = all(value >= limits.fair_r2 for value in r2.values())
    if ground.code in ("wrong_gains", "contradicted"):
        heavy = all(suspect.code == "other_unit" for suspect in own.suspected)
        return fair and heavy and why.load is not None and why.chosen <= 1 + MOST_WITH_LOAD
    low = [item["joint"] for item in ground.values.get("items", ())] if ground.code == "low_r2" else []
    return (fair and ground.code == "starved") or (
        bool(low) and all(r2[joint] >= limits.poor_r2 for joint in low)
    )


def _doubts(found: Delivered, result: Validation, grounds: Sequence[Ground]) -> tuple[str, ...]:
    kept = found.model.calibrated
    assert kept is not None
    doubts = []
    used = {(log.log, log.rows, log.seconds) for log in kept.logs if log.use != "validate"}
    again = [log.log for log in result.logs if (log.log, log.rows, log.seconds) in used]
    if again:
        text = (
            f"{listed(again)}: looks like a log that the model was calibrated with: validate with another log"
        )
        doubts.append(Remark(text, "used_before"))
    if kept.covariance is None:
        text = (
            "the file has no covariance, so its parameters count as independent: calibrate again to get one"
        )
        doubts.append(Remark(text, "no_covariance"))
    if kept.verdict is not None and not kept.verdict.usable:
        doubts.append(Remark("the verdict on the calibration itself is: not usable", "not_usable"))
    return (*doubts, *(Remark(g.words, g.code) for g in grounds if g.code in SAID))


def _doubts_of_changes(result: Validation, why: Explanation, test: Changes, unusable: bool) -> list[Remark]:
    """Return remarks on what may be wrong with the explanation of a significant difference."""
    if not test.noticed:
        text = "values differ by more than noise, but the torque of these differences is too small to matter"
        return [Remark(text, "small_change")]
    links = [change.name for change in why.named if change.equation]
    found = []
    if why.load is None and not why.named and not unusable:
        text = (
            "values differ by more than noise, but none of them surely: the model may lack an effect that this motion "
            "shows; the report draws the errors against speed and time"
        )
        found.append(Remark(text, "none_sure"))
    elif stats.chi2.sf(result.left, result.freedom) < CHANCE:
        text = f"the changes named leave a chi-square of {result.left:.4g}: they do not explain all that is different"
        found.append(Remark(text, "unexplained"))
    if len(links) > MOST_LINKS and not unusable:
        text = f"{listed(links)} are of links, which do not wear: is the log another robot's, or has the robot been rebuilt?"
        found.append(Remark(text, "other_links"))
    elif test.refuses_load and (links or unusable):
        text = f"if the robot carries a load, this model cannot show it: {test.refuses_load}"
        found.append(Remark(text, "refuses_load"))
    return found


def _joint_errors(
    found: Delivered, motors: Motors, rows: PredictedRows, refitted: Sequence[float]
) -> tuple[JointError, ...]:
    error = rows.measured - rows.predicted
    given = dict(zip(found.model.v_names, motors.torque_constant.tolist(), strict=True))
    constants = found.constants or (given if np.any(motors.torque_constant != 1.0) else {})
    errors = []
    for k, joint in enumerate(found.model.mechanism.leading_joints):
        own, speed = error[:, k], rows.qd[:, k]
        rms, largest = float(np.sqrt(np.mean(own**2))), float(np.abs(own).max())
        per_ampere = abs(constants.get(joint.name, float("nan")))
        errors.append(
            JointError(
                joint=joint.name,
                unit=joint.type.effort_unit,
                r2=qualities(rows.measured, rows.predicted)[k].r2,
                rms=rms,
                largest=largest,
                rms_current=rms / per_ampere,
                largest_current=largest / per_ampere,
                refitted_r2=refitted[k],
                forward=_mean(own[speed > 0]),
                backward=_mean(own[speed < 0]),
                by_speed=_bins(speed, own),
                by_time=_bins(rows.time - rows.time[0] if np.all(np.diff(rows.time) > 0) else rows.time, own),
            )
        )
    return tuple(errors)


def _mean(values: Array) -> float:
    return float(np.mean(values)) if len(values) else float("nan")


def _bins(x: Array, error: Array) -> tuple[Bin, ...]:
    """Means over equally many samples each, by growing x."""
    order = np.argsort(x, kind="stable")
    return tuple(
        Bin(float(np.mean(x[own])), float(np.mean(error[own])), float(np.sqrt(np.mean(error[own] ** 2))))
        for own in np.array_split(order, BINS)
        if len(own)
    )
