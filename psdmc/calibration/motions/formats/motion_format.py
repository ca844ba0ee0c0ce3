"""The parts of a file format for a robot's controller, and a planned motion at the rate of such a format."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from psdmc.calibration.logs.foreign_bytes import quoted
from psdmc.calibration.motions.trajectory import Trajectory
from psdmc.errors import InputError


@dataclass(frozen=True, slots=True)
class MotionFormat:
    """A file format in which a robot's controller takes a motion.

    name    name of the format on the command line
    ending  ending of the file's name, with its dot
    rate    rows per second of the file
    lines   computes the file's lines from a motion at this rate
    joints  number of joints that the controller needs; 0: any
    slides  whether sliding joints, with positions in m, are allowed
    """

    name: str
    ending: str
    rate: float
    lines: Callable[[Trajectory], Iterator[str]]
    joints: int = 0
    slides: bool = False

    def text(self, motion: Trajectory) -> str:
        """Return the content of the file for a motion. Raises InputError if the controller cannot run the motion."""
        self.require(motion.joint_names, motion.sliding)
        return "\n".join(self.lines(resampled(motion, self.rate))) + "\n"

    def require(self, joint_names: tuple[str, ...], sliding: tuple[str, ...]) -> None:
        """Raise InputError if the controller has another number of joints, or takes no sliding joints."""
        count = len(joint_names)
        if self.joints and count != self.joints:
            raise InputError(
                f"--format {self.name} is for {self.joints} joints, the robot has {count}",
                "choose another format, or send the .csv with a program of your own",
            )
        if sliding and not self.slides:
            raise InputError(
                f"--format {self.name} has angles only, and joint(s) {', '.join(map(quoted, sliding))} slide",
                "choose another format: ros2 takes sliding joints",
            )


def resampled(motion: Trajectory, rate: float) -> Trajectory:
    """Return a motion at `rate` rows per second, from its first to its last row.

    Between two rows of `motion`, the position is the polynomial of degree 5 with the positions, velocities and
    accelerations of both rows. If the last row lies between two new rows, its position is held in one more row.
    """
    count = int(np.ceil(motion.duration * rate * (1.0 - 1e-12))) + 1
    time = np.arange(count) / rate
    at = np.minimum(time, motion.duration) / motion.period
    row = np.minimum(at.astype(np.int64), len(motion.time) - 2)
    x, step = (at - row)[:, None], motion.period
    ends = [(motion.q[row + k], step * motion.qd[row + k], step**2 * motion.qdd[row + k]) for k in (0, 1)]
    (q0, v0, a0), (q1, v1, a1) = ends
    gap, speed, bend = q1 - q0 - v0 - 0.5 * a0, v1 - v0 - a0, a1 - a0
    c3 = 10.0 * gap - 4.0 * speed + 0.5 * bend
    c4 = -15.0 * gap + 7.0 * speed - bend
    c5 = 6.0 * gap - 3.0 * speed + 0.5 * bend
    q = q0 + x * (v0 + x * (0.5 * a0 + x * (c3 + x * (c4 + x * c5))))
    qd = v0 + x * (a0 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)))
    qdd = a0 + x * (6.0 * c3 + x * (12.0 * c4 + x * 20.0 * c5))
    return Trajectory(motion.joint_names, time, q, qd / step, qdd / step**2, motion.sliding)
