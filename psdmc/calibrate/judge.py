"""The verdict on a calibration, from its record and from the log's own evidence.

What refuses: too few samples, a joint whose torque has the wrong size or sign beside the file's, friction that gives
power, held-out data that the model does not follow. What raises a doubt only: a fit that is fair, a joint that hardly
moves, an effect that the model lacks, parameters that the data leave open. docs/calibration.md lists the limits, decision
0021 says why.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.calibrate.evidence import Evidence
from psdmc.calibrate.gains import friction_powers, joint_gains
from psdmc.calibrate.least_squares import CORRELATED
from psdmc.calibrate.log import Array
from psdmc.calibrate.quality import Quality
from psdmc.calibrate.record import Calibration
from psdmc.calibrate.suspects import suspect
from psdmc.calibrate.units import unit_suspect
from psdmc.calibrate.verdict import JointFigures, Verdict, listed


@dataclass(frozen=True, slots=True)
class VerdictOptions:
    """The limits of a verdict.

    fewest_samples, few_samples   independent samples per fitted unknown: below, refused; doubted
    poor_r2, fair_r2              held-out R^2 of a joint's whole torque: below, refused; doubted
    gains, sure_gains             measured torque per torque by the file: outside, refused; doubted
    hardly                        rad/s (m/s) RMS, below which a joint hardly moves: friction's sign is not settled there
    noise_ratio                   residual over sensor noise above which the model lacks an effect
    worse                         held-out RMSE over fitted RMSE above which a fit does not carry over
    carried                       held-out RMSE over the torque's variation below which it does not matter that it is worse
    noticeable                    the same for an effect that the model lacks
    settled                       torque that one parameter's standard deviation stands for, over the torque's variation
    sure                          standard deviations by which friction's power must be negative
    friction_share                of the motor's power below which friction is not judged
    of_limit                      largest torque over the file's effort limit: doubted outside
    """

    fewest_samples: float = 8.0
    few_samples: float = 16.0
    poor_r2: float = 0.5
    fair_r2: float = 0.9
    gains: tuple[float, float] = (0.2, 5.0)
    sure_gains: tuple[float, float] = (0.5, 2.0)
    hardly: float = 0.03
    noise_ratio: float = 10.0
    worse: float = 2.0
    carried: float = 0.1
    noticeable: float = 0.02
    settled: float = 0.1
    sure: float = 3.0
    friction_share: float = 0.02
    of_limit: tuple[float, float] = (0.01, 3.0)


@dataclass(frozen=True, slots=True)
class Demand:
    """A step's independent samples that were fitted, and how many unknowns the data determined from them."""

    step: str
    samples: int
    unknowns: int

    @property
    def per_unknown(self) -> float:
        return self.samples / self.unknowns if self.unknowns else float("inf")


ALONE = ("Motor", "Friction")
"""Steps that excite one joint alone, so that each must be followed."""
NOT_PHYSICAL = "not_physical"
"""Fact of a record whose physically consistent version could not be found: why not."""
NOISE_FLOOR = 1e-4
"""Of the torque's variation: less noise above the cut-off is a log that was smoothed, or no sensor's."""


def judge(
    record: Calibration,
    evidence: Evidence,
    demands: Sequence[Demand],
    options: VerdictOptions | None = None,
) -> Verdict:
    """The verdict; `evidence` holds the model as it was before, whose theta_b is the file's."""
    return _Judge(record, evidence, tuple(demands), options or VerdictOptions()).verdict()


