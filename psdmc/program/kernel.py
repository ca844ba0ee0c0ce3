"""The arithmetic of one generated function, from which emission prints C code."""

from __future__ import annotations

from dataclasses import dataclass

from psdmc.program.limb_program import LimbProgram, unpacked
from psdmc.program.program import Program
from psdmc.program.regions import Regions
from psdmc.program.signature import Signature


@dataclass(frozen=True, slots=True)
class Kernel:
    """A function and the PROGRAMs (lists of scalar operations) that compute it.

    function  which quantities it reads and writes
    theta     whether it also reads theta_b, the base parameters, at run time
    single    operations in an order for one state; empty if `regions` are too long to be written out
    batch     operations in an order for one state per SIMD lane; may be the same object
    lowering  the method that made it: 'expanded' or 'factored'
    before    if matrix products at the function's end are computed in loops, the operations before these loops, for one
              state and for lanes; single and batch have the products written out
    places    for a function that packs a matrix, (row, column) of each entry that it stores
    limbs     the function for one state, with equal limbs in the lanes of vectors, if that is cheaper on some machine;
              else None
    regions   the function as loops and calls, from which C is printed; None: C is printed from the straight lines
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
        """Whether it has no straight-line code, because its C code calls another function and is too long to be written
        out."""
        return not self.single.outputs

    def _check(self, program: Program, inputs: set[str], outputs: set[str]) -> None:
        foreign = [str(slot) for slot in program.inputs() if slot.vector not in inputs]
        foreign += [str(slot) for slot, _ in program.outputs if slot.vector not in outputs]
        if foreign:
            raise ValueError(f"{self.name}: {foreign[0]} in its PROGRAM is no vector of the function")

    @property
    def name(self) -> str:
        """The function's name, with '_theta' if parameters are given at run time."""
        return self.function.name + ("_theta" if self.theta else "")

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the vectors that the kernel reads, in the order of C's arguments."""
        return (*(q.name for q in self.function.inputs), *(("theta_b",) if self.theta else ()))
