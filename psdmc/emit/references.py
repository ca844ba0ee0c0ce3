"""Reference states for the package's self-test, worked out elsewhere (from the MODEL, not from the generated
code)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.emit.tables import number

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class References:
    """Positions, velocities, accelerations and the torques that belong to them, each (k, n), SI."""

    q: Array
    qd: Array
    qdd: Array
    tau: Array

    def __post_init__(self) -> None:
        shapes = {np.shape(array) for array in (self.q, self.qd, self.qdd, self.tau)}
        if len(shapes) != 1 or len(next(iter(shapes))) != 2 or 0 in next(iter(shapes)):
            raise ValueError(f"reference states have shapes {sorted(shapes)}, expected one (k, n)")


@dataclass(frozen=True, slots=True)
class ReferenceView:
    """References as C text: rows of constants per vector."""

    count: int
    vectors: tuple[tuple[str, tuple[str, ...]], ...]


def reference_view(references: References, n: int, real: str) -> ReferenceView:
    """The states as C constants; ValueError where they are not of n joints."""
    if references.q.shape[1] != n:
        raise ValueError(f"reference states have {references.q.shape[1]} joints, expected {n}")
    arrays = {name: np.asarray(getattr(references, name), float) for name in ("q", "qd", "qdd", "tau")}
    rows = tuple(
        (name, tuple(", ".join(number(value, real) for value in row) for row in array.tolist()))
        for name, array in arrays.items()
    )
    return ReferenceView(len(references.q), rows)
