"""Everyone who is measured, in the order of the tables."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from psdmc.bench.build import NATIVE
from psdmc.bench.case import Case
from psdmc.bench.contestant import Contestant, Unavailable
from psdmc.bench.rivals import casadi_c, mujoco_c, pinocchio_cpp, psdmc_c

Entry = Contestant | Unavailable


@dataclass(frozen=True, slots=True)
class Entrant:
    """A rival: its name, and what builds its contestants for a case under given compiler flags."""

    name: str
    build: Callable[[Case, tuple[str, ...]], Sequence[Entry]]

    def contestants(self, case: Case, flags: tuple[str, ...] = NATIVE) -> Sequence[Entry]:
        return self.build(case, flags)


EVERYONE = (
    Entrant("psdmc factored", lambda case, flags: psdmc_c.contestants(case, "factored", flags)),
    Entrant("psdmc expanded", lambda case, flags: psdmc_c.contestants(case, "expanded", flags)),
    Entrant("Pinocchio", lambda case, flags: pinocchio_cpp.contestants(case, "library", flags)),
    Entrant(
        "Pinocchio header-only", lambda case, flags: pinocchio_cpp.contestants(case, "header-only", flags)
    ),
    Entrant("CasADi", casadi_c.contestants),
    Entrant("MuJoCo", mujoco_c.contestants),
)
