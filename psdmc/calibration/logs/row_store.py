"""Rows of numbers that may exceed the memory: kept in it while they are few, then on disk."""

from __future__ import annotations

import tempfile
from typing import IO

import numpy as np

from psdmc.calibration.logs.log import Array

HELD_BYTES = 128 * 1024**2
"""Bytes of rows kept in memory: 800,000 rows of seven joints; beyond, they go to a temporary file."""


class RowStore:
    """Rows of equal width, appended piece by piece and read back by place; the temporary file is removed with the
    store.

    width   numbers in a row
    held    bytes in memory before the file is used
    """

    def __init__(self, width: int, held: int = HELD_BYTES) -> None:
        self.width, self.held = width, held
        self._pieces: list[Array] = []
        self._file: IO[bytes] | None = None
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def on_disk(self) -> bool:
        return self._file is not None

    def append(self, rows: Array) -> None:
        """(k, width) rows after those that are there."""
        if rows.ndim != 2 or rows.shape[1] != self.width:
            raise ValueError(f"rows of shape {rows.shape}, expected (k, {self.width})")
        self._count += len(rows)
        if self._file is None:
            self._pieces.append(rows)
            if 8 * self.width * self._count > self.held:
                self._to_disk()
        else:
            self._file.write(np.ascontiguousarray(rows, dtype=np.float64).tobytes())

    def _to_disk(self) -> None:
        self._file = tempfile.TemporaryFile(prefix="psdmc_")  # noqa: SIM115  it lives as long as the store
        for piece in self._pieces:
            self._file.write(np.ascontiguousarray(piece, dtype=np.float64).tobytes())
        self._pieces = []

    def rows(self, start: int, stop: int) -> Array:
        """(stop - start, width) a copy of some rows."""
        stop = min(stop, self._count)
        if self._file is None:
            if len(self._pieces) > 1:
                self._pieces = [np.concatenate(self._pieces)]
            return self._pieces[0][start:stop] if self._pieces else np.zeros((0, self.width))
        self._file.seek(8 * self.width * start)
        content = self._file.read(8 * self.width * (stop - start))
        return np.frombuffer(content, dtype=np.float64).reshape(-1, self.width)
