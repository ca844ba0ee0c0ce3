"""The version of psdmc, as psdmc writes it into files and packages."""

from __future__ import annotations

VERSION = "0.2.0"
"""The one place where it stands: pyproject.toml reads it here. Asking the installed package's metadata for it would take
longer than reading a model."""


def psdmc_version() -> str:
    """Return the version of psdmc as text."""
    return VERSION
