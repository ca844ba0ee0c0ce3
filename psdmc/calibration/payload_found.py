"""An identified load: values with standard deviations, verdict, and file. A known one is read from four numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from psdmc.calibration.campaign_file import LARGEST_ARM, LARGEST_MASS, SMALLEST_MASS
from psdmc.calibration.identify.known_load import KnownLoad
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.toml_tables import read_toml
from psdmc.errors import InputError
from psdmc.files import write_whole
from psdmc.model.calibrated import Verdict
from psdmc.robot.inertia import INERTIA_NAMES, inertia_matrix, six_of

WHAT = "a load's file (.toml), as psdmc payload writes one"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PayloadFound(KnownLoad):
    """A load that was identified from logs. A standard deviation is infinite if the logs do not determine the number by
    itself.

    visible  what the logs show of each of the ten linear parameters, in words
    notes    notes for the user, one sentence each
    """

    robot: str
    frame: str
    mass_std: float
    com_std: Array
    inertia_std: Array
    visible: Mapping[str, str]
    verdict: Verdict
    notes: tuple[str, ...]

    def lines(self) -> list[str]:
        """Return the load as lines of text: the arguments of R_add_payload with standard deviations."""
        rows = [f"mass     {_with_std(self.mass, self.mass_std)} kg"]
        rows += [
            f"com {axis}    {_with_std(value, std)} m"
            for axis, value, std in zip("xyz", self.com, self.com_std, strict=True)
        ]
        return rows + [
            f"I{name}      {_with_std(value, std)} kg m^2 about the centre of mass"
            for name, value, std in zip(INERTIA_NAMES, self.inertia, self.inertia_std, strict=True)
        ]

    def as_toml(self) -> str:
        """Return the text of the load file (TOML). A number that the logs do not determine has the deviation inf."""
        return "\n".join(
            [
                "# A load that psdmc payload identified. Lengths in m in the frame, inertia about the centre of mass:",
                "# Ixx Ixy Iyy Ixz Iyz Izz, kg m^2, the order of R_add_payload. inf: not fixed by the logs alone.",
                f"frame = {_text(self.frame)}",
                f"robot = {_text(self.robot)}",
                f"verdict = {_text(self.verdict.word)}",
                f"mass = {self.mass!r}",
                f"com = {_list(self.com)}",
                f"inertia = {_list(self.inertia)}",
                "",
                "[std]",
                f"mass = {self.mass_std!r}",
                f"com = {_list(self.com_std)}",
                f"inertia = {_list(self.inertia_std)}",
                "",
            ]
        )

    def save(self, path: str | Path) -> None:
        """Write the load file, as a whole or not at all."""
        write_whole(path, self.as_toml())


def read_load(path: str | Path) -> KnownLoad:
    """Return a load from its file. Raises InputError with what is wrong in the file."""
    content = read_toml(Path(path), WHAT)
    numbers = {
        name: _numbers(content.get(name), count) for name, count in (("mass", 1), ("com", 3), ("inertia", 6))
    }
    frame = content.get("frame")
    missing = [name for name, value in numbers.items() if value is None]
    if missing or not isinstance(frame, str):
        wrong = ", ".join([*missing, *([] if isinstance(frame, str) else ["frame"])])
        raise InputError(f"{path}: {wrong}: missing or no such numbers", f"expected {WHAT}")
    mass, com, inertia = (np.asarray(value) for value in numbers.values())
    return KnownLoad(float(mass[0]), com, inertia, frame)


def _numbers(value: Any, count: int) -> Array | None:
    values = [value] if count == 1 else value
    if not isinstance(values, list) or len(values) != count:
        return None
    if not all(isinstance(v, int | float) and not isinstance(v, bool) and math.isfinite(v) for v in values):
        return None
    return np.array(values, dtype=np.float64)


def load_numbers(load: Array) -> Array:
    """Return mass, centre of mass and inertia about the centre of mass (10,) of a load from its ten linear parameters.

    The linear parameters are mass, first moments and inertia about the frame's origin. The function is used to convert
    standard deviations.
    """
    mass, h = float(load[0]), load[1:4]
    com = h / mass
    inertia = inertia_matrix(load[4:10]) - mass * (com @ com * np.eye(3) - np.outer(com, com))
    return np.concatenate([[mass], com, six_of(inertia)])


def _with_std(value: float, std: float) -> str:
    return f"{value:9.5g} +- {std:.2g}" if math.isfinite(std) else f"{value:9.5g}, not fixed by the logs"


def _list(values: Array) -> str:
    return "[" + ", ".join(repr(float(v)) for v in values) + "]"


def _text(text: str) -> str:
    """A TOML basic string, whatever the name holds."""
    escaped = "".join(
        f"\\u{ord(c):04x}" if ord(c) < 0x20 or ord(c) == 0x7F else f"\\{c}" if c in '"\\' else c for c in text
    )
    return f'"{escaped}"'


HINT = "write MASS,X,Y,Z: kg, and m to the centre of mass in the tip's frame; or a load's file (.toml) with its inertia"


def given_load(source: str | Path | Sequence[float]) -> KnownLoad:
    """Return the known load from text 'MASS,X,Y,Z', from four numbers, or from a file that `psdmc payload` wrote. The
    numbers are the mass (kg) and the centre of mass (m, in the tip frame) of a point mass. Raises InputError if the
    load is wrong."""
    if isinstance(source, Path) or (isinstance(source, str) and source.lower().endswith(".toml")):
        return read_load(source)
    words = source.split(",") if isinstance(source, str) else source
    try:
        numbers = [float(word) for word in words]
    except (TypeError, ValueError):
        raise InputError(f"load: {source!r} is no four numbers", HINT) from None
    if len(numbers) != 4 or not all(map(math.isfinite, numbers)):
        raise InputError(f"load: {source!r} is no four numbers", HINT)
    mass, *com = numbers
    if not SMALLEST_MASS <= mass <= LARGEST_MASS or max(map(abs, com)) > LARGEST_ARM:
        raise InputError(
            f"load: {mass:g} kg at {com}: expected {SMALLEST_MASS:g} to {LARGEST_MASS:g} kg within {LARGEST_ARM:g} m",
            HINT,
        )
    return KnownLoad(mass, np.array(com), np.zeros(6))
