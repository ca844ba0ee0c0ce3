"""Noise of the position sensors, estimated from the log, and its effects: joints at rest whose positions ripple, and
columns of a regressor that noise alone would give."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.logs.log import Array

CLIPPED = 10.0
"""Typical deviations beyond which a sample counts as a fault instead of noise, and as this much."""
SMALLEST_SHARE = 0.05
"""Least share of the spectrum above the cut-off that is assumed: the filter leaves nothing to estimate noise from below
it."""
REST_DEVIATIONS = 10.0
"""Peak to peak of filtered noise, in standard deviations, over as many samples as logs have: 8 to 9 for normal noise."""
REST_STEPS = 3.0
"""Encoder steps within which a joint counts as resting: a position between two steps flickers."""
SEED = 30_301


def position_noise(position: Array, filtered: Array, in_band: float) -> Array:
    """(n,) standard deviation of a raw sample, rad or m, from what the low-pass removed.

    position, filtered  (N, n) of a log on an even grid;  in_band  share of the spectrum below the cut-off

    The noise is taken as white: the part above the cut-off stands for the part below.
    """
    left = position - filtered
    left = left - np.median(left, axis=0)
    typical = 1.4826 * np.median(np.abs(left), axis=0)
    bound = CLIPPED * np.maximum(typical, smallest_steps(position))
    size = np.sqrt(np.mean(np.clip(left, -bound, bound) ** 2, axis=0))
    return np.asarray(size / np.sqrt(max(1.0 - in_band, SMALLEST_SHARE)))


def smallest_steps(position: Array) -> Array:
    """(n,) smallest difference between two readings: the encoder's step where a joint hardly moves."""
    steps = np.zeros(position.shape[1])
    for k, column in enumerate(position.T):
        values = np.unique(column)
        steps[k] = float(np.diff(values).min()) if len(values) > 1 else 0.0
    return steps


def resting(
    position: Array, motion: Array, filtered_motion: Array, noise: Array, in_band: float, smallest: float
) -> NDArray[np.bool_]:
    """(n,) whether a joint's motion is no more than its sensor's noise, a few encoder steps, or `smallest` (rad or m).

    motion, filtered_motion  (n,)  peak to peak, before and after the filter
    """
    by_noise = filtered_motion < REST_DEVIATIONS * noise * np.sqrt(in_band)
    return np.asarray(by_noise | (motion <= REST_STEPS * smallest_steps(position)) | (motion < smallest))


NOISE_CHUNK = 65_536
"""Rows that one seed draws: any row can then be drawn without those before it."""


def noise_like(noise: Array, first: int, last: int) -> Array:
    """(last - first, n) raw position noise of these standard deviations at some rows, the same on every call."""
    parts = []
    for chunk in range(first // NOISE_CHUNK, (last - 1) // NOISE_CHUNK + 1):
        start = chunk * NOISE_CHUNK
        rng = np.random.default_rng(SEED if chunk == 0 else [SEED, chunk])
        drawn = rng.standard_normal((min(last - start, NOISE_CHUNK), len(noise)))
        parts.append(drawn[max(first - start, 0) :])
    return np.asarray(noise * np.concatenate(parts))
