"""Installed versions of the libraries compared."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

PACKAGES = ("psdmc", "numpy", "pin", "casadi", "cmeel-cppadcodegen", "mujoco")


def version_of(package: str) -> str:
    """A package's installed version, in words where it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def versions() -> dict[str, str]:
    """Installed version of each compared package, by its name."""
    return {package: version_of(package) for package in PACKAGES}
