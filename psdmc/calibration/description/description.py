"""A log description (log.toml): the file says what the columns of a user's logs are, and how to fit them.

An object of the class Table describes each top-level key of the file; `TABLES` lists these objects.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar, cast

from psdmc.calibration.description.joint_tables import (
    COUPLING,
    JOINTS,
    QUANTITIES,
    TIME_UNITS,
    Reading,
    Table,
    column_of,
    require_joints,
)
from psdmc.calibration.identify.linear_problem import ElasticityOptions, LinearOptions
from psdmc.calibration.logs.filter import SplitOptions
from psdmc.calibration.logs.foreign_bytes import listed
from psdmc.calibration.logs.log import USES, Use
from psdmc.calibration.logs.log_format import TextForm
from psdmc.calibration.logs.low_pass import LARGEST_CUTOFF, SMALLEST_CUTOFF
from psdmc.calibration.logs.toml_tables import TomlTable, read_toml, require_none, shown
from psdmc.friction.terms import expected_words, options_of

# The recordings


LARGEST_LOGS = 1000
"""As of a campaign's runs."""
LATEST = 86_400.0
"""s: a log lasts a day at most."""
MOST_TABLES = 20


@dataclass(frozen=True, slots=True)
class LogEntry:
    """One entry `[[log]]` of a log description: one recording.

    tables  files by name, relative to the working directory: one file without a name, or several files, each with other
            columns of the recording
    use     fit, or validate: the whole log is held out for validation
    start   s from the log's first row; earlier rows are left out
    end     s from the log's first row; later rows are left out
    topic   topic in a ROS bag; empty: the only topic, or /joint_states
    """

    tables: Mapping[str, Path]
    use: Use
    start: float
    end: float
    topic: str

    @property
    def name(self) -> str:
        """Name of the log for messages and reports."""
        return " + ".join(path.name for path in self.tables.values())


def _read_logs(value: object, reading: Reading) -> tuple[LogEntry, ...]:
    if not isinstance(value, list) or not 0 < len(value) <= LARGEST_LOGS:
        reading.faults.append(f"log: found {shown(value)}, expected 1 to {LARGEST_LOGS} tables [[log]]")
        return ()
    found = tuple(_entry(table, f"log {k}", reading) for k, table in enumerate(value, start=1))
    if all(entry.use == "validate" for entry in found):
        reading.faults.append("log: every one is for validation, expected one for fitting")
    return found


def _entry(value: object, where: str, reading: Reading) -> LogEntry:
    table = TomlTable(value, where, ("file", "tables", "use", "start", "end", "topic"), reading.faults)
    start, end = table.number("start", 0.0, LATEST, 0.0), table.number("end", 0.0, LATEST, math.inf)
    if end <= start:
        reading.faults.append(f"{where}: end: found {end:g}, expected more than its start, {start:g} s")
    return LogEntry(
        tables=_tables(table, where, reading),
        use=cast(Use, table.word("use", USES, "fit")),
        start=start,
        end=end,
        topic=table.text("topic", ""),
    )


def _tables(table: TomlTable, where: str, reading: Reading) -> dict[str, Path]:
    """Files by the name of their table."""
    if not table.has("tables"):
        return {"": reading.folder / table.text("file")}
    if table.has("file"):
        reading.faults.append(f"{where}: `tables` and `file` are both given, expected one of them")
    given = table.content["tables"]
    names = tuple(given) if isinstance(given, dict) else ()
    if not 0 < len(names) <= MOST_TABLES or any(not name for name in names):
        reading.faults.append(
            f"{where}: tables: found {shown(given)}, expected NAME = FILE, 1 to {MOST_TABLES}"
        )
        return {}
    inner = TomlTable(given, f"{where}: tables", names, reading.faults)
    return {name: reading.folder / inner.text(name) for name in names}


LOGS: Table[tuple[LogEntry, ...]] = Table("log", _read_logs, ())


LOWEST_RATE, HIGHEST_RATE = 0.01, 1e6
"""Hz."""
DATE = "date"
"""Unit of columns that hold dates."""


