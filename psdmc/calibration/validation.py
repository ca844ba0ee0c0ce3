"""`psdmc.validate`: whether a calibrated model still predicts the torques of its robot; if not, what has changed.

The regressor and friction columns of a calibration estimate what the file's prediction leaves of the measured torque. The
chi-square of these changes, by the covariances of the file and of the new logs, tells a change of the robot from chance.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from scipy import stats

from psdmc.calibration.campaign_file import plain_logs, read_campaign
from psdmc.calibration.description.table_fit import FitChoice
from psdmc.calibration.identify.estimate import Estimate
from psdmc.calibration.identify.least_squares import estimate_rows
from psdmc.calibration.identify.linear_fit import LinearResult, calibrate_linear
from psdmc.calibration.identify.motor_constants import motors_of_logs, one_quantity
from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.identify.predictor import ChainRegressor, Regressor
from psdmc.calibration.identify.quality import qualities
from psdmc.calibration.identify.steps import judged
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.stored_log import AnyLog
from psdmc.calibration.logs.wording import listed
from psdmc.calibration.sources import LogNaming, campaign_of, log_sources
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
    by_joint,
)
from psdmc.model.calibrated_json import plain
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.grounds import Ground, OrInf
from psdmc.model.load import model_of
from psdmc.model.payload import load_map
from psdmc.progress import Progress, silent

Word = Literal["still valid", "drifted", "changed load", "log not usable"]
CHANGED_STATUS = 5
"""Exit status of `psdmc validate` if the robot has changed."""
CHANCE = 1e-3
"""Probability of a chi-square as large in an unchanged robot, below which a change counts: one false alarm in a thousand
logs."""
NOTICED = 0.5
"""Torque of all changes, as a share of the error that remains, from which they count: some joint's RMS error is then larger
by an eighth than that of a new fit, on samples that this fit did not use. A smaller change does not matter."""
MINOR = 0.1
"""The same share for one of several changes to be named."""
SURE = 3.0
"""Standard deviations that a named change has at least."""
MOST_NAMED = 8
"""Changes that an explanation may have. More than that is another robot, not a worn one."""
MOST_WITH_LOAD = 2
"""Further changes beside a load whose torques look like another unit's."""
RESOLVED = 1e-3
"""Share of a load's mass that may be seen as something else."""
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
    """Errors, measured minus predicted torque, of some samples: their middle speed or time, mean and RMS."""

    at: float
    mean: float
    rms: float


