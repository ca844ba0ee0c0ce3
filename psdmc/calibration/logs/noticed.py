"""Sensor noise and rest of each joint, from a pass over a log's positions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.logs.check_options import CheckOptions
from psdmc.calibration.logs.even_grid import EvenGrid, evenly_spaced
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.log_survey import STRETCH_ROWS
from psdmc.calibration.logs.low_pass import FilterOptions, LowPass, memory
from psdmc.calibration.logs.position_noise import position_noise, resting
from psdmc.calibration.logs.stored_log import AnyLog


@dataclass(frozen=True, slots=True, eq=False)
class Noticed:
    """(n,) each, rad or m: sensor noise of a raw sample, zero for a joint at rest; whether it rests, and where; and its
    motion, peak to peak."""

    noise: Array
    still: NDArray[np.bool_]
    rest: Array
    motion: Array


def noticed(
    log: AnyLog,
    grid: EvenGrid,
    low_pass: LowPass,
    options: FilterOptions,
    check: CheckOptions | None = None,
    rows: int = STRETCH_ROWS,
) -> Noticed:
    """Noise and rest of every joint, from one pass over the log; noise of long logs from evenly spread rows."""
    reach, every = memory(options.cutoff, grid.period), -(-grid.count // NOISE_ROWS)
    raw, smooth = [], []
    n = len(log.joint_names)
    total, bounds = np.zeros(n), np.array([[np.inf] * n, [-np.inf] * n, [np.inf] * n, [-np.inf] * n])
    for start in range(0, grid.count, rows):
        first, last = max(start - reach, 0), min(start + rows + reach, grid.count)
        position, _ = evenly_spaced(log, grid, first, last)
        own = slice(start - first, min(start + rows, grid.count) - first)
        filtered_position = low_pass(position)[own]
        position = position[own]
        total += position.sum(axis=0)
        for k, values in ((0, position), (2, filtered_position)):
            bounds[k] = np.minimum(bounds[k], values.min(axis=0))
            bounds[k + 1] = np.maximum(bounds[k + 1], values.max(axis=0))
        raw.append(position[-start % every :: every])
        smooth.append(filtered_position[-start % every :: every])
    in_band = min(2.0 * options.cutoff * grid.period, 1.0)
    position = np.concatenate(raw)
    noise = position_noise(position, np.concatenate(smooth), in_band)
    smallest = (check or CheckOptions()).smallest_motion
    motion = bounds[1] - bounds[0]
    still = resting(position, motion, bounds[3] - bounds[2], noise, in_band, smallest)
    return Noticed(np.where(still, 0.0, noise), still, total / grid.count, motion)


NOISE_ROWS = 200_000
"""Rows from which sensor noise is computed; in longer logs evenly spread ones."""
