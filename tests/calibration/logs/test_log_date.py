"""A log's date is what its own clock says: a copied file gives the same calibration."""

from __future__ import annotations

import pytest

from psdmc.calibration.logs.log import date_of


@pytest.mark.parametrize(
    ("first", "date"),
    [(1_700_000_000.0, "2023-11-14"), (0.0, ""), (12.5, ""), (5e9, ""), (float("nan"), "")],
)
def test_only_time_that_counts_from_1970_has_a_date(first: float, date: str):
    assert date_of(first) == date
