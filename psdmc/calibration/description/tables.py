"""The list of all tables that a log description (log.toml) may have, in the order of the documentation."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from psdmc.calibration.description.table import Reading, Table
from psdmc.calibration.description.table_coupling import COUPLING
from psdmc.calibration.description.table_fit import FIT
from psdmc.calibration.description.table_joints import JOINTS
from psdmc.calibration.description.table_logs import CSV_FORM, LOGS, TIME
from psdmc.calibration.description.table_quantities import EFFORT, POSITION, VELOCITY
from psdmc.calibration.identify.linear_options import LinearOptions


def _kept(key: str) -> Table[object]:
    """A table that is handed on as it is."""

    def read(value: object, reading: Reading) -> object:
        return value

    def options(options: LinearOptions, value: object) -> LinearOptions:
        return options if value is None else replace(options, tables={**options.tables, key: value})

    return Table(key, read, None, options)


SPRINGS, FRICTION = _kept("springs"), _kept("friction")
PRIOR, BODIES, ESSENTIAL = _kept("prior"), _kept("bodies"), _kept("essential")
"""Tables that are read where the robot is known: columns of the fit beside rigid bodies and plain friction
(psdmc.calibration.columns), and what is known before the fit (psdmc.calibration.identify.knowledge)."""

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
