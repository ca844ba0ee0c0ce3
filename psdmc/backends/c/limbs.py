"""The code of a function that computes equal limbs (such as legs) at the same time, as data for the templates. Each
limb is one lane of a SIMD vector."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from psdmc.backends.c.body import make_body
from psdmc.backends.c.expressions import c_real, literal, suffix_of
from psdmc.backends.c.limb_rows import FOUR, StoreView, store_views
from psdmc.backends.c.lines import Body
from psdmc.backends.c.vectors import NamedByCount
from psdmc.backends.info import EmitOptions
from psdmc.program.cost import Cost
from psdmc.program.limb_program import CORE, LimbGroup, LimbProgram, Stage
from psdmc.program.limb_stages import whole_cost
from psdmc.program.products import INVERSE, ThinProducts

HELD = 32
"""Values of a core's stage that may wait for its end to be put out. More of them do not fit the registers of any target:
each is then stored as soon as it is known."""


@dataclass(frozen=True, slots=True)
class Table:
    """A C array of vectors. Each vector holds one number per limb (such as a leg).

    name  C name of the array
    rows  C text of each vector
    """

    name: str
    rows: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class GroupView(NamedByCount):
    """The C data of one group of equal limbs, such as the four legs of a quadruped.

    inputs     values of q, qd and so on of the limbs, read before anything is computed
    constants  lengths and other numbers of the limbs, which are equal at every state; None if there are none
    arrays     name and number of rows of each array that the code of the group stores
    sums       name and length of each vector of sums over the limbs; the code outside limbs reads the sums
    """

    count: int
    inputs: tuple[Table, ...]
    constants: Table | None
    arrays: tuple[tuple[str, int], ...]
    sums: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True)
class StageView:
    """One stage of the code of a function with limbs (such as legs). A stage is computed for all limbs of a group at
    once, or for the core, which is everything outside limbs.

    count  number of limbs that the stage computes in lanes; 0: the stage belongs to the core
    body   C statements of the stage
    after  C statements that handle what the body has stored
    """

    count: int
    body: Body
    after: tuple[str, ...]

    @property
    def macro(self) -> str:
        return f"LIMBS{self.count}"

    @property
    def header(self) -> str:
        """Return the header that defines the body's macros."""
        return f"limbs{self.count}.h" if self.count else "one_state.h"


@dataclass(frozen=True, slots=True)
class SharesView:
    """The code of the rows of one group of equal limbs, such as legs, in an output matrix. ThinView explains the matrix.

    The rows are Y - T x, where x are rows of the core (all joints outside the limbs).

    vector   C name of the factor T
    width    number of columns of T
    places   where the rows of each limb begin in an output
    product  C text of the products T x, which are subtracted from Y
    is_below  whether the rows are those of the outputs `below`
    """

    vector: str
    width: int
    places: tuple[int, ...]
    product: str
    is_below: bool


@dataclass(frozen=True, slots=True)
class ThinView:
    """The C code that finishes X = -M^-1 D, with the mass matrix M (n, n) of a robot with limbs, such as legs.

    If X is the inverse mass matrix, D is minus the identity. If X has derivatives of accelerations, D has derivatives
    of torques. The rows c of M belong to the core (all joints outside the limbs), and the rows l to one limb. Earlier
    code has eliminated the limbs, which gives these matrices:

        T = M_ll^-1 M_lc        V = (M_cc - sum over limbs of M_cl T)^-1
        Y = -M_ll^-1 D_l        E = D_c - sum over limbs of T^T D_l

    The code here computes the rows X_c = -V E of the core, unless earlier code did, and then the rows X_l = Y - T X_c of
    each limb.

    outputs  names of the output matrices X; at first, their rows of limbs contain Y
    rights   for each output, the name of the array E
    known    for each output, how many of its first columns are complete already
    n        number of columns of an output
    places   for each row of the core, the index of its first entry in an output
    begins   for each row of the core, the index of its first entry in E
    rows     for each row of the core, C text of the row's entry of V E; () if earlier code computed X_c
    groups   for each group of equal limbs, the code of the limbs' rows
    below    for each output, the name of the output matrix with the rows of contacts on limbs; () if there are none
    reread   names of the arrays T that are read from memory; () if there is one output. The compiler would otherwise take
             each entry from a vector register, where it lies from its computation, with more instructions
    """

    outputs: tuple[str, ...]
    rights: tuple[str, ...]
    known: tuple[int, ...]
    n: int
    places: tuple[int, ...]
    begins: tuple[int, ...]
    rows: tuple[str, ...]
    groups: tuple[SharesView, ...]
    below: tuple[str, ...]
    reread: tuple[str, ...]


def _thin_view(products: ThinProducts) -> ThinView:
    n, wide = products.n, len(products.core)
    return ThinView(
        products.outputs,
        () if products.is_solved else tuple(map(products.right, products.outputs)),
        products.known,
        n,
        tuple(row * n for row in products.core),
        tuple(row * n for row in range(wide)),
        tuple(
            " + ".join(f"{INVERSE}[{row * wide + k}] * right_{k}" for k in range(wide))
            for row in range(0 if products.is_solved else wide)
        ),
        tuple(
            SharesView(
                group.vector,
                len(group.carriers),
                tuple(row * n for row in group.rows),
                " - ".join(f"share[{k}] * new_{number}" for k, number in enumerate(group.carriers)),
                group.is_below,
            )
            for group in products.groups
            if group.carriers
        ),
        products.below,
        tuple(group.vector for group in products.groups if group.carriers and len(products.outputs) > 1),
    )


