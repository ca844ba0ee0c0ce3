"""The arithmetic of one generated function, as lists of scalar operations (PROGRAMs), from which C code is printed."""

from __future__ import annotations

from dataclasses import dataclass

from psdmc.program.limb_program import LimbProgram, unpacked
from psdmc.program.program import Program
from psdmc.program.regions import Regions
from psdmc.program.signature import Signature


@dataclass(frozen=True, slots=True)
class Kernel:
    """A generated function and the PROGRAMs (lists of scalar operations) that compute it.

    function  which quantities it reads and writes
    theta     whether it also reads theta_b, the base parameters, at run time
    single    operations for one state, in the best order for one state; empty if `regions` are too long to be written
              out
    batch     operations for one state in each SIMD lane (slot of a vector), in the best order for lanes; may be the
              object `single`
    lowering  the method that made it: 'expanded' (from polynomials) or 'factored' (from recursive algorithms)
    before    if matrix products at the function's end are computed in loops: the operations before these loops, used
              for one state and for lanes. `single` and `batch` have the products written out
    places    for a function whose output is a vector of matrix entries: (row, column) of each entry
    limbs     the function for one state, with equal limbs (such as legs) in the lanes of vectors, if that is cheaper on
              some machine; else None
    regions   the function as loops and calls of other functions, from which C is printed; None: C is printed from
              `single` and `batch`
    """

    function: Signature
    theta: bool
    single: Program
    batch: Program
    lowering: str
    before: Program | None = None
    limbs: LimbProgram | None = None
    places: tuple[tuple[int, int], ...] = ()
    regions: Regions | None = None

    def __post_init__(self) -> None:
        inputs = set(self.inputs)
        outputs = {quantity.name for quantity in self.function.stored}
        for program in (self.single, self.batch):
            self._check(program, inputs, outputs)
        if self.before is not None:
            self._check(self.before, inputs, set(self.function.traced))
        if self.limbs is not None:
            self._check(unpacked(self.limbs), inputs, outputs)

    @property
    def is_loop_of_calls(self) -> bool:
        """Return whether this function's C code only calls other functions in loops, because straight-line code would
        be too long."""
        return not self.single.outputs

    def _check(self, program: Program, inputs: set[str], outputs: set[str]) -> None:
        foreign = [str(slot) for slot in program.inputs() if slot.vector not in inputs]
        foreign += [str(slot) for slot, _ in program.outputs if slot.vector not in outputs]
        if foreign:
            raise ValueError(f"{self.name}: {foreign[0]} in its PROGRAM is no vector of the function")

    @property
    def name(self) -> str:
        """Return the function's name, with '_theta' appended if base parameters are an argument at run time."""
        return self.function.name + ("_theta" if self.theta else "")

    @property
    def inputs(self) -> tuple[str, ...]:
        """Return the names of the vectors that the function reads, in the order of the C function's arguments."""
        return (*(q.name for q in self.function.inputs), *(("theta_b",) if self.theta else ()))
