"""A kernel that computes limbs (such as legs) in SIMD lanes, one limb per lane, in the form that templates print; and
the vector types that it needs."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

from psdmc.backends.c.body import make_body
from psdmc.backends.c.c_expr import literal
from psdmc.backends.c.lanes import TransposeStage, transpose_stage
from psdmc.backends.c.limb_rows import FOUR
from psdmc.backends.c.limb_stores import StoreView, store_views
from psdmc.backends.c.lines import Body
from psdmc.backends.options import EmitOptions
from psdmc.program.cost import Cost
from psdmc.program.limb_cost import whole_cost
from psdmc.program.limb_program import CORE, LimbGroup, LimbProgram, Stage
from psdmc.program.thin_products import INVERSE, ThinProducts
from psdmc.target.vectors import VectorUnit

NARROWEST = 16
"""Bytes of the narrowest vector."""

HELD = 32
"""Values of a core's stage that may wait for its end to be put out. More of them do not fit the registers of any target:
each is then stored as soon as it is known."""


@dataclass(frozen=True, slots=True)
class LimbWidth:
    """A vector type that holds one real per limb for `count` limbs, made of registers with `lanes` reals each. Lanes
    after the last limb repeat the first limb."""

    count: int
    lanes: int

    @property
    def parts(self) -> int:
        """Registers."""
        return -(-self.count // self.lanes)

    @property
    def filled(self) -> str:
        """C initialiser of all registers of the vector, from one macro argument per limb."""
        names = [names_of(self.count)[k if k < self.count else 0] for k in range(self.parts * self.lanes)]
        parts = (names[k : k + self.lanes] for k in range(0, len(names), self.lanes))
        return ", ".join(f"{{{', '.join(part)}}}" for part in parts)

    @property
    def whole(self) -> int:
        """Parts without a lane to spare."""
        return self.count // self.lanes

    @property
    def folds(self) -> tuple[str, ...]:
        """Lane orders that sum a whole register: in each step its two halves are added, until two lanes are left."""
        distances = [self.lanes >> k for k in range(1, self.lanes.bit_length() - 1)]
        return tuple(", ".join(str(lane ^ distance) for lane in range(self.lanes)) for distance in distances)

    @property
    def piece(self) -> int:
        """The number of a limb's neighbouring outputs in one vector, at most four."""
        return min(self.lanes, FOUR)

    @property
    def stages(self) -> tuple[TransposeStage, ...]:
        """The steps of the transpositions, in registers, of square blocks of `piece` vectors and `piece` lanes."""
        return tuple(transpose_stage(self.lanes, distance) for distance in (1, 2) if distance < self.piece)

    @property
    def beyond(self) -> tuple[int, ...]:
        """Lanes of the last register that hold limbs, if the register is not full."""
        return tuple(range(self.count % self.lanes))


class NamedByCount:
    """C names of types and macros that belong to a number of limbs, such as limbs4."""

    __slots__ = ()
    count: int

    @property
    def name(self) -> str:
        return f"limbs{self.count}"

    @property
    def macro(self) -> str:
        return self.name.upper()


@dataclass(frozen=True, slots=True)
class LimbVector(NamedByCount):
    """The vectors for one number of limbs on every machine of a target.

    widths  possible ones, widest first
    """

    count: int
    widths: tuple[LimbWidth, ...]
    integer: str

    @property
    def in_fours(self) -> bool:
        """Whether the reals of all limbs fill vectors of four without remainder."""
        return self.count % FOUR == 0

    @property
    def arguments(self) -> str:
        return ", ".join(names_of(self.count))


def names_of(count: int) -> list[str]:
    """Names of macro arguments, one per limb."""
    return [f"limb{k}" for k in range(count)]