class _Judge:
    """One verdict under way: the figures once, then what they say."""

    def __init__(
        self, record: Calibration, evidence: Evidence, demands: tuple[Demand, ...], options: VerdictOptions
    ) -> None:
        self.record, self.evidence, self.demands, self.limits = record, evidence, demands, options
        self.names = record.joint_names
        self.gains = joint_gains(evidence)
        self.powers = friction_powers(evidence)
        self.variation: Array = np.std(evidence.torque, axis=0)
        self.speed: Array = np.sqrt(np.mean(evidence.qd**2, axis=0))
        self.fitted = [_whole_torque(record, name, held_out=False) for name in self.names]
        self.held_out = [_whole_torque(record, name, held_out=True) for name in self.names]

    def verdict(self) -> Verdict:
        reasons = [
            *self._unphysical(),
            *self._too_few(),
            *self._wrong_gains(),
            *self._powered(),
            *self._poor(),
        ]
        doubts = [*self._doubts()]
        named = [] if self._starved else [suspect(self.evidence), unit_suspect(self.gains)]
        suspects = tuple(text for text in named if text is not None)
        if suspects and not reasons:
            (reasons if self._in_doubt() else doubts).append("the log contradicts the model's joints")
        return Verdict(
            tuple(reasons),
            tuple(doubts),
            suspects,
            tuple(self._figures(k) for k in range(len(self.names))),
            min((demand.per_unknown for demand in self.demands), default=float("inf")),
        )

    @property
    def _starved(self) -> bool:
        return any(demand.per_unknown < self.limits.fewest_samples for demand in self.demands)

    def _in_doubt(self) -> bool:
        return any(True for _ in (*self._fair(), *self._odd_gains()))

    def _too_few(self) -> Iterator[str]:
        for demand in self.demands:
            if demand.per_unknown < self.limits.fewest_samples:
                yield (
                    f"{demand.samples} independent samples for {demand.unknowns} unknowns ({demand.step}): "
                    f"{demand.per_unknown:.1f} each, at least {self.limits.fewest_samples:g} are needed"
                )

    def _unphysical(self) -> Iterator[str]:
        failed = self.record.facts.get(NOT_PHYSICAL)
        if failed:
            yield f"no mass distribution of a real robot is near the fit ({failed})"

    def _wrong_gains(self) -> Iterator[str]:
        low, high = self.limits.gains
        wrong = [k for k, gain in enumerate(self.gains) if gain.visible and not low <= gain.value <= high]
        if wrong:
            yield (
                f"measured torque over the torque by the file's parameters: {self._gained(wrong)}; "
                f"expected {low:g} to {high:g}"
            )

    def _gained(self, joints: Sequence[int]) -> str:
        words = [f"{self.gains[k].value:.3g} +- {self.gains[k].std:.1g}" for k in joints]
        return listed([f"joint {self.names[k]} {word}" for k, word in zip(joints, words, strict=True)])

    def _powered(self) -> Iterator[str]:
        motor = self.limits.friction_share * self.variation * self.speed
        giving = [
            f"joint {self.names[k]} {power.value:.2g} +- {power.std:.1g} W"
            for k, power in enumerate(self.powers)
            if power.value < -max(self.limits.sure * power.std, motor[k])
        ]
        if giving:
            yield (
                f"friction would give power instead of taking it: {listed(giving)}: "
                "effort and motion have opposite signs there, or belong to different joints"
            )

    def _poor(self) -> Iterator[str]:
        poor = [k for k in range(len(self.names)) if self._follows_badly(k)]
        found = [k for k in poor if not self._excused(k)]
        if found:
            yield f"R^2 on held-out data below {self.limits.poor_r2:g}: {self._followed(found)}"
        elif len(poor) == len(self.names):
            yield f"no joint's torque is followed: R^2 on held-out data {self._followed(poor)}"

    def _followed(self, joints: Sequence[int]) -> str:
        return listed(
            [
                f"joint {self.names[k]} {self.held_out[k].r2:.3g} (RMSE {self.held_out[k].rmse:.3g} {self._unit(k)})"
                for k in joints
            ]
        )

    def _follows_badly(self, k: int) -> bool:
        """Also where R^2 is no number though there is a torque to follow."""
        return not self.held_out[k].r2 >= self.limits.poor_r2 and bool(self.variation[k] > 0)

    def _excused(self, k: int) -> bool:
        """A joint that hardly moves, or whose torque is sensor noise, has nothing to follow."""
        noise = float(self.evidence.noise[k])
        noisy = noise > NOISE_FLOOR * self.variation[k] and self.held_out[k].rmse < self.limits.sure * noise
        return bool(self.speed[k] < self.limits.hardly) or noisy

    def _doubts(self) -> Iterator[str]:
        yield from self._few()
        yield from self._fair()
        yield from self._earlier_steps()
        yield from self._odd_gains()
        yield from self._unlike_limits()
        yield from self._hardly_moving()
        yield from self._lacking()
        yield from self._not_carried_over()
        yield from self._open_parameters()
        yield from self._indefinite()
        if self.evidence.model.theta_b is None and not self.record.motors:
            yield "the file states no inertias: a wrong unit, or all signs turned, would show in friction only"

    def _few(self) -> Iterator[str]:
        for demand in self.demands:
            if self.limits.fewest_samples <= demand.per_unknown < self.limits.few_samples:
                yield (
                    f"{demand.samples} independent samples for {demand.unknowns} unknowns ({demand.step}): "
                    f"few, {self.limits.few_samples:g} each are sound"
                )

    def _fair(self) -> Iterator[str]:
        found = [
            k
            for k in range(len(self.names))
            if (self._follows_badly(k) and self._excused(k))
            or self.limits.poor_r2 <= self.held_out[k].r2 < self.limits.fair_r2
        ]
        if found:
            yield f"R^2 on held-out data below {self.limits.fair_r2:g}: {self._followed(found)}"

    def _earlier_steps(self) -> Iterator[str]:
        """Motors and friction; gravity and inertia alone may be too small at a joint to follow."""
        for step in self.record.steps[:-1]:
            found = [
                f"joint {name} {both.held_out.r2:.3g}"
                for name, both in step.joints.items()
                if step.step in ALONE and not both.held_out.r2 >= self.limits.fair_r2
            ]
            if found:
                yield f"R^2 on held-out data in step {step.step.lower()}: {listed(found)}"

    def _odd_gains(self) -> Iterator[str]:
        (low, high), (least, most) = self.limits.sure_gains, self.limits.gains
        odd = [
            k
            for k, gain in enumerate(self.gains)
            if gain.visible and least <= gain.value <= most and not low <= gain.value <= high
        ]
        if odd:
            yield f"measured torque over the torque by the file's parameters: {self._gained(odd)}"

    def _unlike_limits(self) -> Iterator[str]:
        """Torques that are no share of what the file says the motors can give, or several times that."""
        limits = np.array([joint.limits.effort for joint in self.evidence.model.chain.joints])
        known = np.isfinite(limits) & (limits > 0)
        if not known.any():
            return
        share = np.abs(self.evidence.torque).max(axis=0)[known] / limits[known]
        low, high = self.limits.of_limit
        if share.max() < low or share.max() > high:
            yield f"the largest torque is {share.max():.2g} times the file's effort limit: another unit?"

    def _hardly_moving(self) -> Iterator[str]:
        slow = [name for k, name in enumerate(self.names) if self.speed[k] < self.limits.hardly]
        if slow:
            yield (
                f"joint(s) {listed(slow)} hardly move (under {self.limits.hardly:g} rad/s or m/s RMS): "
                "their friction and drive inertia are not seen"
            )

    def _lacking(self) -> Iterator[str]:
        """Residuals beyond noise that are correlated, or many times the sensor's noise."""
        correlation = self.record.facts.get("residual_correlation", {})
        found = []
        for k, name in enumerate(self.names):
            ratio = self._noise_ratio(k)
            correlated = correlation.get(name, 0.0) > CORRELATED and not ratio < self.limits.sure
            if self._noticeable(k) and (correlated or ratio > self.limits.noise_ratio):
                found.append(name if np.isnan(ratio) else f"{name} ({ratio:.3g} times the sensor noise)")
        if found:
            yield (
                f"the model lacks an effect at joint(s) {listed(found)}: the residual is no sensor noise, "
                "so that standard deviations are too small"
            )

    def _not_carried_over(self) -> Iterator[str]:
        found = [
            f"joint {name} {self.held_out[k].rmse:.3g} and {self.fitted[k].rmse:.3g} {self._unit(k)}"
            for k, name in enumerate(self.names)
            if self.held_out[k].rmse
            > max(self.limits.worse * self.fitted[k].rmse, self.limits.carried * self.variation[k])
        ]
        if found:
            yield f"the fit does not carry over: RMSE on held-out and on fitted data: {listed(found)}"

    def _open_parameters(self) -> Iterator[str]:
        """What the data leave open, or know so badly that it matters to the torque."""
        rows = self.record.parameters
        fixed = np.array([np.isfinite(row.std) for row in rows])
        unseen = [row.name for row, seen in zip(rows, fixed, strict=True) if not seen]
        if unseen:
            yield (
                f"{len(unseen)} of {len(rows)} base parameters are not fixed by the data: {_some(unseen)} "
                "stay near the file's values, or zero"
            )
        columns = self.evidence.columns()
        share = np.sqrt(np.mean(columns**2, axis=0)) / np.maximum(self.variation, 1e-300)[:, None]
        std = np.where(fixed, [row.std for row in rows], 0.0)
        badly = np.flatnonzero(
            np.max(share * std, axis=0, initial=0.0, where=self._moved()) > self.limits.settled
        )
        if len(badly):
            named = _some(
                [f"{rows[j].name} ({rows[j].value:.3g} +- {rows[j].std:.2g} {rows[j].unit})" for j in badly]
            )
            yield f"{len(badly)} base parameter(s) are known badly: {named}: other motions may fit worse than this one"

    def _indefinite(self) -> Iterator[str]:
        """What the model file cannot do, where that was tested."""
        mass = self.record.facts.get("mass_matrix", {})
        if mass.get("failing"):
            yield (
                f"the mass matrix is not positive definite in {mass['failing']} of {mass['poses']} poses: "
                "there is no forward dynamics"
            )

    def _moved(self) -> NDArray[np.bool_]:
        return np.asarray((self.speed >= self.limits.hardly) & (self.variation > 0))[:, None]

    def _noticeable(self, k: int) -> bool:
        return bool(self.held_out[k].rmse > self.limits.noticeable * self.variation[k])

    def _noise_ratio(self, k: int) -> float:
        noise = float(self.evidence.noise[k])
        known = noise > NOISE_FLOOR * self.variation[k]
        return self.held_out[k].rmse / noise if known else float("nan")

    def _unit(self, k: int) -> str:
        return "N m" if self.evidence.model.chain.joints[k].kind == "revolute" else "N"

    def _figures(self, k: int) -> JointFigures:
        gain, power = self.gains[k], self.powers[k]
        return JointFigures(
            joint=self.names[k],
            r2=self.held_out[k].r2,
            rmse=self.held_out[k].rmse,
            gain=gain.value,
            gain_std=gain.std,
            visible=gain.visible,
            friction_power=power.value,
            friction_power_std=power.std,
            noise_ratio=self._noise_ratio(k),
            speed=float(self.speed[k]),
        )


def _whole_torque(record: Calibration, joint: str, held_out: bool) -> Quality:
    """Of the last step: there the whole torque is predicted."""
    both = record.steps[-1].joints.get(joint)
    if both is None:
        return Quality(float("nan"), float("nan"))
    return both.held_out if held_out else both.fit


MOST_LISTED = 4
"""Names in one line; the rest is counted."""


def _some(names: Sequence[str]) -> str:
    if len(names) <= MOST_LISTED:
        return listed(names)
    return f"{', '.join(names[:MOST_LISTED])} and {len(names) - MOST_LISTED} more"
