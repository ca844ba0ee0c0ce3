"""A motion as a program in URScript, which the robots of Universal Robots run."""

from __future__ import annotations

from collections.abc import Iterator

from psdmc.calibration.motions.formats.motion_format import MotionFormat
from psdmc.calibration.motions.trajectory import Trajectory

RATE = 125.0
"""Steps per second of the controllers CB3; those of the e-Series run 500 and interpolate."""


def _lines(motion: Trajectory) -> Iterator[str]:
    yield "def psdmc_motion():"
    yield f"  movej({_pose(motion, 0)}, a=0.5, v=0.3)"
    for k in range(1, len(motion.time)):
        yield f"  servoj({_pose(motion, k)}, t={1.0 / RATE:g}, lookahead_time=0.03, gain=300)"
    yield "  stopj(2.0)"
    yield "end"


def _pose(motion: Trajectory, k: int) -> str:
    return f"[{', '.join(f'{value:.6f}' for value in motion.q[k])}]"


FORMAT = MotionFormat("urscript", ".script", RATE, _lines, joints=6)
