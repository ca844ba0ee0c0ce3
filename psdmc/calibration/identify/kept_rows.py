"""Stores blocks of a linear problem for several rounds: in memory while they are small, then in a temporary file."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from psdmc.calibration.identify.linear_rows import Block
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.stored_log import RowStore

BLOCK_SAMPLES = 2048
"""Samples that come as one block."""


class KeptRows:
    """Rows of a linear problem with n joints and l unknowns. They are appended once and read repeatedly.

    held  most bytes in memory before a file is used
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
        """Append k rows: columns (k, n, l), and the columns (k, n, l) that sensor noise alone would give."""
        for store, values in ((self._columns, columns), (self._noise, noise)):
            store.append(np.ascontiguousarray(values.reshape(len(values), -1)))

    def __iter__(self) -> Iterator[Block]:
        for start in range(0, len(self), BLOCK_SAMPLES):
            stop = min(start + BLOCK_SAMPLES, len(self))
            shape = (stop - start, *self.shape)
            yield Block(
                self._columns.rows(start, stop).reshape(shape), self._noise.rows(start, stop).reshape(shape)
            )