@dataclass(frozen=True, slots=True)
class TimeEntry:
    """How a log records the time of its rows.

    column  name of the time column, or its number from 1
    unit    seconds per unit of the column
    rate    sampling rate in Hz, if there is no time column; 0: there is a time column
    dates   whether the column holds dates, such as 2026-05-01T12:00:00.125; they are converted to seconds since 1970
    """

    column: str | int = "time_s"
    unit: float = 1.0
    rate: float = 0.0
    dates: bool = False


def _read_time(value: object, reading: Reading) -> TimeEntry:
    table = TomlTable(value, "time", ("column", "unit", "rate"), reading.faults)
    if table.has("rate"):
        if table.has("column") or table.has("unit"):
            reading.faults.append("time: `rate` is given with `column` or `unit`, expected one or the other")
        return TimeEntry(rate=table.number("rate", LOWEST_RATE, HIGHEST_RATE))
    unit = table.word("unit", (*TIME_UNITS, DATE), "s")
    column = column_of(table) if table.has("column") else "time_s"
    return TimeEntry(column, 1.0 if unit == DATE else TIME_UNITS[unit].size, dates=unit == DATE)


TIME: Table[TimeEntry] = Table("time", _read_time, TimeEntry())


SEPARATOR_WORDS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " "}
MOST_SKIPPED = 10_000


def _read_csv_form(value: object, reading: Reading) -> TextForm:
    table = TomlTable(value, "csv", ("separator", "header", "skip"), reading.faults)
    header = table.content.get("header")
    if header is not None and not isinstance(header, bool):
        reading.faults.append(f"csv: header: found {shown(header)}, expected true or false")
        header = None
    word = table.word("separator", tuple(SEPARATOR_WORDS), "") if table.has("separator") else ""
    return TextForm(
        separator=SEPARATOR_WORDS.get(word),
        header=header,
        skip=table.whole("skip", 0, MOST_SKIPPED, 0),
    )


CSV_FORM: Table[TextForm] = Table("csv", _read_csv_form, TextForm())


# How to fit them


LARGEST_HELD_OUT = 0.9
MOST_BLOCKS = 1000
SLOWEST_SIGN, FASTEST_SIGN = 1e-6, 10.0
"""rad/s (m/s), of the speed over which friction changes sign."""


@dataclass(frozen=True, slots=True)
class FitChoice:
    """Options of the linear fit from a log description or the command line. None means the default of LinearOptions.

    cutoff      cut-off of the filter, Hz
    split       share of each log that is held out for validation, and number of blocks into which it is divided
    exponents   exponents d of the viscous friction terms |qd|^d sign(qd)
    offset      whether each joint has a constant torque
    sign_speed  speed over which Coulomb friction changes sign, rad/s (m/s)
    warm        s, the first part of each log that is left out; only the command line gives it
    """

    cutoff: float | None = None
    split: SplitOptions | None = None
    exponents: tuple[float, ...] | None = None
    offset: bool | None = None
    sign_speed: float | None = None
    warm: float | None = None

    def by_flag(self) -> dict[str, object]:
        """Return the values that the user chose, by the command-line option that sets each value, such as --cutoff."""
        return {
            "--cutoff": self.cutoff,
            "--split": self.split,
            "--friction": self.exponents,
            "--warm": self.warm,
        }


def _read_fit(value: object, reading: Reading) -> FitChoice:
    table = TomlTable(
        value, "fit", ("cutoff", "held_out", "blocks", "friction", "sign_speed"), reading.faults
    )
    found = FitChoice()
    if table.has("friction"):
        exponents, offset = _friction(table, reading.faults)
        found = replace(found, exponents=exponents, offset=offset)
    if table.has("cutoff"):
        found = replace(found, cutoff=table.number("cutoff", SMALLEST_CUTOFF, LARGEST_CUTOFF))
    if table.has("held_out") or table.has("blocks"):
        usual = LinearOptions().split
        share = table.number("held_out", 0.0, LARGEST_HELD_OUT, usual.held_out)
        blocks = table.whole("blocks", 0, MOST_BLOCKS, usual.blocks)
        found = replace(found, split=SplitOptions(share, blocks))
    if table.has("sign_speed"):
        found = replace(found, sign_speed=table.number("sign_speed", SLOWEST_SIGN, FASTEST_SIGN))
    return found


