"""A motion as joint positions for a 1 kHz control loop, such as a motion generator of libfranka: rows of angles."""

from __future__ import annotations

from collections.abc import Iterator

from psdmc.calibration.motions.formats.motion_format import MotionFormat
from psdmc.calibration.motions.trajectory import Trajectory


def _lines(motion: Trajectory) -> Iterator[str]:
    for row in motion.q:
        yield ",".join(f"{value:.9f}" for value in row)


FORMAT = MotionFormat("franka", ".franka.csv", 1000.0, _lines, joints=7)
