"""A log description (log.toml): the file says what the columns of a user's logs are, and how to fit them.

Each top-level key of the file is described by an object of the class Table in a separate module; `TABLES` lists these
objects.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar, cast

from psdmc.calibration.description.table import Reading, Table
from psdmc.calibration.description.table_coupling import COUPLING
from psdmc.calibration.description.table_elasticity import ELASTICITY
from psdmc.calibration.description.table_fit import FIT
from psdmc.calibration.description.table_joints import JOINTS
from psdmc.calibration.description.table_logs import CSV_FORM, LOGS, TIME
from psdmc.calibration.description.table_quantities import EFFORT, MOTOR_POSITION, POSITION, VELOCITY
from psdmc.calibration.identify.linear_options import LinearOptions
from psdmc.calibration.logs.toml_tables import TomlTable, read_toml, require_none


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
    MOTOR_POSITION,
    JOINTS,
    COUPLING,
    ELASTICITY,
    FIT,
    SPRINGS,
    FRICTION,
    PRIOR,
    BODIES,
    ESSENTIAL,
)


WHAT = "a log description (log.toml), as `psdmc calibrate --describe` drafts one"
HINT = "docs/log_description.md has every key; `psdmc calibrate --describe LOG` drafts a description"

T = TypeVar("T")


@dataclass(frozen=True, slots=True, eq=False)
class LogDescription:
    """The content of a log description (log.toml), by top-level key.

    path   path of the file, for messages
    parts  the value of each key that the file has
    """

    path: Path
    parts: Mapping[str, object]

    def part(self, table: Table[T]) -> T:
        """Return the value of a top-level key in the file, or the default of this key if the file does not have it."""
        return cast(T, self.parts.get(table.key, table.default))

    def options(self, options: LinearOptions) -> LinearOptions:
        """Return the options of the linear fit, changed by the entries of the log description."""
        for table in TABLES:
            options = table.options(options, self.part(table))
        return replace(options, tables_from=str(self.path))


def read_description(path: str | Path, joint_names: tuple[str, ...] | None = None) -> LogDescription:
    """Return the content of a log description. Raises InputError with the wrong table and key, and with what is
    expected.

    joint_names  joints of the model; None: names of joints are not checked
    """
    path = Path(path)
    return description_of(read_toml(path, WHAT), path, joint_names)


def description_of(
    content: Mapping[str, Any], path: Path, joint_names: tuple[str, ...] | None = None
) -> LogDescription:
    """Return a log description from the content of its TOML file."""
    faults: list[str] = []
    TomlTable(content, "description", tuple(table.key for table in TABLES), faults)
    reading = Reading(path.parent, joint_names, faults)
    parts = {table.key: table.read(content[table.key], reading) for table in TABLES if table.key in content}
    if "log" not in content:
        faults.append("no [[log]], expected one for each recording")
    require_none(faults, str(path), HINT)
    return LogDescription(path, parts)


def is_description(path: Path) -> bool:
    """Return whether a path names a log description: a .toml file with [[log]] but no campaign's [[run]]."""
    if path.suffix.lower() != ".toml":
        return False
    content = read_toml(path, "a log description or a campaign (.toml)")
    return "run" not in content and any(table.key in content for table in TABLES)
