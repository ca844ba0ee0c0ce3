"""States and expected results as C text, for the package's self-test."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.backends.c.self_test import GivenVector
from psdmc.backends.c.tables import number
from psdmc.backends.reference_load import COM, INERTIA, MASS, ReferenceLoad
from psdmc.backends.reference_states import ReferenceStates
from psdmc.robot.inertia import six_of


@dataclass(frozen=True, slots=True)
class ReferenceTable:
    """One constant C array of the self-test: its name, the number of columns, and the C text of each row. A row belongs
    to one state."""

    name: str
    columns: int
    rows: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class LoadView:
    """The example load of the self-test as C text: mass, com (centre of mass), inertia (Ixx Ixy Iyy Ixz Iyz Izz), and
    rows `added`. Each row is what the load adds to theta_b (the base parameters) at the tip or at one named frame."""

    mass: str
    com: str
    inertia: str
    added: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ReferenceView:
    """The data of the self-test as C text.

    count     number of states
    tables    the inputs at all states, then the expected values of each output
    expected  names of the outputs that have a table of expected values
    theta_b   the base parameters that the functions take as an input, one constant each; empty if no function takes
              them
    load      a load and what it adds to theta_b; None if the package has no functions that add loads
    """

    count: int
    tables: tuple[ReferenceTable, ...]
    expected: tuple[str, ...]
    theta_b: tuple[str, ...]
    load: LoadView | None = None


def reference_view(
    references: ReferenceStates,
    real: str,
    vectors: Collection[GivenVector],
    labels: Collection[str],
    takes_theta: bool,
) -> ReferenceView:
    """Return the data of the self-test as C text: the inputs of the package's functions at some states, and the
    expected outputs.

    vectors      inputs that the functions read
    labels       names of the outputs that the self-test compares
    takes_theta  whether a function takes the base parameters as an input

    Raises ValueError if the states belong to another robot.
    """
    sizes = {vector.name: vector.size for vector in vectors}
    given = []
    for name, array in references.given.items():
        if name not in sizes:
            continue
        if array.shape[1] != sizes[name]:
            raise ValueError(
                f"reference states have {array.shape[1]} entries of {name}, expected {sizes[name]}"
            )
        given.append(_table(f"{name}_given", array, real))
    known = tuple(label for label in labels if label in references.expected)
    expected = [_table(f"{label}_expected", references.expected[label], real) for label in known]
    theta_b = tuple(number(value, real) for value in references.theta_b.tolist()) if takes_theta else ()
    load = None if references.load is None else _load_view(references.load, real)
    count = len(next(iter(references.given.values())))
    return ReferenceView(count, (*given, *expected), known, theta_b, load)


def _table(name: str, array: NDArray[np.float64], real: str) -> ReferenceTable:
    rows: Sequence[Sequence[float]] = np.asarray(array, float).tolist()
    texts = tuple(", ".join(number(value, real) for value in row) for row in rows)
    return ReferenceTable(name, array.shape[1], texts)


def _load_view(load: ReferenceLoad, real: str) -> LoadView:
    """The load as C constants."""

    def listed(values: NDArray[np.float64]) -> str:
        return ", ".join(number(float(value), real) for value in values)

    inertia = listed(np.asarray(six_of(INERTIA)))
    return LoadView(
        number(MASS, real), listed(np.array(COM)), inertia, tuple(listed(row) for row in load.added)
    )
