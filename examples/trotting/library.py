"""The controller in C, built with the emitted package and OSQP's code, and called from Python through cffi."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from typing import Any

import cffi
import numpy as np

HERE = Path(__file__).parent
Array = np.ndarray


class Controller:
    """controller.c for one package; there is one of it in a process, as its memory is the library's."""

    def __init__(self, package: Path) -> None:
        subprocess.run(["make", "--silent", "-f", str(HERE / "Makefile"), f"PACKAGE={package}"], check=True)
        self._ffi = cffi.FFI()
        self._ffi.cdef(_declarations((HERE / "controller.h").read_text()))
        self._library: Any = self._ffi.dlopen(str((package / "trot" / "libtrot.so").resolve()))
        self._command = self._ffi.new("struct command *")

    def begin(self, q: Array, method: str = "BY_PROGRAMME") -> None:
        """`method` is one of those that controller.h names."""
        if self._library.trot_begin(self._reals(q), getattr(self._library, method)):
            raise SystemExit("the package's frames are not feet named LF, RF, LH, RH, in this order")

    def step(self, time: float, q: Array, v: Array) -> Any:
        """`struct command`, valid until the next call."""
        self._library.trot_step((time, self._reals(q), self._reals(v)), self._command)
        return self._command

    def array(self, field: Any) -> Array:
        """A copy of an array of the command."""
        return np.array(list(field))

    def problem(self) -> tuple[Array, Array, Array]:
        """Rows of the last quadratic programme, and their lower and upper bounds."""
        rows, columns = self._library.ROWS, self._library.COLUMNS
        A, lower, upper = np.empty((rows, columns)), np.empty(rows), np.empty(rows)
        self._library.trot_problem(*map(self._reals, (A, lower, upper)))
        return A, lower, upper

    def _reals(self, array: Array) -> Any:
        return self._ffi.cast("double *", self._ffi.from_buffer(array))


def _declarations(header: str) -> str:
    """What cffi reads of a header: all but the comments and the preprocessor's lines."""
    return re.sub(r"(?m)^#.*$", "", re.sub(r"/\*.*?\*/", "", header, flags=re.DOTALL))
