"""Rows of a linear least-squares problem in blocks of samples, and sums over these rows that a fit needs. So no fit
needs all rows in memory: few rows are kept there, more rows in a temporary file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from psdmc.calibration.logs.log import Array, RowStore
from psdmc.calibration.logs.parts import in_threads


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Some of the samples of a linear least-squares problem, with N samples, n joints and l unknowns.

    columns   (N, n, l) torques per unit of each unknown
    noise     (N, n, l) columns that the sensors' noise alone would give; None: none
    consider  (N, n, k) columns of k quantities that are uncertain but not estimated (estimate.Consider); None: none
    """

    columns: Array
    noise: Array | None = None
    consider: Array | None = None

    def __len__(self) -> int:
        return len(self.columns)


class Rows(Protocol):
    """The blocks of samples of a linear least-squares problem, in order. They can be read repeatedly."""

    def __iter__(self) -> Iterator[Block]: ...


@dataclass(frozen=True, slots=True, eq=False)
class Reduced:
    """A weighted linear least-squares problem in triangular form. A (rows, l) are the weighted columns of l unknowns, y
    are the weighted targets, and `start` are values of the unknowns. R is triangular, with R'R = A'A.

    factor  (l, l) R
    onto    (l,)   R^-T A'(y - A start)
    noise   (l, l) N'N of the weighted noise columns N; None if there are none
    """

    factor: Array
    onto: Array
    noise: Array | None


def reduced(rows: Rows, target: Array, weights: Array, start: Array | None) -> Reduced:
    """Return a linear least-squares problem in triangular form. Only the rows of one block of samples and the
    triangular matrix are in memory at a time.

    target   (N samples, n joints) measured torques
    weights  (N, n) factors of the rows
    start    (l,) values of the unknowns, whose torques are subtracted from `target` first; None: zero
    """

    def of_block(numbered: tuple[Block, slice]) -> tuple[Array, Array | None]:
        block, own = numbered
        l, weight = block.columns.shape[2], weights[own]
        ahead = target[own] if start is None else target[own] - block.columns @ start
        flat = (block.columns * weight[:, :, None]).reshape(-1, l)
        together = np.column_stack([flat, (ahead * weight).reshape(-1)])
        triangle = _triangle(together)
        if block.noise is None:
            return triangle, None
        wrong = (block.noise * weight[:, :, None]).reshape(-1, l)
        return triangle, wrong.T @ wrong

    triangle, noise, l = np.zeros((0, 0)), None, 0
    wrong: Array | None
    for (block, _), (own, wrong) in in_threads(with_rows(rows), of_block):
        l = block.columns.shape[2]
        triangle = np.asarray(np.linalg.qr(np.vstack([triangle, own]), mode="r")) if len(triangle) else own
        noise = wrong if noise is None or wrong is None else noise + wrong
    whole = np.vstack([triangle, np.zeros((max(l - len(triangle), 0), l + 1))])
    return Reduced(whole[:l, :l], whole[:l, l], noise)


IN_CACHE = 2048
"""Rows of which LAPACK computes one QR decomposition. Twice as many rows leave the cache."""


def _triangle(rows: Array) -> Array:
    """R of the QR decomposition of many rows."""
    pieces = [np.linalg.qr(rows[k : k + IN_CACHE], mode="r") for k in range(0, len(rows), IN_CACHE)]
    return np.asarray(pieces[0] if len(pieces) == 1 else np.linalg.qr(np.vstack(pieces), mode="r"))


def residual_of(rows: Rows, target: Array, values: Array) -> Array:
    """Return the residual at all samples, an array (N samples, n joints): target minus columns @ values."""
    residual = np.empty_like(target)
    for block, own in with_rows(rows):
        residual[own] = target[own] - block.columns @ values
    return residual


