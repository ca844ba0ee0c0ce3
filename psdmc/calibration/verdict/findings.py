"""Computes the figures for a verdict's reasons and doubts, joint by joint, from a calibration's result (record) and
its log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.logs.log import Array
from psdmc.calibration.verdict.effort_checks import SETTLED, delays_of, friction_powers, joint_gains
from psdmc.calibration.verdict.evidence import Evidence
from psdmc.calibration.verdict.log_errors import EffortScale, effort_scale
from psdmc.calibration.verdict.record import Calibration
from psdmc.calibration.verdict.suspects import ABOUT
from psdmc.calibration.verdict.verdict_limits import VerdictOptions
from psdmc.model.calibrated import JointFigures, Quality

NOISE_FLOOR = 1e-4
"""Share of the torque's variation: less noise above the cut-off means a log that was smoothed, or that is no sensor's."""

LIKELIER = 5.0
"""Logarithm of the likelihood by which a scale of the effort that agrees with other joints exceeds all scales that would
explain an unusual gain, or an unusual scale all scales that are not."""


@dataclass(frozen=True, slots=True)
class Demand:
    """The number of independent samples that one step of a calibration used, and the number of unknowns it determined."""

    step: str
    samples: int
    unknowns: int

    @property
    def per_unknown(self) -> float:
        return self.samples / self.unknowns if self.unknowns else float("inf")


class Findings:
    """Figures of a calibration and of its log, from which the verdict follows.

    delays            delay of the torque after the motion in each log, in addition to the delay that the calibration
                      found
    variation         (n,) standard deviation of each joint's torque
    speed             (n,) RMS speed of each joint
    fitted, held_out  RMSE and R^2 of each joint's whole torque, on fitted and on held-out samples
    file_errors       scale of the effort of each joint whose unusual gain is an error of the robot file, by joint
    overscaled        joints whose gain is not visible, but unusual, and other joints confirm that the effort's scale is
    unjudged          joints whose effort may have any scale: neither the robot file nor other joints show it
    """

    def __init__(
        self, record: Calibration, evidence: Evidence, demands: tuple[Demand, ...], options: VerdictOptions
    ) -> None:
        self.record, self.evidence, self.demands, self.limits = record, evidence, demands, options
        self.names = record.joint_names
        self.gains = joint_gains(evidence)
        self.powers = friction_powers(evidence)
        known = record.facts.get("delay_s", 0.0)
        self.delays = delays_of(evidence.regressor, evidence.shifted, evidence.coupling, known)
        self.variation: Array = np.std(evidence.torque, axis=0)
        self.speed: Array = np.sqrt(np.mean(evidence.qd**2, axis=0))
        # in the last step, where the whole torque is predicted
        whole, nothing = record.steps[-1].joints, Quality(float("nan"), float("nan"))
        self.fitted = [whole[name].fit if name in whole else nothing for name in self.names]
        self.held_out = [whole[name].held_out if name in whole else nothing for name in self.names]
        self.file_errors = self._file_errors()
        self.overscaled, self.unjudged = self._hidden_scales()

    def _file_errors(self) -> dict[int, EffortScale]:
        """Scales of the efforts that agree with other joints although their gain is unusual.

        A wrong unit scales all terms of a joint's torque. The base parameters that the joint shares with other joints then
        differ. If they agree, the file is wrong. The joint whose torque by the file is largest sets the unit.
        """
        least, most = self.limits.gains
        seen = {k: gain.value for k, gain in enumerate(self.gains) if gain.visible}
        agree = self._agreed()
        by_file = self.evidence.of_motors().file_torque()
        if by_file is None or all(least <= value <= most for value in seen.values()):
            return {}
        if int(np.std(by_file, axis=0).argmax()) not in agree:
            return {}
        found: dict[int, EffortScale] = {}
        while True:
            left = [k for k in seen if k not in agree and self.held_out[k].r2 >= self.limits.fair_r2]
            scales = {k: self._agreeing(k, agree) for k in left}
            new = {k: scale for k, scale in scales.items() if scale is not None}
            if not new:
                return found
            surest = min(new, key=lambda k: new[k].std / new[k].value)
            found[surest] = new[surest]
            agree.append(surest)

    def _agreed(self) -> list[int]:
        """Joints with a visible gain that is not unusual."""
        low, high = self.limits.sure_gains
        return [k for k, gain in enumerate(self.gains) if gain.visible and low <= gain.value <= high]

    def _hidden_scales(self) -> tuple[list[int], list[int]]:
        """The joints without a visible gain whose effort surely has an unusual scale, and those that nothing judges.

        A joint's torque by the file may be small beside the measured one because the effort is logged many times too
        large. The base parameters that the joint shares with other joints then confirm the gain.
        """
        odd: list[int] = []
        unjudged: list[int] = []
        if self.evidence.model.theta_b is None:
            return odd, unjudged
        (least, most), agreed = self.limits.gains, self._agreed()
        by_load = {row.joint for row in self.record.motors if row.seen}
        for k, gain in enumerate(self.gains):
            if gain.visible or self.names[k] in by_load or not self.moved()[k, 0]:
                continue
            scale = effort_scale(self.evidence, k, agreed, least, most) if agreed else None
            over = (0.0, 0.0) if scale is None else (scale.over_less, scale.over_more)
            settled = gain.std <= SETTLED * abs(gain.value)
            if settled and (
                (gain.value < least and over[0] < -LIKELIER) or (gain.value > most and over[1] < -LIKELIER)
            ):
                odd.append(k)
            elif min(over) <= LIKELIER:
                unjudged.append(k)
        return odd, unjudged

    def _agreeing(self, k: int, others: Sequence[int]) -> EffortScale | None:
        """The scale of joint k's effort if it is that of the other joints' efforts, and surely not the one of its gain."""
        gain, (low, high), (least, most) = self.gains[k], self.limits.sure_gains, self.limits.gains
        is_small = gain.value < 1.0
        least = min(least, max(ABOUT * gain.value, 0.0))
        most = max(most, gain.value / ABOUT)
        scale = effort_scale(self.evidence, k, others, least, most)
        if scale is None or not low <= scale.value <= high:
            return None
        spread = float(np.hypot(scale.std, ABOUT * gain.std if is_small else gain.std / ABOUT))
        away = scale.value - least if is_small else most - scale.value
        likelier = scale.over_less if is_small else scale.over_more
        return scale if likelier > LIKELIER and away > self.limits.sure * spread else None

    @property
    def starved(self) -> bool:
        return any(demand.per_unknown < self.limits.fewest_samples for demand in self.demands)

    def follows_badly(self, k: int) -> bool:
        """Return whether R^2 of joint k is too low, or not a number although there is a torque to predict."""
        return not self.held_out[k].r2 >= self.limits.poor_r2 and bool(self.variation[k] > 0)

    def excused(self, k: int) -> bool:
        """Return whether the torque of joint k need not be predicted: the joint hardly moves, or its torque is only
        noise."""
        noise = float(self.evidence.noise[k])
        noisy = noise > NOISE_FLOOR * self.variation[k] and self.held_out[k].rmse < self.limits.sure * noise
        return bool(self.speed[k] < self.limits.hardly) or noisy

    def noticeable(self, k: int) -> bool:
        return bool(self.held_out[k].rmse > self.limits.noticeable * self.variation[k])

    def noise_ratio(self, k: int) -> float:
        noise = float(self.evidence.noise[k])
        known = noise > NOISE_FLOOR * self.variation[k]
        return self.held_out[k].rmse / noise if known else float("nan")

    def moved(self) -> NDArray[np.bool_]:
        return np.asarray((self.speed >= self.limits.hardly) & (self.variation > 0))[:, None]

    def unit(self, k: int) -> str:
        return self.evidence.model.mechanism.leading_joints[k].type.effort_unit

    def gained(self, joints: Sequence[int]) -> list[dict[str, Any]]:
        """Return names, gains and standard deviations of some joints, as a verdict's reason or doubt lists them.

        The gain is the ratio of the measured torque to the torque from the robot file.
        """
        return [
            {"joint": self.names[k], "gain": self.gains[k].value, "std": self.gains[k].std} for k in joints
        ]

    def followed(self, joints: Sequence[int]) -> list[dict[str, Any]]:
        """Return names, R^2 and RMSE on held-out samples of some joints, as a verdict's reason or doubt lists them."""
        return [
            {
                "joint": self.names[k],
                "r2": self.held_out[k].r2,
                "rmse": self.held_out[k].rmse,
                "unit": self.unit(k),
            }
            for k in joints
        ]

    def figures(self, k: int) -> JointFigures:
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
            noise_ratio=self.noise_ratio(k),
            speed=float(self.speed[k]),
        )
