"""The limits from which a verdict follows. docs/calibration.md lists them, decision 0021 gives the reasons."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class VerdictOptions:
    """The limits from which a verdict on a calibration follows.

    If a quantity has two limits, a calibration beyond the first is not usable, and one beyond the second is doubtful.

    fewest_samples, few_samples  smallest number of independent samples per fitted unknown
    poor_r2, fair_r2             smallest R^2 of a joint's whole torque on held-out samples
    gains, sure_gains            range of the ratio of measured torque to the torque from the robot file
    hardly                       rad/s (m/s) RMS; a slower joint hardly moves, so the sign of its friction is unknown
    noise_ratio                  ratio of residual to sensor noise above which the model lacks an effect
    worse                        ratio of held-out RMSE to fitted RMSE above which a fit does not predict other data
    carried                      held-out RMSE, as a share of the torque's variation, below which `worse` does not
                                 matter
    noticeable                   held-out RMSE, as a share of the torque's variation, below which a lacking effect does
                                 not matter
    settled                      largest torque change for one standard deviation of a parameter, as a share of the
                                 torque's variation
    sure                         number of standard deviations by which friction's power must be negative
    friction_share               share of the motor's power below which friction is not judged
    of_limit                     range of the largest torque, as a share of the file's effort limit; a value outside
                                 gives a doubt
    late, hardly_late            s, largest delay between motion and torque
    acceleration_lost            largest share of the acceleration that differences of samples may lose at the cut-off;
                                 more gives a doubt
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
