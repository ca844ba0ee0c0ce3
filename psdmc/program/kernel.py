"""The arithmetic of one generated function, as lists of scalar operations (PROGRAMs), from which C code is printed.

Some functions are variants of others, and their kernels are made from those of the others. A variant reads its own
theta_b for each state, stores only the entries of a matrix that can differ from zero, or has gravity as an input.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cache

from psdmc.program.limb_program import LimbProgram, unpacked
from psdmc.program.passes.drop_unused import drop_unused
from psdmc.program.program import Program, Slot
from psdmc.program.regions import Call, Column, For, Reader, Region, Regions, drop_unread, straight
from psdmc.program.signature import Quantity, Signature

Places = tuple[tuple[int, int], ...]
"""(row, column) of each entry of a matrix that a function stores."""


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
    places: Places = ()
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


# One theta_b per state, for batches of robots with different parameters. The variant reads theta_b from the input
# `thetas`, which is laid out like q. The code repeats all arithmetic on theta_b for each state.


THETA_ROWS = "_theta_rows"
"""Ending of the variants' names."""

THETAS = Quantity("thetas", ("l",), means="base parameters of each state, SI units")

LAST = 1000
"""Added to a function's order: the variants follow all functions."""


@cache
def by_rows(function: Signature) -> Signature:
    """The variant of a function with theta_b."""
    return replace(
        function,
        name=function.name + THETA_ROWS,
        order=function.order + LAST,
        meaning=f"{function.meaning}; one theta_b per state",
        inputs=(*function.inputs, THETAS),
        theta=False,
    )


def kernel_by_rows(kernel: Kernel) -> Kernel:
    """Return the variant of a kernel (one generated function with its lists of operations) that reads one theta_b per
    state.

    Keeps: output values, bit for bit; the order of operations.
    """
    single = _renamed(kernel.single)
    return replace(
        kernel,
        function=by_rows(kernel.function),
        theta=False,
        single=single,
        batch=single if kernel.batch is kernel.single else _renamed(kernel.batch),
        before=None if kernel.before is None else _renamed(kernel.before),
    )


def _renamed(program: Program) -> Program:
    """The PROGRAM with theta_b under the name of its rows."""
    body = tuple(
        each._replace(slot=Slot(THETAS.name, each.slot.index))
        if each.slot is not None and each.slot.vector == "theta_b"
        else each
        for each in program.body
    )
    return Program(body, program.outputs)


# Packed matrices: vectors with the entries of a matrix that can differ from zero


Kept = Mapping[Slot, Slot]
"""Where each entry that is kept goes."""


def packed(kernel: Kernel, function: Signature, columns: int, places: Places) -> Kernel:
    """Return the kernel (operations) of `function`, whose only output is a vector of matrix entries. It is the kernel
    of the whole matrix, without operations that these entries do not need.

    columns  number of columns of the matrix
    places   (row, column) of each entry
    """
    (matrix,), (values,) = kernel.function.outputs, function.outputs
    kept = {
        Slot(matrix.name, row * columns + column): Slot(values.name, k)
        for k, (row, column) in enumerate(places)
    }
    single = _only(kernel.single, matrix.name, kept)
    batch = single if kernel.batch is kernel.single else _only(kernel.batch, matrix.name, kept)
    limbs = None if kernel.limbs is None else _limbs(kernel.limbs, matrix.name, kept)
    regions = None if kernel.regions is None else _regions(kernel.regions, matrix.name, columns, kept)
    return replace(
        kernel, function=function, single=single, batch=batch, limbs=limbs, places=places, regions=regions
    )


def _only(program: Program, matrix: str, kept: Kept) -> Program:
    """The PROGRAM without the matrix's other entries; pivots stay."""
    outputs = tuple(
        (kept.get(slot, slot), index)
        for slot, index in program.outputs
        if slot in kept or slot.vector != matrix
    )
    return drop_unused(Program(program.body, outputs))


def _regions(body: Regions, matrix: str, columns: int, kept: Kept) -> Regions:
    """The regions, which compute the whole matrix in an array of their own, and copies of the entries that are kept."""

    def copied(read: Reader) -> dict[str, Column]:
        (name,) = {place.vector for place in kept.values()}
        return {name: Column([read(matrix, 1, first=slot.index)[0] for slot in kept])}

    arrays = {**body.arrays, matrix: columns * columns}
    return drop_unread(replace(body, arrays=arrays, regions=(*body.regions, straight(copied))))


def _limbs(limbs: LimbProgram, matrix: str, kept: Kept) -> LimbProgram | None:
    """None where an entry is kept of some limbs of a group and left out of others."""
    groups = []
    for group in limbs.groups:
        outputs = []
        for slot, own in group.outputs:
            found = [kept[each] for each in own if each in kept]
            if len(found) not in (0, len(own)):
                return None
            if found:
                outputs.append((slot, tuple(found)))
        groups.append(replace(group, outputs=tuple(outputs)))
    wanted = {group.output: {slot for slot, _ in group.outputs} for group in groups}
    stages = []
    for stage in limbs.stages:  # without the outputs that nothing puts out, and what led to these alone
        stored = []
        for slot, index in stage.program.outputs:
            if slot.vector == matrix:
                if slot in kept:
                    stored.append((kept[slot], index))
            elif slot.vector not in wanted or slot in wanted[slot.vector]:
                stored.append((slot, index))
        stages.append(replace(stage, program=drop_unused(Program(stage.program.body, tuple(stored)))))
    return replace(limbs, groups=tuple(groups), stages=tuple(stages))


# Gravity as an input, by the option gravity-input


GRAVITY = Quantity(
    "gravity",
    ("3",),
    9.81,
    "acceleration of gravity, m/s^2, along the axes of the robot's base frame",
    "m/s^2",
)


@cache
def takes_gravity(function: Signature) -> Signature:
    """Return the signature with gravity as its last input if the function depends on gravity, else the signature."""
    if not function.depends_on_gravity:
        return function
    return replace(function, inputs=(*function.inputs, GRAVITY))


def pass_gravity_on(body: Regions, functions: Collection[str], is_input: bool) -> Regions:
    """Return the function body with gravity as a further argument of its calls of these functions. If gravity is no
    input of the calling function, it is zero."""

    def passed(region: Region) -> Region:
        if isinstance(region, For):
            return replace(region, regions=tuple(map(passed, region.regions)))
        if isinstance(region, Call) and region.function in functions:
            return replace(region, given=(*region.given, (GRAVITY.name, 0)))
        return region

    zero = {} if is_input or not functions else {GRAVITY.name: (0.0, 0.0, 0.0)}
    return replace(body, regions=tuple(map(passed, body.regions)), constants={**body.constants, **zero})
