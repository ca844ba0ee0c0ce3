"""The libraries that the benchmark compares, including psdmc, in the order of the printed tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from psdmc.bench.case import Case
from psdmc.bench.contestant import Contestant, Unavailable
from psdmc.bench.machine import native_flags
from psdmc.bench.rivals import casadi_c, cppadcg_c, mujoco_c, pinocchio_cpp, psdmc_c
from psdmc.errors import PsdmcError


class Builder(Protocol):
    """A function that compiles the code of one library for a robot, with the given compiler flags. It returns the
    compiled functions, ready to be compared, and those that are not available."""

    def __call__(self, case: Case, flags: tuple[str, ...]) -> Sequence[Contestant | Unavailable]: ...


@dataclass(frozen=True, slots=True)
class Entrant:
    """A library in the benchmark. `counted` states whether the instructions of its functions are counted."""

    name: str
    build: Builder
    counted: bool = False

    def contestants(
        self, case: Case, flags: tuple[str, ...] | None = None
    ) -> Sequence[Contestant | Unavailable]:
        """Return the library's functions for this robot, ready to be compared; if the library cannot be built, return
        the reason. The functions are compiled with `flags`; None: with the flags for this machine."""
        try:
            return self.build(case, flags or native_flags())
        except (PsdmcError, OSError) as error:
            return [Unavailable(self.name, str(error))]


EVERYONE = (
    Entrant("psdmc factored", psdmc_c.factored, counted=True),
    Entrant("psdmc expanded", psdmc_c.expanded),
    Entrant("Pinocchio", pinocchio_cpp.library, counted=True),
    Entrant("Pinocchio header-only", pinocchio_cpp.header_only),
    Entrant("CasADi", casadi_c.contestants, counted=True),
    Entrant("CppADCodeGen", cppadcg_c.contestants),
    Entrant("MuJoCo", mujoco_c.contestants),
)
