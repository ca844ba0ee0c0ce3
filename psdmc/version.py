"""psdmc's own version, as files and packages record it."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version


def psdmc_version() -> str:
    """The installed version; 'unknown' where psdmc runs from a bare checkout."""
    try:
        return version("psdmc")
    except PackageNotFoundError:
        return "unknown"
