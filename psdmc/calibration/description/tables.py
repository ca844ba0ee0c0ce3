"""All tables that a log description may have, in the order of the documentation."""

from __future__ import annotations

from typing import Any

from psdmc.calibration.description.table import Table
from psdmc.calibration.description.table_coupling import COUPLING
from psdmc.calibration.description.table_csv_form import CSV_FORM
from psdmc.calibration.description.table_fit import FIT
from psdmc.calibration.description.table_joints import JOINTS
from psdmc.calibration.description.table_logs import LOGS
from psdmc.calibration.description.table_quantities import EFFORT, POSITION, VELOCITY
from psdmc.calibration.description.table_time import TIME
from psdmc.calibration.description.tables_of_columns import BODIES, ESSENTIAL, FRICTION, PRIOR, SPRINGS

TABLES: tuple[Table[Any], ...] = (
    LOGS,
    CSV_FORM,
    TIME,
    POSITION,
    VELOCITY,
    EFFORT,
    JOINTS,
    COUPLING,
    FIT,
    SPRINGS,
    FRICTION,
    PRIOR,
    BODIES,
    ESSENTIAL,
)
