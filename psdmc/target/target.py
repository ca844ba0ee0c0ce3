"""The class Target, which describes the processor for which psdmc generates code. All facts about processors are in
this folder."""

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
    """A processor, and the form of the code for it.

    about          description for people: what it is and what differs from the default
    real, trig     precision and method of sines if the user chooses none
    vectors        vector registers that the C code supports, widest first. The first one whose macro is defined is used,
                   else the last; none: plain C
    forms          forms of each function: for one state, one state per row, one state per lane
    texts          whether the library contains tables of joint names, units and equations of parameters
    hosted         whether there is an operating system: shared libraries, position-independent code, threads
    cache_line     bytes of one prefetch
    blocks_ahead   how many blocks before their use a batch function prefetches its inputs
    flags          flags that the compiler must accept
    host_flags     flags for the machine at hand, of which the first one that the compiler accepts is used; in a package only
                   if its user asks for it
    costs          costs by which psdmc chooses among programs
    tools          prefix of the names of its usual compiler and ar; empty: those of the machine at hand
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