def limb_vectors(counts: Collection[int], options: EmitOptions) -> tuple[LimbVector, ...]:
    """Return the vector types for groups with these numbers of limbs."""
    narrowest = NARROWEST // options.real_bytes
    integer = "long long" if options.real == "float64" else "int"
    widest = max((unit.bytes // options.real_bytes for unit in options.target.vectors), default=1)
    found = []
    for count in sorted(set(counts)):
        enough = max(narrowest, 1 << (count - 1).bit_length())
        lanes = [narrowest << k for k in range(8) if narrowest << k <= min(enough, widest)]
        found.append(LimbVector(count, tuple(LimbWidth(count, each) for each in reversed(lanes)), integer))
    return tuple(found)


def limb_units(vectors: Sequence[LimbVector], options: EmitOptions) -> tuple[VectorUnit, ...]:
    """Return the registers that vectors of limbs may use in addition to those of the target's other code."""
    wanted = {width.lanes * options.real_bytes for vector in vectors for width in vector.widths}
    halves: list[VectorUnit] = []
    for unit in options.target.vectors:
        narrower = unit.half
        while narrower is not None:
            halves.append(narrower)
            narrower = narrower.half
    return tuple(unit for unit in dict.fromkeys(halves) if unit.bytes in wanted)


@dataclass(frozen=True, slots=True)
class Table:
    """A C array with one vector of limbs per row: its name, and its rows as C text with one number per limb."""

    name: str
    rows: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class GroupView(NamedByCount):
    """One group of equal limbs in C.

    inputs    limb inputs, read before anything is computed
    constants the same at every state; None if there are none
    arrays    what the group's stages store: name and number of rows
    sums      sums over the limbs that the core reads: vector and its length
    """

    count: int
    inputs: tuple[Table, ...]
    constants: Table | None
    arrays: tuple[tuple[str, int], ...]
    sums: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True)
class StageView:
    """One stage of a function with limbs: its body, then the statements that handle what it has stored.

    count  number of limbs that it computes in lanes; 0: the core
    """

    count: int
    body: Body
    after: tuple[str, ...]

    @property
    def macro(self) -> str:
        return f"LIMBS{self.count}"

    @property
    def header(self) -> str:
        """What the body's macros mean."""
        return f"limbs{self.count}.h" if self.count else "one_state.h"


@dataclass(frozen=True, slots=True)
class SharesView:
    """One group's part of the matrix products of a function with limbs. It has the C vector of the factor T, where its
    rows begin in an output, and C text of the product with x."""

    vector: str
    width: int
    places: tuple[int, ...]
    product: str


@dataclass(frozen=True, slots=True)
class ThinView:
    """The matrix products that follow the limb stages of a function.

    arrays   names and lengths of the vectors that the stages store for them
    outputs  names of the matrices that are computed
    rights   names of the right factors E of these matrices
    known    for each output, how many of its first columns are stored already
    n        number of columns
    places   where the core's rows begin in an output
    begins   where the core's rows begin in E
    rows     the core's rows as C text
    groups   the limbs' rows, group by group
    """

    arrays: tuple[tuple[str, int], ...]
    outputs: tuple[str, ...]
    rights: tuple[str, ...]
    known: tuple[int, ...]
    n: int
    places: tuple[int, ...]
    begins: tuple[int, ...]
    rows: tuple[str, ...]
    groups: tuple[SharesView, ...]


def _thin_view(products: ThinProducts) -> ThinView:
    n, wide = products.n, len(products.core)
    return ThinView(
        tuple(products.sizes.items()),
        products.outputs,
        tuple(map(products.right, products.outputs)),
        products.known,
        n,
        tuple(row * n for row in products.core),
        tuple(row * n for row in range(wide)),
        tuple(
            " + ".join(f"{INVERSE}[{row * wide + k}] * right_{k}" for k in range(wide)) for row in range(wide)
        ),
        tuple(
            SharesView(
                group.vector,
                len(group.carriers),
                tuple(row * n for row in group.rows),
                " + ".join(f"share[{k}] * new_{number}" for k, number in enumerate(group.carriers)),
            )
            for group in products.groups
            if group.carriers
        ),
    )


@dataclass(frozen=True, slots=True)
class LimbsView:
    """A kernel's body for one state, with limbs in SIMD lanes.

    least     the smallest number of lanes for which this body is used
    unused    inputs that it never reads
    core      number of reals of the core that other stages read
    stores    statements that store the outputs of limbs, and zeros
    products  matrix products after that; None if there are none
    """

    file: str
    least: int
    unused: tuple[str, ...]
    core: int
    groups: tuple[GroupView, ...]
    stages: tuple[StageView, ...]
    stores: tuple[StoreView, ...]
    products: ThinView | None
    cost: Cost

    @property
    def core_name(self) -> str:
        return CORE

    @property
    def counts(self) -> tuple[int, ...]:
        """The numbers of limbs of the kernel's groups, without duplicates."""
        return tuple(sorted({group.count for group in self.groups}))


def limbs_view(
    name: str, limbs: LimbProgram, inputs: Sequence[str], sizes: dict[str, int], options: EmitOptions
) -> LimbsView:
    """Return a kernel's body with limbs in lanes, as templates print it; `sizes` are the lengths of its outputs."""
    suffix = "" if options.real == "float64" else "f"
    read = {slot.vector for stage in limbs.stages for slot in stage.program.inputs()}
    read |= {own[0].vector for group in limbs.groups for _, own in group.inputs}
    groups = {group.number: group for group in limbs.groups}
    stages = tuple(
        _stage(stage, None if stage.group is None else groups[stage.group], suffix) for stage in limbs.stages
    )
    return LimbsView(
        file=f"{name}_limbs.inc",
        least=limbs.least,
        unused=tuple(each for each in inputs if each not in read),
        core=_length(limbs.stages, CORE),
        groups=tuple(_group(group, limbs.stages, suffix) for group in limbs.groups),
        stages=stages,
        stores=store_views(limbs, sizes | (limbs.products.sizes if limbs.products else {})),
        products=_thin_view(limbs.products) if limbs.products else None,
        cost=whole_cost(limbs),
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
    for slot, _ in stage.program.outputs:
        if slot.vector == group.partial:
            yield f"{group.sum}[{slot.index}] = limbs{group.count}_sum({slot})"
