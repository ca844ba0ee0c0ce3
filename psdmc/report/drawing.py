"""Matplotlib, loaded when the first picture is drawn and not before: it takes half a second and writes to the home."""

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
    """An empty figure of that size in inches, whose parts make room for each other."""
    _load()
    from matplotlib.figure import Figure

    return Figure(figsize=figsize, layout="constrained")


def style(settings: Mapping[Any, Any]) -> contextlib.AbstractContextManager[None]:
    """Matplotlib's settings for the pictures drawn inside."""
    _load()
    import matplotlib

    return matplotlib.rc_context(dict(settings))


def _load() -> None:
    """Without a word on homes that cannot be written: it then works in a temporary folder, which is as good."""
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    import matplotlib

    matplotlib.use("Agg")
