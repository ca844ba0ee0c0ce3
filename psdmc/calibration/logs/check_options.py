"""The limits by which a log is refused or gets a remark."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CheckOptions:
    """Limits by which a log is refused or gets a remark.

    largest_gap        sample periods; a longer pause is a gap, and refused
    largest_jitter     share of the sample period; above it the log is resampled, and a note says so
    limit_slack        share by which position and speed may exceed the chain's limits
    free_position      rad, largest believable position of a joint without limits
    free_speed         rad/s, largest believable speed of a joint without a limit
    rate_disagreement  share by which the logged velocity may differ from the position's slope
    saturated_share    share of a moving joint's samples at one extreme effort from which it may be saturated
    shortest           s, shortest log that is read
    samples_per_cycle  smallest sampling rate in units of the filter's cut-off
    smallest_motion    rad or m, peak to peak; below it a joint is at rest
    longest            s, longest log that is read
    fastest            Hz, largest believable sampling rate
    """

    largest_gap: float = 10.0
    largest_jitter: float = 0.05
    limit_slack: float = 0.05
    free_position: float = 15.0
    free_speed: float = 30.0
    rate_disagreement: float = 0.25
    saturated_share: float = 0.02
    shortest: float = 2.0
    samples_per_cycle: float = 4.0
    smallest_motion: float = 1e-5
    longest: float = 86_400.0
    fastest: float = 1e6
