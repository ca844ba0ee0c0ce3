"""Refuses packages that programs for joints of one coordinate, such as an FMU or a controller of ROS 2, cannot use."""

from __future__ import annotations

from psdmc.backends.c.package import PackageView
from psdmc.errors import InputError


def refuse_unsuited(package: PackageView, what: str, option: str) -> None:
    """Raise InputError if a package computes with float, has joints with several coordinates, or lacks values of the base
    parameters.

    what    what is made of the package, such as 'an FMU'
    option  option of `emit-c` that asks for it
    """
    info = package.info
    if package.real != "double":
        raise InputError(
            f"{what} computes with double, and the package with float", "leave out --real float32"
        )
    if info.is_wide:
        raise InputError(
            f"{info.name}: {what} needs joints of one coordinate, and q of this robot has joints with several coordinates",
            f"leave out {option}: it supports no floating bases and ball joints",
        )
    if any(parameter.value is None for parameter in info.parameters):
        raise InputError(
            f"{info.name}: {what} needs values of the base parameters, and this model's are unknown",
            f"calibrate the model first, or leave out {option}",
        )
