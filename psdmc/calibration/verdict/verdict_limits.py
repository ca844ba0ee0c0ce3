"""The limits from which a verdict follows. docs/calibration.md lists them, decision 0021 gives the reasons."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class VerdictOptions:
    """The limits from which a verdict follows. A calibration beyond the first limit of a pair is not usable; beyond
    the second, it is doubtful.

    fewest_samples, few_samples  independent samples per fitted unknown: smallest number
    poor_r2, fair_r2             held-out R^2 of a joint's whole torque: smallest value
    gains, sure_gains            measured torque over the torque from the file: range
    hardly                       rad/s (m/s) RMS; a slower joint hardly moves, so the sign of its friction is unknown
    noise_ratio                  residual over sensor noise above which the model lacks an effect
    worse                        held-out RMSE over fitted RMSE above which a fit does not predict other data
    carried                      held-out RMSE over the torque's variation below which `worse` does not matter
    noticeable                   held-out RMSE over the torque's variation below which a lacking effect does not matter
    settled                      torque for one standard deviation of a parameter, over the torque's variation
    sure                         standard deviations by which friction's power must be negative
    friction_share               share of the motor's power below which friction is not judged
    of_limit                     largest torque over the file's effort limit: range outside of which there is a doubt
    late, hardly_late            s between motion and torque: largest value
    acceleration_lost            share of the acceleration that differences of samples lose at the cut-off: doubt above it
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
    late: float = 0.03
    hardly_late: float = 0.02
    acceleration_lost: float = 0.05