@dataclass(frozen=True, slots=True, eq=False)
class Collected:
    """Sums over the weighted rows of a least-squares problem, from which standard deviations are computed. A are the
    weighted columns of l unknowns.

    squares   (n, l, l) A'A of the rows of each of n joints
    inner     (l, l)    A'A of the rows whose weighted residual is within a bound
    scores    (c, l)    A' times the weighted residual, for each of c periods of time
    consider  (l, k)    A' times the weighted columns of k results of earlier steps (Consider)
    """

    squares: Array
    inner: Array
    scores: Array
    consider: Array


def collected(rows: Rows, weights: Array, weighted: Array, clusters: int, bound: float = np.inf) -> Collected:
    """Return the sums over all rows of a least-squares problem from which standard deviations are computed.

    weights   (N samples, n joints) factors of the rows
    weighted  (N, n) residual times weights
    clusters  number of periods of time for which `scores` are summed; 0: none
    bound     size of `weighted` up to which a row counts in `inner`
    """
    count, n = weighted.shape
    squares, scores, consider = np.zeros((n, 0, 0)), np.zeros((clusters, 0)), np.zeros((0, 0))
    inner = np.zeros((0, 0))
    for block, own in with_rows(rows):
        flat = block.columns * weights[own][:, :, None]
        if not squares.shape[1]:
            l, k = flat.shape[2], 0 if block.consider is None else block.consider.shape[2]
            squares, scores, consider = np.zeros((n, l, l)), np.zeros((clusters, l)), np.zeros((l, k))
            inner = np.zeros((l, l))
        squares += np.stack([flat[:, j].T @ flat[:, j] for j in range(n)])
        within = flat[np.abs(weighted[own]) <= bound]
        inner += within.T @ within
        if clusters:
            stretch = np.arange(own.start, own.stop) * clusters // count
            np.add.at(scores, stretch, np.einsum("tnl,tn->tl", flat, weighted[own]))
        if block.consider is not None:
            consider += np.einsum("tnl,tnk->lk", flat, block.consider * weights[own][:, :, None])
    return Collected(squares, inner, scores, consider)


def with_rows(rows: Rows) -> Iterator[tuple[Block, slice]]:
    """Each block with its place among all samples."""
    start = 0
    for block in rows:
        yield block, slice(start, start + len(block))
        start += len(block)


BLOCK_SAMPLES = 2048
"""Samples that come as one block."""


class KeptRows:
    """Rows of a linear least-squares problem with n joints and l unknowns. They are appended once and read repeatedly.

    held  largest number of bytes in memory; more rows go to a temporary file
    """

    def __init__(self, n: int, l: int, held: int) -> None:
        self.shape = (n, l)
        self._columns, self._noise = RowStore(n * l, held // 2), RowStore(n * l, held // 2)

    def __len__(self) -> int:
        return len(self._columns)

    @property
    def on_disk(self) -> bool:
        return self._columns.on_disk

    def append(self, columns: Array, noise: Array) -> None:
        """Append k samples. `columns` (k, n joints, l unknowns) are torques per unit of each unknown. `noise` (k, n, l)
        are the columns that sensor noise alone would give."""
        for store, values in ((self._columns, columns), (self._noise, noise)):
            store.append(np.ascontiguousarray(values.reshape(len(values), -1)))

    def __iter__(self) -> Iterator[Block]:
        return self.blocks(0, len(self))

    def between(self, first: int, end: int) -> Rows:
        """Return the rows of the samples from `first` to before `end`, which are read when they are needed."""
        return _Between(self, first, end)

    def blocks(self, first: int, end: int) -> Iterator[Block]:
        """Yield the blocks of the samples from `first` to before `end`."""
        for start in range(first, end, BLOCK_SAMPLES):
            stop = min(start + BLOCK_SAMPLES, end)
            shape = (stop - start, *self.shape)
            yield Block(
                self._columns.rows(start, stop).reshape(shape), self._noise.rows(start, stop).reshape(shape)
            )


@dataclass(frozen=True, slots=True)
class _Between:
    """Some consecutive samples of kept rows."""

    rows: KeptRows
    first: int
    end: int

    def __iter__(self) -> Iterator[Block]:
        return self.rows.blocks(self.first, self.end)
