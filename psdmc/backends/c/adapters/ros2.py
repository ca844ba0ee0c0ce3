"""The adapter for ROS 2: an ament package with two controllers of ros2_control, gravity compensation and computed torque.

What runs in the control loop is a C++ header without ROS. It has arrays of fixed size and allocates no memory. The
plugin connects the header with the interfaces of the hardware.
"""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.backends.c.adapters.suited import refuse_unsuited
from psdmc.backends.c.package import PackageView
from psdmc.backends.c.render import render
from psdmc.program.signature import Signature

FILES = {
    "ros2/{}_control.hpp": "ros2_control.hpp",
    "ros2/{}_plugin.cpp": "ros2_plugin.cpp",
    "ros2/plugins.xml": "ros2_plugins.xml",
    "ros2/package.xml": "ros2_package.xml",
    "ros2/CMakeLists.txt": "ros2_CMakeLists.txt",
}


def needed(functions: Sequence[Signature], wide: bool) -> list[str]:
    """Return the names of the functions that the two controllers call."""
    return ["gravity", "inverse_dynamics"]


def files(package: PackageView) -> dict[str, str]:
    """Return the text of each file of the ament package, by path. Raises InputError if the robot or its model does not
    suit controllers of joint torques."""
    robot = package.robot
    refuse_unsuited(package, "a ROS 2 controller", "--with ros2")
    view = {"package": package, "name": f"{robot.lower()}_controllers"}
    return {path.format(robot): render(f"adapters/{text}.jinja", **view) for path, text in FILES.items()}
