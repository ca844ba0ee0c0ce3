"""The table `[fit]`: options of the linear fit, such as filter cut-off, validation share and friction terms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from psdmc.calibration.description.table import Reading, Table
from psdmc.calibration.identify.linear_options import LinearOptions
from psdmc.calibration.logs.filter import SplitOptions
from psdmc.calibration.logs.foreign_bytes import listed
from psdmc.calibration.logs.low_pass import LARGEST_CUTOFF, SMALLEST_CUTOFF
from psdmc.calibration.logs.toml_tables import TomlTable, shown
from psdmc.friction.terms import expected_words, options_of

KEYS = ("cutoff", "held_out", "blocks", "friction", "sign_speed")
LARGEST_HELD_OUT = 0.9
MOST_BLOCKS = 1000
SLOWEST, FASTEST = 1e-6, 10.0
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


def _read(value: object, reading: Reading) -> FitChoice:
    table = TomlTable(value, "fit", KEYS, reading.faults)
    exponents, offset = None, None
    if table.has("friction"):
        exponents, offset = _friction(table, reading.faults)
    return FitChoice(
        cutoff=_given(table, "cutoff", SMALLEST_CUTOFF, LARGEST_CUTOFF),
        split=_split(table) if table.has("held_out") or table.has("blocks") else None,
        exponents=exponents,
        offset=offset,
        sign_speed=_given(table, "sign_speed", SLOWEST, FASTEST),
    )


def _given(table: TomlTable, key: str, low: float, high: float) -> float | None:
    return table.number(key, low, high) if table.has(key) else None


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


def _split(table: TomlTable) -> SplitOptions:
    usual = LinearOptions().split
    share = table.number("held_out", 0.0, LARGEST_HELD_OUT, usual.held_out)
    return SplitOptions(share, table.whole("blocks", 0, MOST_BLOCKS, usual.blocks))


def _friction(table: TomlTable, faults: list[str]) -> tuple[tuple[float, ...], bool]:
    words = table.items("friction")
    odd = [shown(word) for word in words if not isinstance(word, str)]
    if odd:
        faults.append(f"fit: friction: found {listed(odd)}, expected {expected_words()}")
        return (), False
    found = options_of(words)
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


FIT: Table[FitChoice] = Table("fit", _read, FitChoice(), with_choice)
