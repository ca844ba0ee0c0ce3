"""Tables that are read where the robot is known: `[[springs]]` and `[friction]`, columns of the fit beside rigid bodies and
plain friction (psdmc.calibration.columns); `[prior]`, `[[bodies]]`, `[essential]`, what is known before the fit
(psdmc.calibration.identify.knowledge)."""

from __future__ import annotations

from dataclasses import replace

from psdmc.calibration.description.table import Reading, Table
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
