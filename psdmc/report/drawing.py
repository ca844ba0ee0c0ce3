"""Matplotlib, loaded when the first picture is drawn: it takes half a second and writes to the home folder."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
else:
    Axes = Figure = object

__all__ = ["Axes", "Figure", "new_figure", "style"]


def new_figure(figsize: tuple[float, float]) -> Figure:
    """An empty figure of that size in inches, whose parts are laid out without overlaps."""
    _load()
    from matplotlib.figure import Figure

    return Figure(figsize=figsize, layout="constrained")


def style(settings: Mapping[Any, Any]) -> contextlib.AbstractContextManager[None]:
    """Matplotlib's settings for the pictures drawn inside."""
    _load()
    import matplotlib

    return matplotlib.rc_context(dict(settings))


def _load() -> None:
    """Load it without a message on home folders that cannot be written: it then uses a temporary folder."""
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    import matplotlib

    matplotlib.use("Agg")
