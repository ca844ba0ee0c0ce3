"""The adapter for ROS 2: an ament package with two controllers of ros2_control, gravity compensation and computed torque.

What runs in the control loop is a C++ header without ROS. It has arrays of fixed size and allocates no memory. The
plugin connects the header with the interfaces of the hardware.
"""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.backends.c.package import PackageView
from psdmc.backends.c.render import render
from psdmc.errors import InputError

FILES = {
    "ros2/{}_control.hpp": "ros2_control.hpp",
    "ros2/{}_plugin.cpp": "ros2_plugin.cpp",
    "ros2/plugins.xml": "ros2_plugins.xml",
    "ros2/package.xml": "ros2_package.xml",
    "ros2/CMakeLists.txt": "ros2_CMakeLists.txt",
}


def needed(functions: Sequence[str], wide: bool) -> list[str]:
    """What the two controllers compute."""
    return ["gravity", "inverse_dynamics"]


def files(package: PackageView) -> dict[str, str]:
    """Return the text of each file of the ament package, by path. Raises InputError if the robot or its model does not
    suit controllers of joint torques."""
    info, robot = package.info, package.robot
    if package.real != "double":
        raise InputError(
            "ROS 2 controllers compute with double, and the package with float", "leave out --real float32"
        )
    if info.is_wide:
        raise InputError(
            f"{info.name}: a controller commands each joint's torque, and q has joints with several coordinates",
            "leave out --with ros2; controllers of floating bases and ball joints are not supported",
        )
    if any(parameter.value is None for parameter in info.parameters):
        raise InputError(
            f"{info.name}: a controller needs values of the base parameters, and this model's are unknown",
            "calibrate the model first, or leave out --with ros2",
        )
    view = {"package": package, "name": f"{robot.lower()}_controllers"}
    return {path.format(robot): render(f"adapters/{text}.jinja", **view) for path, text in FILES.items()}
