"""psdmc's own version, as files and packages record it."""

from __future__ import annotations

VERSION = "0.2.0"
"""The one place where it stands: pyproject.toml reads it here. Asking the installed package's metadata for it would take
longer than reading a model."""


def psdmc_version() -> str:
    """The version."""
    return VERSION
