"""The unit that a log's gains against the file suggest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from psdmc.calibration.verdict.gains import Gain

UNITS = ((1e-3, "kN m (or kN)?"), (1e3, "mN m (or mN)?"))
"""Units, and the gains that each would give."""
ABOUT = 2.5
"""Factor within which two gains count as similar: a file's own masses may be wrong by as much."""
ALIKE = 12.0
"""Largest over smallest gain of a log whose joints share one fault: torque constants differ by a few times."""
MOTOR_SIDE = (1.0 / 300.0, 1.0 / ABOUT)
"""Gains that amperes, or torque before a gear, would give."""


def unit_suspect(gains: Sequence[Gain]) -> str | None:
    """The suspected unit, in words; None where the visible gains are about one, or contradict each other."""
    seen = np.array([gain.value for gain in gains if gain.visible])
    if not len(seen) or np.any(seen <= 0) or seen.max() > ALIKE * seen.min():
        return None
    middle = float(np.exp(np.mean(np.log(seen))))
    if 1.0 / ABOUT < middle < ABOUT:
        return None
    where = "on every joint whose torque the file shows"
    for unit, word in UNITS:
        if unit / ABOUT < middle < unit * ABOUT:
            return f"a gain of about {unit:g} {where}: {word}"
    if MOTOR_SIDE[0] < middle < MOTOR_SIDE[1]:
        about = f"a gain of about {middle:.2g} = 1/{1.0 / middle:.3g} {where}"
        return f"{about}: amperes in an effort column, or torque before a gear?"
    return f"a gain of about {middle:.2g} {where}: another unit?"
