"""Stores the rows of a linear least-squares problem, which the solver reads several times. Few rows are kept in memory,
more rows in a temporary file."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from psdmc.calibration.identify.linear_rows import Block
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.stored_log import RowStore

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
        for start in range(0, len(self), BLOCK_SAMPLES):
            stop = min(start + BLOCK_SAMPLES, len(self))
            shape = (stop - start, *self.shape)
            yield Block(
                self._columns.rows(start, stop).reshape(shape), self._noise.rows(start, stop).reshape(shape)
            )
