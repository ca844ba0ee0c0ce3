"""A motion as axis corrections for KUKA's RobotSensorInterface (RSI): one XML element per cycle of 4 ms."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from psdmc.calibration.motions.formats.motion_format import MotionFormat
from psdmc.calibration.motions.trajectory import Trajectory


def _lines(motion: Trajectory) -> Iterator[str]:
    """Corrections are absolute, in degrees from the first row's position."""
    for row in np.degrees(motion.q - motion.q[0]):
        axes = " ".join(f'A{k + 1}="{value:.5f}"' for k, value in enumerate(row))
        yield f"<AKorr {axes}/>"


FORMAT = MotionFormat("rsi", ".rsi.xml", 250.0, _lines, joints=6)
