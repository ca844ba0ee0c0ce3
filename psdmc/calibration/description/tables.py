"""All tables that a log description may have, in the order of the documentation."""

from __future__ import annotations

from typing import Any

from psdmc.calibration.description.table import Table
from psdmc.calibration.description.table_fit import FIT
from psdmc.calibration.description.table_logs import LOGS

TABLES: tuple[Table[Any], ...] = (
    LOGS,
    FIT,
)