def split_of(shares: Sequence[float]) -> SplitOptions | str:
    """Return how a log is split for validation, from one number or two. The first is the share that is held out, the
    second the number of blocks into which it is divided. If the numbers are wrong, return a text that says what is
    expected."""
    share, blocks = shares[0], shares[1] if len(shares) > 1 else 0.0
    if len(shares) > 2 or not 0.0 <= share <= LARGEST_HELD_OUT:
        return f"{', '.join(f'{x:g}' for x in shares)}: expected a share from 0 to {LARGEST_HELD_OUT:g}"
    if not (0 <= blocks <= MOST_BLOCKS and blocks == int(blocks)):
        return f"{blocks:g} blocks, expected a whole number from 0 to {MOST_BLOCKS}"
    return SplitOptions(share, int(blocks))


def _friction(table: TomlTable, faults: list[str]) -> tuple[tuple[float, ...], bool]:
    words = table.items("friction")
    odd = [shown(word) for word in words if not isinstance(word, str)]
    found = f"found {listed(odd)}, expected {expected_words()}" if odd else options_of(words)
    if isinstance(found, str):
        faults.append(f"fit: friction: {found}")
        return (), False
    return found


def with_choice(options: LinearOptions, choice: FitChoice) -> LinearOptions:
    """Return the options of the linear fit, in which the values that the user chose replace the defaults."""
    if choice.cutoff is not None:
        options = replace(options, filter=replace(options.filter, cutoff=choice.cutoff))
    plain = {
        name: value
        for name in ("split", "exponents", "offset", "sign_speed")
        if (value := getattr(choice, name)) is not None
    }
    return replace(options, **plain)


FIT: Table[FitChoice] = Table("fit", _read_fit, FitChoice(), with_choice)


LARGEST_INERTIA = 1e6
"""kg m^2 (kg), at the joint."""


def _read_elasticity(value: object, reading: Reading) -> ElasticityOptions:
    table = TomlTable(value, "elasticity", ("joints", "drive_inertia"), reading.faults)
    names = table.items("joints") if table.has("joints") else []
    odd = [shown(name) for name in names if not isinstance(name, str)]
    if odd:
        reading.faults.append(f"elasticity: joints: found {', '.join(odd)}, expected names of joints")
        return ElasticityOptions(True)
    given = table.content.get("drive_inertia", {})
    inner = TomlTable(
        given, "elasticity: drive_inertia", tuple(given) if isinstance(given, dict) else (), reading.faults
    )
    inertias = {name: inner.number(name, 0.0, LARGEST_INERTIA) for name in inner.content}
    require_joints([*(str(name) for name in names), *inertias], "elasticity", reading)
    return ElasticityOptions(True, tuple(str(name) for name in names), inertias)


ELASTICITY: Table[ElasticityOptions] = Table(
    "elasticity",
    _read_elasticity,
    ElasticityOptions(),
    lambda options, value: replace(options, elasticity=value),
)


def _kept(key: str) -> Table[object]:
    """A table that is handed on as it is."""

    def options(options: LinearOptions, value: object) -> LinearOptions:
        return options if value is None else replace(options, tables={**options.tables, key: value})

    return Table(key, lambda value, reading: value, None, options)


KEPT = tuple(map(_kept, ("springs", "friction", "prior", "bodies", "essential")))
"""Tables that are read where the robot is known: columns of the fit beside rigid bodies and plain friction
(psdmc.calibration.columns), and what is known before the fit (psdmc.calibration.identify.knowledge)."""


# The file


TABLES: tuple[Table[Any], ...] = (
    LOGS,
    CSV_FORM,
    TIME,
    *QUANTITIES.values(),
    JOINTS,
    COUPLING,
    ELASTICITY,
    FIT,
    *KEPT,
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
    content, faults = read_toml(path, WHAT), list[str]()
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