@dataclass(frozen=True, slots=True)
class JointError:
    """How well the file predicts one joint; N m (N), and A if a torque constant is known, else NaN.

    refitted_r2        of a fit of the same columns to these logs, on their last 30 %: what a new calibration would reach
    forward, backward  mean error in either direction
    by_speed, by_time  errors against signed speed (rad/s, m/s), and against time since a log's start (s)
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


@dataclass(frozen=True, slots=True)
class Change:
    """One value of the file, and what the logs say of it.

    value, change, std  of the file, and by the logs minus that of the file, with its standard deviation. std is infinite if
                        the logs do not show the value by itself
    torque              largest RMS over the joints of the torque of this change, N m (N)
    """

    name: str
    equation: str
    unit: str
    value: float
    change: float
    std: OrInf
    torque: float

    @property
    def sigmas(self) -> float:
        return self.change / self.std if self.std else 0.0

    @property
    def words(self) -> str:
        share = f" ({self.change / self.value:+.0%})" if self.value else ""
        return (
            f"{self.name}: {self.value:.4g} -> {self.value + self.change:.4g} {self.unit}{share}, "
            f"{self.sigmas:+.1f} standard deviations"
        )


@dataclass(frozen=True, slots=True)
class LoadChange:
    """A load at the tip that explains the logs; negative if one was taken off. kg, and (3,) m in the tip's frame, NaN
    for what the logs do not show."""

    mass: float
    mass_std: float
    com: tuple[OrNaN, ...]
    frame: str

    @property
    def words(self) -> str:
        place = ", ".join("not seen" if math.isnan(value) else f"{value:.3f}" for value in self.com)
        return f"a load of {self.mass:+.3g} +- {self.mass_std:.2g} kg on {self.frame!r}, its centre of mass at ({place}) m"


@dataclass(frozen=True, slots=True, eq=False)
class Validation:
    """Whether a calibrated model is still valid, with all figures.

    reasons        why the logs are not usable; empty if they are
    doubts         what a user should know before relying on the verdict
    named          the few changes that explain the logs, the most certain first; load: the one that does
    changes        of every value, each by itself
    chi2, freedom  of all changes, and of what the explanation leaves (left)
    chance         probability of such changes if the robot is unchanged
    logs, r2_by_log   names and lengths; R^2 by log and joint
    quality        samples to plot, which JSON does not hold
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
        """0, 5 if the robot has changed, 6 if the logs are not usable."""
        statuses = {"still valid": 0, "log not usable": NOT_USABLE_STATUS}
        return statuses.get(self.word, CHANGED_STATUS)

    @property
    def grounds(self) -> tuple[tuple[str, str], ...]:
        """(kind, sentence), in the order in which a user should read them: doubts first."""
        found = [("doubt", text) for text in self.doubts]
        found += [("not usable", text) for text in self.reasons]
        found += [("load", self.load.words)] if self.load is not None else []
        return (*found, *(("changed", change.words) for change in self.named))

    def as_json(self) -> dict[str, Any]:
        """Plain values for a user; numbers that are not finite become null."""
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
    """Test a calibrated model on logs that were not used to calibrate it. Returns an object with the verdict and figures.

    The attribute `word` of the result is "still valid", "drifted", "changed load" or "log not usable". If the robot has
    changed, the attributes `load` and `named` say what explains the logs.

    model             a calibrated model, or the path of its file
    logs              paths of logs, of a log description (TOML), or of a campaign folder, of which psdmc uses the exciting
                      motions without a load. psdmc judges all logs together
    torque_constants  N m/A at the joint (after the gear) by joint name, for logs of motor currents; None: those of the log
                      description or of the model
    naming            topic and joint names of the logs
    regressor         function that computes the regressor of the robot; None: psdmc computes it in NumPy
    progress          function, such as print, that psdmc calls with the name of each stage

    Raises InputError if a file is missing or cannot be read, or if the model is not calibrated.
    """
    known = reread(model) if isinstance(model, DynamicsModel) else model_of(model)
    found = delivered(known)
    progress("reading logs")
    read, constants = opened_logs(found, logs, naming or LogNaming(), progress)
    given = torque_constants or constants or found.constants
    try:
        motors = motors_of_logs(
            known.joint_names, read, (given or None) if one_quantity(read) == "current" else None
        )
        return _validated(found, read, motors, regressor or ChainRegressor(known), progress)
    except InputError as error:
        hint = f" ({error.hint})" if error.hint else ""
        reason = Remark(f"{error.message}{hint}", "refused")
        return Validation(known.mechanism.name, "log not usable", (reason,), logs=logs_used(read))


def opened_logs(
    found: Delivered, given: str | Path | Sequence[str | Path], naming: LogNaming, progress: Progress
) -> tuple[list[AnyLog], Mapping[str, float]]:
    """The logs, and a description's torque constants."""
    names = found.model.joint_names
    paths = [Path(given)] if isinstance(given, str | Path) else [Path(path) for path in given]
    campaign = campaign_of(paths)
    if campaign is not None:
        plain_ones = plain_logs(campaign, names)
        if plain_ones is None:
            own = [run.log for run in read_campaign(campaign, names).inertial if run.tool is None]
            if not own:
                raise InputError(
                    f"{campaign}: no exciting motion without a load", "give logs, not the campaign"
                )
            return list(own), {}
        paths = list(plain_ones)
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
    test = _Test(found, fit, rows)
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
            "All", chain.joint_names, rows.time, rows.measured, rows.predicted, np.zeros(len(rows.time), bool)
        ),
    )
    has_changed = test.chance < CHANCE and test.noticed
    why = test.explanation() if has_changed else _Explanation(np.zeros(test.size), left=test.chi2)
    explained = qualities(rows.measured, rows.predicted + test.torque(why.values))
    r2 = dict(zip(chain.joint_names, (q.r2 for q in explained), strict=True))
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
    doubts = _doubts(found, result, [*harmless, *own.doubted], test)
    if reasons:
        return replace(result, word="log not usable", reasons=tuple(reasons), doubts=doubts)
    if has_changed:
        word: Word = "drifted" if why.load is None else "changed load"
        result = replace(result, word=word, load=why.load, named=why.named)
    return replace(result, doubts=doubts)


