"""The class Target, which describes the processor for which psdmc generates code. Only the files in this folder contain
facts about processors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from psdmc.target.costs import Costs
from psdmc.target.vectors import VectorUnit

Real = Literal["float64", "float32"]
Trig = Literal["inline", "libm", "freestanding"]
Form = Literal["single", "batch", "batch_soa"]
"""One state a call, one state per row, one state per lane."""

FORMS: tuple[Form, ...] = ("single", "batch", "batch_soa")


@dataclass(frozen=True, slots=True)
class Target:
    """A processor, and the form of the code that psdmc generates for this processor.

    about          description for people: what it is and what differs from the default
    real, trig     default of the precision and of the method of sines
    vectors        kinds of vector registers that the C code supports, widest first. The first kind whose macro is
                   defined is used, else the last; empty: plain C
    forms          forms of each function: for one state, for states in rows of an array, for one state per SIMD lane
    texts          whether the library contains tables of joint names, units and equations of parameters
    hosted         whether there is an operating system: shared libraries, position-independent code, threads
    cache_line     bytes of a cache line, which one prefetch loads
    blocks_ahead   how many blocks before their use a batch function prefetches its inputs
    flags          flags that the compiler must accept
    host_flags     flags for the machine at hand; the first that the compiler accepts is used. In a package, it is used
                   only if the package's user asks for it
    costs          costs by which psdmc chooses among programs
    tools          prefix of the names of the compiler and archiver; empty: those of the machine at hand
    """

    name: str
    about: str
    real: Real
    trig: Trig
    vectors: tuple[VectorUnit, ...]
    forms: tuple[Form, ...]
    texts: bool
    hosted: bool
    cache_line: int
    blocks_ahead: int
    flags: tuple[str, ...]
    host_flags: tuple[str, ...]
    costs: Costs
    tools: str = ""

    def __post_init__(self) -> None:
        widths = [unit.bytes for unit in self.vectors]
        if widths != sorted(set(widths), reverse=True):
            raise ValueError(f"{self.name}: vectors {widths} are not widest first")
        if not self.forms or self.forms != FORMS[: len(self.forms)]:
            raise ValueError(f"{self.name}: forms {self.forms} are no beginning of {FORMS}")
        if self.costs.has_vectors != bool(self.vectors):
            raise ValueError(f"{self.name}: {len(self.vectors)} vector units, but costs of another machine")

    @property
    def has_batches(self) -> bool:
        """Whether psdmc generates functions for many states."""
        return "batch" in self.forms
