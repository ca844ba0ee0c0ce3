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

    function  name, inputs and outputs of the function
    theta     True: the base parameters theta_b are an argument of the function; False: they are no argument
    single    PROGRAM for one state, in the best order for one state; has no outputs if the code only calls other
              functions in loops
    batch     PROGRAM for code that computes one state per SIMD lane (slot of a vector), in the best order for such code;
              may be the object `single`
    lowering  how the operations were found: 'expanded' (from polynomials) or 'factored' (from recursive algorithms)
    before    PROGRAM without the matrix products at the function's end, if the C code computes these products in loops;
              else None. `single` and `batch` contain the products
    limbs     code for one state that computes equal limbs, such as legs, in the lanes of SIMD vectors; None: such code
              is cheaper on no machine
    places    (row, column) of each entry of the output, for a function that returns matrix entries as a vector
    regions   loops, and calls of other functions, from which the C code is printed; None: the C code is printed from the
              other fields
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
        """Return whether the C code only calls functions in loops, as straight-line code would be too long."""
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
