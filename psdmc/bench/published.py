"""Times that the authors of the method behind psdmc published. Reports show them without ratios, because machines and
inertias differ."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Published:
    """Times that were published for one robot, in ns per call, and the time of its derivation in s. A time is None if
    it was not published."""

    robot: str
    source: str
    inverse: float
    forward: float
    derivation: float | None


PSDM_2021 = "PSDM-2021 (Mech. Mach. Theory 156)"
DENSO_2022 = "Denso-2022, table 5"

PUBLISHED = {
    "Denso": Published("Denso", DENSO_2022, 400.0, 630.0, 3.0),
    "KR6": Published("KR6", PSDM_2021, 2110.0, 2270.0, 5.3),
    "LBR7": Published("LBR7", PSDM_2021, 6490.0, 7280.0, 88.0),
}
"""By the benchmark's name of the robot."""


@dataclass(frozen=True, slots=True)
class TableRow:
    """A row of table 5 of the paper Denso-2022: times in ns per call."""

    method: str
    inverse: float
    forward: float


DENSO_TABLE_5 = (
    TableRow("PSDM", 400.0, 630.0),
    TableRow("RNE", 6000.0, 19900.0),
    TableRow("RNE, regressive form", 17200.0, 112000.0),
)
