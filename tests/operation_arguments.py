"""Arguments on which operations are tried: random ones of many sizes, and those at the ends of what they take."""

from __future__ import annotations

import numpy as np

from psdmc.program.program import Op

EXTREME = (
    0.0,
    -0.0,
    1.0,
    -1.0,
    np.inf,
    -np.inf,
    np.nan,
    5e-324,
    -2.3e-308,
    1.7e308,
    -1e30,
    1e-30,
    709.7,
    -745.0,
    20.0,
)
COUNT = 200


def arguments(op: Op, columns: int, real: str = "float64", seed: int = 3) -> np.ndarray:
    """(count, columns) of the precision; the first columns are the operation's arguments. Of floats none is subnormal."""
    random = np.random.default_rng(seed)
    size = 2.0 if op in (Op.EXP, Op.TANH, Op.SIN, Op.COS, Op.POW) else 10.0
    found = random.choice([-1.0, 1.0], (COUNT, columns)) * 10.0 ** random.uniform(
        -size, size, (COUNT, columns)
    )
    if op in (Op.LOG, Op.POW):
        found[:, 0] = np.abs(found[:, 0])
    found[: COUNT // 8, 1] = found[: COUNT // 8, 0]  # ties
    extreme = random.choice(EXTREME, (COUNT, columns))
    extreme[: len(EXTREME), 0] = EXTREME
    both = np.vstack([found, extreme])
    with np.errstate(all="ignore"):
        return both.astype(real)
