"""Versions of the programs that computed a calibration."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

from psdmc.version import psdmc_version

LIBRARIES = ("numpy", "scipy", "cvxpy", "clarabel")
"""Whose results enter a calibration's numbers."""


def versions_used() -> dict[str, str]:
    """psdmc's, Python's and the libraries' versions, by name; libraries that are not installed are left out."""
    found = {"psdmc": psdmc_version(), "Python": platform.python_version()}
    for name in LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found
