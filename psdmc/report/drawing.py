"""Draws pictures as SVG elements with Matplotlib. Matplotlib is loaded for the first picture only, because loading
takes half a second and writes to the home folder. Pictures load nothing from the network, keep text as text, and use
the page's colours."""

from __future__ import annotations

import contextlib
import html
import io
import logging
import re
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
else:
    Axes = Figure = object

__all__ = ["Axes", "Figure", "document", "legend_below", "svg"]

INK = "#010203"
"""Placeholder for the page's own text colour, which replaces it after drawing."""

STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "psdmc",
    "path.simplify": True,
    "font.family": "sans-serif",
    "font.size": 10.0,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": INK,
    "axes.facecolor": "none",
    "legend.facecolor": "none",
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
}


def svg(draw: Callable[[Figure], None], size: tuple[float, float], says: str) -> str:
    """Return a picture as an <svg> element that scales with the page. The function `draw` draws it on a figure of
    `size` (inches).

    `says` is the description for screen readers. Equal numbers give equal bytes.
    """
    with _style(STYLE):
        figure = _new_figure(figsize=size)
        draw(figure)
        text = io.StringIO()
        metadata: dict[str, Any] = {"Date": None, "Creator": None}
        figure.savefig(text, format="svg", transparent=True, metadata=metadata)
    return _inline(text.getvalue(), says)


PRINTED = STYLE | dict.fromkeys((key for key, value in STYLE.items() if value == INK), "black")
PRINTED |= {"svg.fonttype": "path", "pdf.fonttype": 42, "figure.facecolor": "white"}
"""Pictures that are files: they look the same in each program, dark or not, and a PDF keeps their text searchable."""
LEFT_OUT = {"pdf": ("Creator", "Producer", "CreationDate"), "svg": ("Creator", "Date")}
"""What files do not say, by kind: it would differ from run to run."""


def document(
    name: str,
    draw: Callable[[Figure], None],
    size: tuple[float, float],
    kinds: Sequence[str] = ("pdf", "svg"),
) -> dict[str, bytes]:
    """Return a picture, which a function draws, as files NAME.pdf and NAME.svg on white ground. Equal numbers give equal
    bytes."""
    found = {}
    with _style(PRINTED):
        figure = _new_figure(figsize=size)
        draw(figure)
        for kind in kinds:
            content = io.BytesIO()
            figure.savefig(content, format=kind, metadata=dict.fromkeys(LEFT_OUT[kind]))
            found[f"{name}.{kind}"] = content.getvalue()
    return found


def legend_below(axis: Axes, columns: int, size: int = 8) -> None:
    """Put the legend below the picture, so that it hides no curve."""
    axis.figure.legend(loc="outside lower center", ncols=columns, fontsize=size, frameon=False)


def _inline(document: str, says: str) -> str:
    """The element alone, without fixed size, in the page's ink."""
    element = document[document.index("<svg") :]
    element = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", element, count=1)
    element = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", element, count=1)
    spoken = f'<svg role="img" aria-label="{html.escape(says)}"'
    return element.replace("<svg", spoken, 1).replace(INK, "currentColor")


def _new_figure(figsize: tuple[float, float]) -> Figure:
    """An empty figure of that size in inches, whose parts are laid out without overlaps."""
    from matplotlib.figure import Figure

    return Figure(figsize=figsize, layout="constrained")


def _style(settings: Mapping[Any, Any]) -> contextlib.AbstractContextManager[None]:
    """Matplotlib's settings for the pictures drawn inside."""
    _load()
    import matplotlib

    return matplotlib.rc_context(dict(settings))


def _load() -> None:
    """Load it without a message on home folders that cannot be written: it then uses a temporary folder."""
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    import matplotlib

    matplotlib.use("Agg")
