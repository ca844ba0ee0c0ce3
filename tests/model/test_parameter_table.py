"""Base parameters in the terminal, in a notebook and in pandas."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from bundled import bundled_model

from psdmc.errors import ToolchainError
from psdmc.model.equations import BaseParameter, BaseParameters


@pytest.mark.parametrize("name", ["two_link", "kr6"])
def test_a_terminal_shows_at_most_twelve_lines(name: str) -> None:
    found = bundled_model(name).base_parameters
    lines = repr(found).splitlines()
    assert len(lines) <= 12
    assert lines[0] == f"{len(found)} base parameters"
    assert lines[1].startswith(f"  0: {found[0].equation[:70]}")


def test_what_is_left_out_is_counted() -> None:
    assert repr(bundled_model("kr6").base_parameters).endswith("... and 26 more")


def test_the_data_frame_is_theta_b() -> None:
    pytest.importorskip("pandas")
    model = bundled_model("scara")
    frame = model.base_parameters.to_frame()
    assert list(frame.columns) == ["equation", "value", "unit"]
    assert frame.index.tolist() == list(range(model.l))
    assert np.array_equal(frame["value"], model.theta_b)


def test_unknown_values_are_nan_in_a_data_frame() -> None:
    pytest.importorskip("pandas")
    assert np.isnan(BaseParameters([BaseParameter("m1", "kg", None)]).to_frame()["value"][0])


def test_without_pandas_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ToolchainError, match="to_frame\\(\\) needs pandas") as caught:
        bundled_model("scara").base_parameters.to_frame()
    assert caught.value.hint == "pip install 'psdmc[notebook]'"


def test_a_notebook_gets_a_row_for_each() -> None:
    found = bundled_model("scara").base_parameters
    assert found._repr_html_().count("<tr><td>") == len(found)
    assert found._repr_latex_() == f"$$\n{found.to_latex()}\n$$"