def _is_harmless(ground: Ground, own: Verdict, r2: Mapping[str, float], why: _Explanation) -> bool:
    """Whether what makes a log unfit for a calibration leaves it fit for a test: few samples, if the file and the explained
    changes predict them (r2, by joint), and torques of an odd size, if a load explains them."""
    limits = VerdictOptions()
    fair = all(value >= limits.fair_r2 for value in r2.values())
    if ground.code in ("wrong_gains", "contradicted"):
        heavy = all(suspect.code == "other_unit" for suspect in own.suspected)
        return fair and heavy and why.load is not None and why.chosen <= 1 + MOST_WITH_LOAD
    low = [item["joint"] for item in ground.values.get("items", ())] if ground.code == "low_r2" else []
    return (fair and ground.code == "starved") or (
        bool(low) and all(r2[joint] >= limits.poor_r2 for joint in low)
    )


def _doubts(found: Delivered, result: Validation, grounds: Sequence[Ground], test: _Test) -> tuple[str, ...]:
    kept = found.model.calibrated
    assert kept is not None
    doubts = []
    used = {(log.log, log.rows, log.seconds) for log in kept.logs}
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
    if test.noticed and result.chance < CHANCE and stats.chi2.sf(result.left, result.freedom) < CHANCE:
        text = f"the changes named leave a chi-square of {result.left:.4g}: they do not explain all that is different"
        doubts.append(Remark(text, "unexplained"))
    if result.chance < CHANCE and not test.noticed:
        text = (
            f"values differ significantly (chi-square {result.chi2:.4g} of {result.freedom} degrees of freedom), but the "
            "torque of these differences is small compared with the error that a new calibration would leave"
        )
        doubts.append(Remark(text, "small_change"))
    return (*doubts, *(Remark(g.words, g.code) for g in grounds if g.code in SAID))


def _joint_errors(
    found: Delivered, motors: Motors, rows: PredictedRows, refitted: Sequence[float]
) -> tuple[JointError, ...]:
    error = rows.measured - rows.predicted
    given = dict(zip(found.model.joint_names, motors.torque_constant.tolist(), strict=True))
    constants = found.constants or (given if np.any(motors.torque_constant != 1.0) else {})
    errors = []
    for k, joint in enumerate(found.model.mechanism.joints):
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


# What has changed


@dataclass(frozen=True, slots=True, eq=False)
class _Explanation:
    """A load and changes of single values, `chosen` of them; values (u,) of the whole vector; left: the chi-square that
    remains."""

    values: Array
    load: LoadChange | None = None
    named: tuple[Change, ...] = ()
    left: OrNaN = float("nan")
    chosen: int = 0


