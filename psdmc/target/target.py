"""The machine and form that generated code is for. All that psdmc knows about machines is in this folder."""

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
    """A machine, and the form of code for it.

    about          for people: what it is and what differs from the default
    real, trig     precision, and source of sines, where the user chooses none
    vectors        registers that the C is written for, widest first: the first whose macro is defined is used, else the
                   last; none: plain C
    forms          of each function
    texts          whether joints' names, units and parameters' equations are tables in the library
    hosted         whether there is an operating system: shared libraries, position-independent code, threads
    cache_line     bytes of one prefetch
    blocks_ahead   how many blocks before their use a batch prefetches its inputs
    flags          for the compiler, which must take them
    host_flags     the first of these that a compiler takes means the machine at hand; in a package only if its user asks
    costs          figures for the search and the passes
    tools          what the names of its usual compiler and ar begin with; empty: those of the machine at hand
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
        """Whether functions for many states are made."""
        return "batch" in self.forms
