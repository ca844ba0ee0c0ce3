"""Base parameters as a table for the terminal, for a notebook, and for pandas."""

from __future__ import annotations

import re
from html import escape
from typing import TYPE_CHECKING, Any

from psdmc.errors import ToolchainError
from psdmc.model.equations import BaseParameter
from psdmc.model.latex import equations_latex

if TYPE_CHECKING:
    import pandas as pd

LINES = 12
"""Most lines of a repr."""

LABEL = 40
"""Most characters of an equation in a label, but for its first term."""

BETWEEN_TERMS = re.compile(r" (?=[-+] )")


class BaseParameters(tuple[BaseParameter, ...]):
    """A tuple with the equation, unit and value of each entry of theta_b. Printed, it is a table."""

    __slots__ = ()

    @property
    def labels(self) -> tuple[str, ...]:
        """Return a label for each base parameter, such as 'theta_b[7] Izz2 + a2 mx2', with its index and equation.
        Labels are cut to LABEL characters."""
        return tuple(f"theta_b[{k}] {_first_terms(parameter.equation)}" for k, parameter in enumerate(self))

    def plain(self) -> list[dict[str, Any]]:
        """Return a JSON object per base parameter: number from 0, label, whole equation, unit, value or None."""
        named = enumerate(zip(self.labels, self, strict=True))
        return [
            {"index": k, "name": name, "equation": each.equation, "unit": each.unit, "value": each.value}
            for k, (name, each) in named
        ]

    def to_frame(self) -> pd.DataFrame:
        """Return a pandas data frame with one row per base parameter: equation, value (NaN if unknown) and unit. The
        index, theta_b, runs from 0 to l - 1.

        Raises ToolchainError if pandas is not installed.
        """
        try:
            import pandas as pd
        except ImportError as error:
            raise ToolchainError("to_frame() needs pandas", "pip install 'psdmc[notebook]'") from error
        columns = {
            "equation": [parameter.equation for parameter in self],
            "value": [float("nan") if parameter.value is None else parameter.value for parameter in self],
            "unit": [parameter.unit for parameter in self],
        }
        return pd.DataFrame(columns, index=pd.RangeIndex(len(self), name="theta_b"))

    def to_latex(self) -> str:
        """Return all equations with values and units, as an `aligned` environment of amsmath."""
        return equations_latex(self)

    def __repr__(self) -> str:
        head = f"{len(self)} base parameters"
        lines = [f"  {k}: {_shown(parameter)}" for k, parameter in enumerate(self[: LINES - 1])]
        if len(self) > len(lines):
            lines[-1] = f"  ... and {len(self) - len(lines) + 1} more"
        return "\n".join([head, *lines])

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{k}</td><td>{escape(parameter.equation)}</td><td>{value_text(parameter)}</td>"
            f"<td>{escape(parameter.unit)}</td></tr>"
            for k, parameter in enumerate(self)
        )
        head = "<tr><th>theta_b</th><th>equation</th><th>value</th><th>unit</th></tr>"
        return f"<table><thead>{head}</thead><tbody>{rows}</tbody></table>"

    def _repr_latex_(self) -> str:
        return f"$$\n{self.to_latex()}\n$$"


def _first_terms(equation: str) -> str:
    """An equation, or as many of its terms as a label has room for."""
    first, *others = BETWEEN_TERMS.split(equation)
    for term in others:
        if len(first) + len(term) > LABEL:
            return f"{first} + ..."
        first = f"{first} {term}"
    return first


def value_text(parameter: BaseParameter) -> str:
    """The value with six digits, or 'unknown'."""
    return "unknown" if parameter.value is None else f"{parameter.value:.6g}"


def _shown(parameter: BaseParameter) -> str:
    equation = parameter.equation
    short = equation if len(equation) <= 80 else f"{equation[:76]} ..."
    return (
        f"{short} = {value_text(parameter)} {parameter.unit if parameter.value is not None else ''}".rstrip()
    )