class _Test:
    """The change of all u values of a file, theta_b first, by some logs.

    white     (r,)    changes in the directions that the logs show, in variances of file and logs together
    by_value  (r, u)  the same of a unit change of each value
    """

    def __init__(self, found: Delivered, fit: LinearResult, rows: PredictedRows) -> None:
        problem = fit.problem
        self.found, self.fit, self.rows = found, fit, rows
        use = np.repeat(~problem.held_out[:, None], len(problem.chain), axis=1)
        prior = replace(fit.prior, values=np.zeros_like(fit.prior.values))
        residual = rows.measured - rows.predicted
        options = found.linear.fit
        solved = estimate_rows(problem.rows, residual, options, None, use, prior)
        scale = solved.scale
        together = solved.total_covariance + _file_covariance(found, fit, solved)
        hidden = solved.unseen.shape[1]
        shown = np.linalg.qr(solved.unseen, mode="complete")[0][:, hidden:]
        lower = np.linalg.cholesky(shown.T @ (together / np.outer(scale, scale)) @ shown)
        self.by_value: Array = np.asarray(np.linalg.solve(lower, shown.T / scale))
        self.white: Array = self.by_value @ solved.values
        self.chi2, self.freedom, self.size = float(self.white @ self.white), len(self.white), len(scale)
        left = residual - self.torque(solved.values)
        self.noise: Array = np.maximum(np.sqrt(np.mean(left**2, axis=0)), np.finfo(float).tiny)
        before, after = (np.mean(part[problem.held_out] ** 2, axis=0) for part in (residual, left))
        self.noticed = bool(np.any(before > (1.0 + NOTICED**2) * after))
        squares = sum(np.sum(block.columns**2, axis=0) for block in problem.rows)
        self.effect: Array = np.asarray(np.sqrt(squares / len(residual)))
        seen = np.sum(solved.unseen**2, axis=1) < options.unseen_share
        self.std: Array = np.where(seen, np.sqrt(np.diag(together)), np.inf)
        self.changes = tuple(
            self._change(k, float(solved.values[k]), float(self.std[k])) for k in range(len(scale))
        )

    @property
    def chance(self) -> float:
        """Probability that an unchanged robot has as large a chi-square, or a single value with as large a change."""
        sizes = np.linalg.norm(self.by_value, axis=0)
        alone = (self.by_value.T @ self.white) / np.where(sizes > 0.0, sizes, np.inf)
        single = len(sizes) * stats.chi2.sf(np.max(alone**2, initial=0.0), 1)
        return float(min(1.0, 2.0 * min(stats.chi2.sf(self.chi2, self.freedom), single)))

    def torque(self, values: Array) -> Array:
        """(N, n) of a change of all values."""
        return np.concatenate([block.columns @ values for block in self.fit.problem.rows])

    def _change(self, k: int, change: float, std: float) -> Change:
        model, problem = self.found.model, self.fit.problem
        torque = float(np.max(self.effect[:, k])) * abs(change)
        if k < model.l:
            row = model.base_parameters[k]
            value = float(model.known_theta_b()[k])
            return Change(f"theta_b[{k}]", row.equation, row.unit, value, change, std, torque)
        kept = model.calibrated
        assert kept is not None
        owners = [*problem.plain, *((unknown.owner, unknown.name) for unknown in problem.columns.unknowns)]
        owner, name = owners[k - model.l]
        rows = {(row.joint, row.name): row for row in (*kept.friction, *kept.springs)}
        row_of = rows.get((owner, name))
        unit = "" if row_of is None else row_of.unit
        value = 0.0 if row_of is None else row_of.value
        return Change(f"{name} of {owner}", "", unit, value, change, std, torque)

    def explanation(self) -> _Explanation:
        """Add the load, or the single value, that explains the most, until no other explains more than chance.

        A load has more parameters than a single value, which explain more by chance, so each parameter has its price. But
        what is mounted on a robot changes sooner than a link: if a load is possible, a base parameter costs as much.
        """
        price = float(stats.chi2.isf(CHANCE / self.size, 1))
        blocks = {k: self.by_value[:, [k]] for k in range(self.size) if self.by_value[:, k].any()}
        onto = self._load_onto_values()
        cost = price
        if onto is not None and self._mass_is_sure(load := self.by_value @ onto):
            blocks[LOAD] = load
            cost = price * float(
                np.linalg.matrix_rank(load / np.maximum(np.linalg.norm(load, axis=0), 1e-300))
            )
        chosen: list[int] = []
        while len(chosen) < MOST_NAMED:
            left = self._left(blocks, chosen)
            links = price if LOAD in chosen else cost
            gains = {
                k: left @ left - np.sum(self._left(blocks, [*chosen, k]) ** 2)
                for k in blocks
                if k not in chosen
            }
            gains = {
                k: gain - (links if k < self.found.model.l else price)
                for k, gain in gains.items()
                if gain > price
            }
            if not gains:
                break
            chosen.append(max(gains, key=lambda k: gains[k]))
        return self._delivered(blocks, chosen, onto)

    def _left(self, blocks: Mapping[int, Array], chosen: Sequence[int]) -> Array:
        """(r,) what changes of the chosen blocks leave."""
        if not chosen:
            return self.white
        return np.asarray(self.white - (a := _joined(blocks, chosen)) @ _solved(a, self.white)[0])

    def _mass_is_sure(self, block: Array) -> bool:
        """Whether the logs show a load's mass by itself, and it is not zero."""
        values, covariance = _solved(block, self.white)
        return bool(_resolved(block, 0) and abs(values[0]) > SURE * np.sqrt(covariance[0, 0]) > 0.0)

    def _load_onto_values(self) -> Array | None:
        """(u, 10) change of all values per load parameter; None if the model admits no load at its tip."""
        model = self.found.model
        try:
            onto = load_map(model.mechanism, model.B, model.mechanism.tip_frame)
        except InputError:
            return None
        return np.concatenate([onto, np.zeros((self.by_value.shape[1] - model.l, onto.shape[1]))])

    def _delivered(
        self, blocks: Mapping[int, Array], chosen: Sequence[int], onto: Array | None
    ) -> _Explanation:
        whole = np.zeros(self.by_value.shape[1])
        if not chosen:
            return _Explanation(whole, left=self.chi2)
        values, covariance = _solved(_joined(blocks, chosen), self.white)
        std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        load, named, first = None, [], 0
        for k in chosen:
            own = slice(first, first + blocks[k].shape[1])
            first = own.stop
            if k == LOAD and onto is not None:
                whole += onto @ values[own]
                mass = float(values[own][0])
                shown = [_resolved(blocks[k], axis) for axis in (1, 2, 3)]
                com = tuple(np.where(shown, values[own][1:4] / mass, np.nan).tolist())
                load = LoadChange(mass, float(std[own][0]), com, self.found.model.mechanism.tip_name)
                continue
            whole[k] += values[own][0]
            change = self._change(k, float(values[own][0]), float(std[own][0]))
            if (
                np.any(self.effect[:, k] * abs(change.change) > MINOR * self.noise)
                and abs(change.sigmas) > SURE
            ):
                named.append(change)
        left = self._left(blocks, chosen)
        return _Explanation(whole, load, tuple(named), float(left @ left), len(chosen))


