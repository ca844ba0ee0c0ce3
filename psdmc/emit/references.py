"""Reference states as C text: what the package's own test compares with."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.emit.tables import number
from psdmc.model.reference_states import ReferenceStates


@dataclass(frozen=True, slots=True)
class ReferenceTable:
    """One constant array: its name, entries per row, and its rows as C text."""

    name: str
    columns: int
    rows: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ReferenceView:
    """References as C text.

    tables    the states' vectors, then what each kernel must give
    expected  the kernels that have such a table
    theta_b   the run-time parameters, one constant each; empty where no kernel takes any
    """

    count: int
    tables: tuple[ReferenceTable, ...]
    expected: tuple[str, ...]
    theta_b: tuple[str, ...]


def reference_view(
    references: ReferenceStates, n: int, real: str, vectors: Collection[str], kernels: Collection[str]
) -> ReferenceView:
    """The states as C constants: the vectors that the package's kernels take, and what these kernels must give.

    ValueError where the states are not of n joints.
    """
    columns = next(iter(references.given.values())).shape[1]
    if columns != n:
        raise ValueError(f"reference states have {columns} joints, expected {n}")
    given = [
        _table(f"{name}_given", array, real) for name, array in references.given.items() if name in vectors
    ]
    known = tuple(name for name in kernels if name in references.expected)
    expected = [_table(f"{name}_expected", references.expected[name], real) for name in known]
    takes_theta = any(name.endswith("_theta") for name in kernels)
    theta_b = tuple(number(value, real) for value in references.theta_b.tolist()) if takes_theta else ()
    return ReferenceView(len(next(iter(references.given.values()))), (*given, *expected), known, theta_b)


def _table(name: str, array: NDArray[np.float64], real: str) -> ReferenceTable:
    rows: Sequence[Sequence[float]] = np.asarray(array, float).tolist()
    texts = tuple(", ".join(number(value, real) for value in row) for row in rows)
    return ReferenceTable(name, array.shape[1], texts)
