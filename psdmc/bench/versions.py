"""Installed versions of the libraries compared."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

PACKAGES = ("psdmc", "numpy", "pin", "casadi", "cmeel-cppadcodegen", "mujoco")


def version_of(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def versions() -> dict[str, str]:
    return {package: version_of(package) for package in PACKAGES}