LOAD = -2
"""The block of a load's ten parameters among those of single values."""


def _joined(blocks: Mapping[int, Array], chosen: Sequence[int]) -> Array:
    return np.concatenate([blocks[k] for k in chosen], axis=1)


def _solved(columns: Array, white: Array) -> tuple[Array, Array]:
    """Least-squares values of columns, and their covariance; of what the columns do not show nothing."""
    sizes = np.linalg.norm(columns, axis=0)
    sizes[sizes == 0.0] = 1.0
    inverse = np.linalg.pinv(columns / sizes, rcond=1e-9) / sizes[:, None]
    return np.asarray(inverse @ white), np.asarray(inverse @ inverse.T)


def _resolved(columns: Array, k: int) -> bool:
    """Whether the value of column k shows by itself."""
    return bool(abs(_solved(columns, columns[:, k])[0][k] - 1.0) < RESOLVED)


def _file_covariance(found: Delivered, fit: LinearResult, solved: Estimate) -> Array:
    """(u, u) of the file's values. Friction, of which files keep standard deviations only, is taken as correlated like the
    new logs' friction is, and as independent of theta_b; what the file does not know as far off as is believable."""
    kept, l = found.model.calibrated, found.model.l
    assert kept is not None
    problem = fit.problem
    believable = found.linear.fit.seen * solved.scale
    stds = by_joint(replace(row, value=row.std) for row in (*kept.friction, *kept.springs))
    owners = [*problem.plain, *((unknown.owner, unknown.name) for unknown in problem.columns.unknowns)]
    std = np.array([*kept.std, *(stds.get(owner, np.inf) for owner in owners)])
    std = np.where(np.isfinite(std) & (std > 0.0), std, believable)
    sizes = np.sqrt(np.diag(solved.total_covariance))
    sizes[sizes == 0.0] = np.inf
    covariance = solved.total_covariance / np.outer(sizes, sizes)
    np.fill_diagonal(covariance, 1.0)
    covariance *= np.outer(std, std)
    covariance[:l, l:] = covariance[l:, :l] = 0.0
    covariance[:l, :l] = np.diag(std[:l] ** 2)
    if kept.covariance is not None:
        own = np.sqrt(np.diag(kept.covariance))
        missing = np.where(own > 0.0, 0.0, believable[:l])
        covariance[:l, :l] = kept.covariance + np.diag(missing**2)
    return np.asarray(covariance)
