"""E and P of a model: E holds the exponents of the torques' monomials, P their coefficients per base parameter.

The torques of small robots are also returned as SymPy expressions, term by term from E and P."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from psdmc.errors import InputError, ToolchainError
from psdmc.reproducible import length
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import Array, Mechanism, made_again

if TYPE_CHECKING:
    import sympy
    from scipy import sparse


BLOCKS = 5
"""Row blocks of E: exponents of q, sin q, cos q, qd and qdd."""

MOST_MONOMIALS = 2000
"""Of one torque as a SymPy expression. SymPy takes about a millisecond for each."""


class RowBlocks(NamedTuple):
    """The rows of E, the matrix of exponents: five blocks of n rows, one for each of q, sin q, cos q, qd and qdd.

    position  rows of q, sin q and cos q
    rates     rows of qd and qdd
    """

    q: slice
    sin: slice
    cos: slice
    qd: slice
    qdd: slice
    position: slice
    rates: slice

    @staticmethod
    def of(n: int) -> RowBlocks:
        q, sin, cos, qd, qdd = (slice(k * n, (k + 1) * n) for k in range(BLOCKS))
        return RowBlocks(q, sin, cos, qd, qdd, slice(q.start, cos.stop), slice(qd.start, qdd.stop))


class Entries(NamedTuple):
    """The entries of n sparse matrices P[i], (p, l), one per joint torque. Entries are in the order of joints, then of
    rows.

    joint   (k,) int32    number i of the matrix, 0 to n - 1
    row     (k,) int32    monomial, 0 to p - 1
    column  (k,) int32    base parameter, 0 to l - 1
    value   (k,) float64
    """

    joint: NDArray[Any]
    row: NDArray[Any]
    column: NDArray[Any]
    value: NDArray[Any]


@dataclass(frozen=True, slots=True, eq=False)
class Expansion:
    """E and P, with which the torques of n joints are tau[i] = y @ P[i] @ theta_b. y are the values of the p monomials,
    and theta_b are l base parameters.

    E        (5n, p) uint8   exponents of q, sin q, cos q, qd, qdd, n rows each
    entries  nonzero entries of the matrices P[i]
    l        number of columns of each P[i]
    """

    E: NDArray[np.uint8]
    entries: Entries
    l: int
    _matrices: list[sparse.csr_array] = field(default_factory=list, init=False, repr=False)

    __reduce__ = made_again

    def __post_init__(self) -> None:
        exponents = np.array(self.E, dtype=np.uint8, order="C")
        if exponents.ndim != 2 or exponents.shape[0] % BLOCKS:
            raise ValueError(f"E has shape {exponents.shape}, expected (5n, p)")
        exponents.setflags(write=False)
        object.__setattr__(self, "E", exponents)
        joint, row, column = (np.array(part, np.int32) for part in self.entries[:3])
        kept = Entries(joint, row, column, np.array(self.entries.value, np.float64))
        bounds = (self.n, self.p, self.l)
        if any(part.shape != kept.value.shape or part.ndim != 1 for part in kept):
            raise ValueError("the entries of P have parts of different lengths")
        for part, bound in zip(kept[:3], bounds, strict=True):
            if part.size and not 0 <= part.min() <= part.max() < bound:
                raise ValueError(f"P has entries outside its {self.n} matrices of shape {bounds[1:]}")
        if (np.diff(kept.joint) < 0).any():
            raise ValueError("the entries of P are not joint by joint")
        for part in kept:
            part.setflags(write=False)
        object.__setattr__(self, "entries", kept)

    @staticmethod
    def of(E: NDArray[Any], P: Sequence[sparse.csr_array]) -> Expansion:
        """Return an Expansion from the matrix E and n matrices P (p, l). Raises ValueError if their shapes do not
        fit."""
        from scipy import sparse

        shapes = {matrix.shape for matrix in P}
        if len(shapes) != 1 or BLOCKS * len(P) != E.shape[0] or next(iter(shapes))[0] != E.shape[1]:
            raise ValueError(f"P has shapes {sorted(shapes)}, E {E.shape}")
        blocks = [sparse.coo_array(matrix) for matrix in P]
        entries = Entries(
            np.concatenate([np.full(block.nnz, i) for i, block in enumerate(blocks)]),
            np.concatenate([block.coords[0] for block in blocks]),
            np.concatenate([block.coords[1] for block in blocks]),
            np.concatenate([block.data for block in blocks]),
        )
        return Expansion(E, entries, int(P[0].shape[1]))

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.E.shape[0]) // BLOCKS

    @property
    def p(self) -> int:
        """Number of monomials."""
        return int(self.E.shape[1])

    @property
    def P(self) -> tuple[sparse.csr_array, ...]:
        """Return the n sparse matrices P (p, l), one per joint. They are made on first access, because SciPy is slow to
        import."""
        if not self._matrices:
            from scipy import sparse

            joint, row, column, value = self.entries
            starts = np.searchsorted(joint, np.arange(self.n + 1)).tolist()
            self._matrices.extend(
                sparse.csr_array((value[a:b], (row[a:b], column[a:b])), shape=(self.p, self.l))
                for a, b in pairwise(starts)
            )
        return tuple(self._matrices)


def torque_expression(
    robot: Mechanism, expansion: Expansion, joint: int | str, theta_b: Array | None
) -> sympy.Expr:
    """Return the torque of one joint as a SymPy expression: the sum of monomials times combinations of theta_b.

    joint    number from 0, or name
    theta_b  (l,) numbers that replace the symbols theta_b0, theta_b1 and so on; None: the symbols stay

    The symbols q1, qd1, qdd1 and so on are real. In them, joints are numbered from 1, as in the equations of base
    parameters. Symbols theta_b0 and so on are numbered as the entries of theta_b.

    Raises InputError if there is no such joint, or if the torque has more than MOST_MONOMIALS monomials. Raises
    ToolchainError if SymPy is not installed.
    """
    sp, number = _sympy(), _joint_number(robot, joint)
    entries = expansion.entries
    own = np.flatnonzero(entries.joint == number)
    used, place = np.unique(entries.row[own], return_inverse=True)
    if len(used) > MOST_MONOMIALS:
        raise InputError(
            f"the torque of joint {shown(robot.v_names[number])} has {len(used)} monomials, "
            f"expressions are made of up to {MOST_MONOMIALS}",
            "lock joints or cut the chain; model.E, model.P and psdmc show --terms have all of them",
        )
    thetas = list(sp.symbols(f"theta_b:{expansion.l}", real=True))
    if theta_b is not None:
        thetas = [sp.Float(value) for value in theta_b.tolist()]
    weights: list[list[Any]] = [[] for _ in used]
    for k, entry in zip(place.tolist(), own.tolist(), strict=True):
        weights[k].append(_number(sp, float(entries.value[entry])) * thetas[entries.column[entry]])
    factors = _symbols(sp, robot.nv)
    strength = _number(sp, length(np.asarray(robot.gravity)))
    terms = (
        sp.Add(*weight) * _monomial(sp, expansion, int(column), factors, strength)
        for column, weight in zip(used, weights, strict=True)
    )
    found: sympy.Expr = sp.Add(*terms)
    return found


def _joint_number(robot: Mechanism, joint: int | str) -> int:
    numbers = {name: i for i, name in enumerate(robot.v_names)} | {i: i for i in range(robot.nv)}
    if joint not in numbers:
        raise InputError(
            f"no joint {shown(joint)}",
            f"the joints are 0 to {robot.nv - 1}: {', '.join(robot.v_names)}",
        )
    return numbers[joint]


def _sympy() -> Any:
    try:
        import sympy
    except ImportError as error:
        raise ToolchainError("torque expressions need SymPy", "pip install 'psdmc[notebook]'") from error
    return sympy


def _symbols(sp: Any, n: int) -> list[Any]:
    """The quantities that the rows of E are exponents of."""
    q, qd, qdd = (sp.symbols(f"{letters}1:{n + 1}", real=True) for letters in ("q", "qd", "qdd"))
    return [*q, *map(sp.sin, q), *map(sp.cos, q), *qd, *qdd]


def _monomial(sp: Any, expansion: Expansion, column: int, factors: list[Any], strength: Any) -> Any:
    """A column of E as a product; one without rates times |g|."""
    exponents = expansion.E[:, column]
    product = sp.Mul(*(factors[row] ** int(exponents[row]) for row in np.flatnonzero(exponents)))
    return product if exponents[RowBlocks.of(expansion.n).rates].any() else strength * product


def _number(sp: Any, value: float) -> Any:
    """A whole number as such, any other one as SymPy's float."""
    return sp.Integer(int(value)) if value.is_integer() else sp.Float(value)
