"""A motion as a message trajectory_msgs/msg/JointTrajectory of ROS 2, in YAML, as `ros2 topic pub` takes it."""

from __future__ import annotations

import json
from collections.abc import Iterator

from psdmc.calibration.logs.log import Array
from psdmc.calibration.motions.formats.motion_format import MotionFormat
from psdmc.calibration.motions.trajectory import Trajectory


def _lines(motion: Trajectory) -> Iterator[str]:
    yield "joint_names: " + json.dumps(motion.joint_names)
    yield "points:"
    for time, q, qd, qdd in zip(motion.time, motion.q, motion.qd, motion.qdd, strict=True):
        seconds, rest = divmod(round(float(time) * 1e9), 10**9)
        yield f"- positions: {_numbers(q)}"
        yield f"  velocities: {_numbers(qd)}"
        yield f"  accelerations: {_numbers(qdd)}"
        yield f"  time_from_start: {{sec: {seconds}, nanosec: {rest}}}"


def _numbers(values: Array) -> str:
    return f"[{', '.join(f'{value:.9f}' for value in values)}]"


FORMAT = MotionFormat("ros2", ".ros2.yaml", 100.0, _lines, slides=True)