@dataclass(frozen=True, slots=True)
class LimbsView:
    """The code of a function for one state, which computes equal limbs (such as legs) in SIMD lanes.

    file      name of the file with the code
    least     the smallest number of lanes with which this code is faster than straight-line code
    unused    inputs of the function that the code never reads
    core      number of values outside limbs that the code of limbs reads
    groups    the groups of limbs
    stages    parts of the code, in their order
    stores    C statements that store the outputs of limbs, and zeros
    products  matrix products after all other code
    factors   names and lengths of the C arrays of the factors in these products
    cost      number of operations
    checked   whether the function's straight-line code computes states with a pivot that is not positive
    """

    file: str
    least: int
    unused: tuple[str, ...]
    core: int
    groups: tuple[GroupView, ...]
    stages: tuple[StageView, ...]
    stores: tuple[StoreView, ...]
    products: tuple[ThinView, ...]
    factors: tuple[tuple[str, int], ...]
    cost: Cost
    checked: bool

    @property
    def core_name(self) -> str:
        return CORE

    @property
    def counts(self) -> tuple[int, ...]:
        """Return the numbers of limbs in the groups of the function, without duplicates, such as 4 for four legs."""
        return tuple(sorted({group.count for group in self.groups}))


def limbs_view(
    name: str, limbs: LimbProgram, inputs: Sequence[str], sizes: dict[str, int], options: EmitOptions
) -> LimbsView:
    """Return the code of a function that computes equal limbs (such as legs) in SIMD lanes, as data for the templates.
    `sizes` are the lengths of the output vectors."""
    suffix = suffix_of(c_real(options))
    read = {slot.vector for stage in limbs.stages for slot in stage.program.inputs()}
    read |= {own[0].vector for group in limbs.groups for _, own in group.inputs}
    groups = {group.number: group for group in limbs.groups}
    stages = tuple(
        _stage(stage, None if stage.group is None else groups[stage.group], suffix) for stage in limbs.stages
    )
    factors = {name: length for each in limbs.products for name, length in each.sizes.items()}
    return LimbsView(
        file=f"{name}_limbs.inc",
        least=limbs.least,
        unused=tuple(each for each in inputs if each not in read),
        core=_length(limbs.stages, CORE),
        groups=tuple(_group(group, limbs.stages, suffix) for group in limbs.groups),
        stages=stages,
        stores=store_views(limbs, sizes | factors),
        products=tuple(map(_thin_view, limbs.products)),
        factors=tuple(factors.items()),
        cost=whole_cost(limbs),
        checked=limbs.checked,
    )


def _length(stages: Sequence[Stage], vector: str) -> int:
    return max(
        (slot.index + 1 for stage in stages for slot, _ in stage.program.outputs if slot.vector == vector),
        default=0,
    )


def _group(group: LimbGroup, stages: Sequence[Stage], suffix: str) -> GroupView:
    rows: dict[str, list[str]] = {}
    for slot, own in group.inputs:
        rows.setdefault(slot.vector, []).append(", ".join(map(str, own)))
    numbers = tuple(", ".join(literal(x, suffix).text for x in row) for row in group.constants)
    arrays = ((vector, _length(stages, vector)) for vector in (group.kept, group.partial, group.output))
    return GroupView(
        count=group.count,
        inputs=tuple(Table(vector, tuple(texts)) for vector, texts in rows.items()),
        constants=Table(group.constant, numbers) if numbers else None,
        arrays=tuple((vector, length) for vector, length in arrays if length),
        sums=tuple((group.sum, length) for length in [_length(stages, group.partial)] if length),
    )


def _stage(stage: Stage, group: LimbGroup | None, suffix: str) -> StageView:
    if group is None:
        values = {i for slot, i in stage.program.outputs if slot.vector != CORE}
        return StageView(0, make_body(stage.program, (), {}, suffix, stores_early=len(values) > HELD), ())
    own = {group.constant, group.kept} | {slot.vector for slot, _ in group.inputs}
    shared = frozenset(slot.vector for slot in stage.program.inputs()) - own
    body = make_body(stage.program, (), {}, suffix, stores_early=True, uniform=shared)
    return StageView(group.count, body, tuple(_after(stage, group)))


def _after(stage: Stage, group: LimbGroup) -> Iterator[str]:
    left = sorted(slot.index for slot, _ in stage.program.outputs if slot.vector == group.partial)
    name, sums, partials = f"limbs{group.count}_sum", group.sum, group.partial
    while left:
        if group.count % FOUR == 0 and left[:FOUR] == list(range(left[0], left[0] + FOUR)):
            yield f"{name}s({partials} + {left[0]}, {sums} + {left[0]})"
            left = left[FOUR:]
        else:
            yield f"{sums}[{left[0]}] = {name}({partials}[{left[0]}])"
            left = left[1:]
