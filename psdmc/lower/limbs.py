"""Recording of a function's operations for a robot with equal limbs: one limb of each group is recorded. Numbers that
differ between limbs are constants with one value per limb."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import accumulate, product

import numpy as np

from psdmc.dynamics.constraints import contact_jacobian
from psdmc.dynamics.coordinates import joints_of_rates, leading
from psdmc.dynamics.frames import Frame, has_floating_base
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import SingularMatrix, factorize, inner_product
from psdmc.errors import InternalError
from psdmc.lower.factored import Arrangement, RobotConstants, carrier_values, in_unit, traced, without_bodies
from psdmc.lower.limb_frames import Place, merged_contacts, one_limb, places
from psdmc.lower.link_parameters import bodies_from_carriers
from psdmc.lower.reframe import Reframed
from psdmc.program.limb_program import LimbGroup, LimbSums, Spread
from psdmc.program.limb_stages import StageCost, traced_stage_costs
from psdmc.program.products import Shares, ThinProducts
from psdmc.program.program import Program, Slot
from psdmc.program.signature import THIN, Quantity, Signature
from psdmc.program.trace import Symbol, Tracer
from psdmc.recipes.recipe import Recipe
from psdmc.robot.limbs import Limbs
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, Array, Placement


@dataclass(frozen=True, slots=True)
class TracedLimbs:
    """The recorded function of a robot with limbs.

    program   operations of the core (all bodies outside limbs) and of one limb of each group, not yet divided into
              stages
    groups    the groups of equal limbs
    products  matrix products that follow
    """

    program: Program
    groups: tuple[LimbGroup, ...]
    products: tuple[ThinProducts, ...] = ()


def trace_limbs(
    recipe: Recipe, arrangement: Arrangement, robot: RobotConstants, groups: Sequence[Limbs]
) -> TracedLimbs:
    """Record the operations of one function for a robot with known theta_b. Of each group of equal limbs, only one limb
    is recorded."""
    trace = _Trace(recipe, arrangement, robot, groups)
    return trace.needed(list(trace.outputs(trace.recorded())))


def cost_of_limbs(
    recipe: Recipe, arrangement: Arrangement, robot: RobotConstants, groups: Sequence[Limbs]
) -> tuple[tuple[LimbGroup, ...], list[StageCost]]:
    """Return the groups that trace_limbs would return, and the cost of each stage. A stage is a part that one group, or
    the core outside the limbs, computes."""
    trace = _Trace(recipe, arrangement, robot, groups)
    return trace.counted(list(trace.outputs(trace.recorded())))


@dataclass(slots=True)
class _Group:
    """A group while it is traced.

    stored  its slot for each value that it puts out
    """

    number: int
    count: int
    inputs: list[Spread] = field(default_factory=list)
    outputs: list[Spread] = field(default_factory=list)
    stored: dict[Hashable, Slot] = field(default_factory=dict)

    @property
    def vectors(self) -> LimbGroup:
        return LimbGroup(self.number, self.count, tuple(self.inputs), (), tuple(self.outputs))


def has_contacts(signature: Signature) -> bool:
    """Return whether an input of the function has an entry for each contact."""
    return any("contacts" in quantity.axes for quantity in signature.inputs)


def have_contacts_alike(recipe: Recipe, frames: Reframed, groups: Sequence[Limbs]) -> bool:
    """Return whether the function has no contacts, or all contacts are at corresponding places of equal limbs that can
    hold them alone, without closed loops. A limb can hold them if its rates move them in all directions of their rows."""
    if not has_contacts(recipe.signature):
        return True
    merged = merged_contacts(frames.named, places(len(frames.frames), groups))
    if merged is None or frames.loops:
        return False
    contacts = [each for each in frames.named if each.rows]
    owners = joints_of_rates(frames.frames)
    q = [
        value if frame.joint.nq > frame.joint.nv else 0.3 + 0.37 * k
        for k, frame in enumerate(leading(frames.frames))
        for value in frame.joint.neutral
    ]
    for group, limbs in enumerate(groups):
        held = [contacts[each.numbers[0]] for each in merged if each.group == group]
        rates = [rate for rate, joint in enumerate(owners) if joint in limbs[0]]
        jacobian = contact_jacobian(frames.frames, held, q)
        if not _are_independent([[row[rate] for rate in rates] for row in jacobian]):
            return False
    return True


def _are_independent(rows: Sequence[Sequence[float]]) -> bool:
    """Whether no row is a linear combination of the others, by the pivots of the products of rows."""
    products = [[inner_product(a, b) for b in rows] for a in rows]
    try:
        pivots = factorize(products).pivots
    except SingularMatrix:
        return False
    return all(pivot > 1e-9 * products[k][k] for k, pivot in enumerate(pivots))


def has_columns(recipe: Recipe) -> bool:
    """Return whether an output of the recipe's function has one column for each base parameter."""
    return any("l" in quantity.axes for quantity in recipe.signature.outputs)


def selected(lift: Array) -> dict[int, int]:
    """Return, for each row of the matrix `lift` with an entry one, the column of this entry.

    lift  (11 n, l)  from base parameters to standard parameters. If a base parameter is a single standard parameter,
                     the row is this parameter and the column is the base parameter
    """
    rows, columns = np.nonzero(lift == 1.0)
    return dict(zip(rows.tolist(), columns.tolist(), strict=True))


def have_columns_alike(lift: Array, groups: Sequence[Limbs]) -> bool:
    """Return whether each base parameter is a single standard parameter, and all limbs of a group have base parameters
    at corresponding places."""
    found = selected(lift)
    if not len(found) == len(set(found.values())) == lift.shape[1] == np.count_nonzero(lift):
        return False
    names = range(PARAMETERS_PER_LINK)
    of_limbs = (
        {
            tuple(PARAMETERS_PER_LINK * joint + name in found for joint in limb for name in names)
            for limb in limbs
        }
        for limbs in groups
    )
    return all(len(patterns) == 1 for patterns in of_limbs)


class _Trace:
    """One trace. Places take the place of joints."""

    def __init__(
        self, recipe: Recipe, arrangement: Arrangement, robot: RobotConstants, groups: Sequence[Limbs]
    ) -> None:
        self.signature = recipe.signature.of_limbs if groups else recipe.signature
        self.recipe, self.arrangement, self.robot = (
            replace(recipe, signature=self.signature),
            arrangement,
            robot,
        )
        self.products: tuple[ThinProducts, ...] = ()
        self.tracer = Tracer()
        self.groups = [_Group(number, len(limbs)) for number, limbs in enumerate(groups)]
        self.sums = LimbSums(self.tracer, [len(limbs) for limbs in groups])
        whole = in_unit(arrangement.reframed, arrangement.unit)
        self.places = places(len(whole.frames), groups)
        frames = zip(one_limb(whole.frames, self.places), self.places, strict=True)
        alike = merged_contacts(whole.named, self.places) if has_contacts(self.signature) else ()
        self.contacts = alike or ()
        self.reframed = replace(
            whole,
            frames=tuple(self._with_sums(*each) for each in frames),
            named=tuple(each.frame for each in self.contacts) or whole.named,
        )
        self.first = {
            axis: [
                0,
                *accumulate(0 if frame.mimic else getattr(frame.joint, axis) for frame in whole.frames),
            ]
            for axis in ("nq", "nv")
        }
        self.first["nxa"] = [3 * self.first["nv"][-1]]
        self.first["contacts"] = [0, *range(1, 1 + len([each for each in whole.named if each.rows]))]
        self.first["contact_rows"] = [0, *accumulate(each.rows for each in whole.named if each.rows)]
        # Limbs have no closed loops (have_contacts_alike): all constraints are contacts.
        self.first["constraints"] = self.first["contacts"]
        self.first["constraint_rows"] = self.first["contact_rows"]
        if has_columns(recipe):
            self._select_columns(whole.link_frames)

    def _with_sums(self, frame: Frame, place: Place) -> Frame:
        if place.group is None or not place.is_first:
            return frame
        return replace(frame, limbs=partial(self.sums.total, place.group))

    def _select_columns(self, link_frames: Sequence[Placement]) -> None:
        """Give the recipe the link frames and the standard parameters of the places: those that are base parameters."""
        self.selected, self.first["l"] = selected(self.robot.representative), [self.robot.sizes.l]
        kept = [
            PARAMETERS_PER_LINK * number + name
            for number, place in enumerate(self.places)
            for name in self._names(place)
        ]
        lift = np.eye(PARAMETERS_PER_LINK * len(self.places))[:, kept]
        own = tuple(place.placed([link_frames[joint] for joint in place.joints]) for place in self.places)
        self.reframed = replace(self.reframed, link_frames=own)  # type: ignore[arg-type]  # a Placed is enough
        sizes = replace(self.robot.sizes, l=len(kept))
        self.robot = replace(self.robot, representative=lift, sizes=sizes)

    def _names(self, place: Place) -> list[int]:
        row = PARAMETERS_PER_LINK * place.joints[0]
        return [name for name in range(PARAMETERS_PER_LINK) if row + name in self.selected]

    def recorded(self) -> Mapping[Slot, Scalar]:
        """Return the recorded value of each output entry, by slot (output name and index). Indices count places: a
        place is one joint, or the corresponding joints of all limbs."""
        arrangement, unit = self.arrangement, self.arrangement.unit
        values = carrier_values(arrangement, self.robot.theta_b, self.tracer)
        bodies, drives = bodies_from_carriers(arrangement.n, arrangement.carriers, values, unit)
        inputs = {quantity.name: list(self._inputs(quantity)) for quantity in self.recipe.signature.inputs}
        own = tuple(place.body([bodies[joint] for joint in place.joints]) for place in self.places)
        driven = tuple(place.constant([drives[joint] for joint in place.joints]) for place in self.places)
        choices = arrangement.choices
        return dict(
            traced(self.recipe, self.robot, self.reframed, inputs, own, driven, choices, unit, without_bodies)
        )

    def _inputs(self, quantity: Quantity) -> Iterator[Symbol]:
        used: dict[int, int] = {}
        for number, own in self._along(*quantity.axes) if quantity.axes else [(None, (0,))]:
            slots = tuple(Slot(quantity.name, index) for index in own)
            if number is None:
                yield self.tracer.symbol(slots[0])
                continue
            group = self.groups[number]
            slot = Slot(group.vectors.input_of(quantity.name), used.setdefault(number, 0))
            used[number] += 1
            self.sums.add_input(slot.vector, number)
            group.inputs.append((slot, slots))
            yield self.tracer.symbol(slot)

    def _entries(self, place: Place, axis: str) -> list[tuple[int, ...]]:
        """For each coordinate, rate or base parameter of a place the robot's, limb by limb."""
        if axis == "l":
            rows = [
                [PARAMETERS_PER_LINK * joint + name for joint in place.joints] for name in self._names(place)
            ]
            return [tuple(self.selected[row] for row in own) for own in rows]
        first = self.first[axis]
        counts = range(first[place.joints[0] + 1] - first[place.joints[0]])
        return [tuple(first[joint] + k for joint in place.joints) for k in counts]

    def _along(self, axis: str) -> list[tuple[int | None, tuple[int, ...]]]:
        """The group of each entry of an axis, and its numbers in the robot, limb by limb."""
        if axis == "nxa":
            nv, each = self.first["nv"][-1], self._along("nv")
            return [
                (group, tuple(first + k for k in own)) for first in (0, nv, 2 * nv) for group, own in each
            ]
        if "+" in axis:
            return self._along_several(axis.split("+"))
        if axis in ("contacts", "constraints", "contact_rows", "constraint_rows"):
            return [
                (each.group, tuple(self.first[axis][k] + row for k in each.numbers))
                for each in self.contacts
                for row in range(each.frame.rows if axis.endswith("rows") else 1)
            ]
        if axis.isdecimal():
            return [(None, (k,)) for k in range(int(axis))]
        return [(place.group, own) for place in self.places for own in self._entries(place, axis)]

    def _along_several(self, parts: Sequence[str]) -> list[tuple[int | None, tuple[int, ...]]]:
        found: list[tuple[int | None, tuple[int, ...]]] = []
        before = 0
        for axis in parts:
            found += [(group, tuple(before + k for k in own)) for group, own in self._along(axis)]
            before += self.first[axis][-1]
        return found

    def outputs(self, found: Mapping[Slot, Scalar]) -> Iterator[tuple[Slot, Scalar]]:
        """Yield the output values to store, with slots (name and index) of a group of limbs or of the core (everything
        outside limbs). Zeros are not stored."""
        self.products = tuple(self._products(found))
        for quantity in self.signature.stored:
            entries = [self._along(axis) for axis in quantity.axes]
            for index, which in enumerate(product(*entries)):
                value = found[Slot(quantity.name, index)]
                if not (isinstance(value, float | int) and value == 0.0):
                    yield from self._stored(quantity, which, value)

    def _stored(
        self, quantity: Quantity, which: Sequence[tuple[int | None, tuple[int, ...]]], value: Scalar
    ) -> Iterator[tuple[Slot, Scalar]]:
        numbers = {number for number, _ in which if number is not None}
        if len(numbers) > 1:
            raise InternalError(f"{quantity.name}: an entry of two groups of limbs is not zero")
        count = self.groups[min(numbers)].count if numbers else 1
        slots = tuple(
            Slot(quantity.name, self._flat(quantity, [own[limb if len(own) > 1 else 0] for _, own in which]))
            for limb in range(count)
        )
        slots = tuple(map(self._place, slots))
        if not numbers:
            yield slots[0], value
            return
        group = self.groups[min(numbers)]
        key = (value.index, value.negative) if isinstance(value, Symbol) else value
        is_new = key not in group.stored
        slot = group.stored.setdefault(key, Slot(group.vectors.output, len(group.stored)))
        group.outputs.append((slot, slots))
        if is_new:
            yield slot, value

    def _place(self, slot: Slot) -> Slot:
        """The place in memory of an entry."""
        if slot.vector == THIN:
            nv = self.first["nv"][-1]
            return self.products[0].place_of_factor(*divmod(slot.index, nv), nv)
        for products in self.products:
            slot = products.place(slot)
        return slot

    def _products(self, found: Mapping[Slot, Scalar]) -> Iterator[ThinProducts]:
        """Yield the products behind the stages, one for each kind of columns; none if the robot has no core."""
        rates = self._along("nv")
        core = [k for k, (group, _) in enumerate(rates) if group is None]
        if not self.groups or not self.signature.thin or not core:
            return
        shares = list(self._shares(found, rates, core, 0))
        if any(each.below for each in self.signature.thin):
            shares += self._shares(found, self._along("contact_rows"), core, len(rates))
        is_free, rows = has_floating_base(self.reframed.frames), tuple(rates[k][1][0] for k in core)
        is_solved = found[Slot(THIN, core[0] * len(rates) + core[0])] == 0.0
        columns = {each.name: each.axes[1] for each in self.signature.outputs if len(each.axes) > 1}
        for axis in dict.fromkeys(columns[each.name] for each in self.signature.thin):
            thin = [each for each in self.signature.thin if columns[each.name] == axis]
            yield ThinProducts(
                tuple(each.name for each in thin),
                tuple(len(core) if is_solved else each.known if is_free else 0 for each in thin),
                self.first[axis][-1],
                rows,
                tuple(shares),
                tuple(each.below for each in thin if each.below),
                is_solved,
            )

    def _shares(
        self,
        found: Mapping[Slot, Scalar],
        entries: Sequence[tuple[int | None, tuple[int, ...]]],
        core: Sequence[int],
        first: int,
    ) -> Iterator[Shares]:
        """The factor T of each group, in the rows of joint rates or, from the row `first`, of contacts."""
        wide = len(self._along("nv"))
        for group in self.groups:
            rows = [k for k, (number, _) in enumerate(entries) if number == group.number]
            used = [
                number
                for number, column in enumerate(core)
                if any(found[Slot(THIN, (first + row) * wide + column)] != 0.0 for row in rows)
            ]
            whole = tuple(entries[row][1][limb] for limb in range(group.count) for row in rows)
            if first and not used:
                continue
            name = f"{group.vectors.name}_{'pushes' if first else 'shares'}"
            yield Shares(name, whole, tuple(used), bool(first))

    def _flat(self, quantity: Quantity, indices: Sequence[int]) -> int:
        flat = 0
        for axis, index in zip(quantity.axes, indices, strict=True):
            flat = flat * sum(self.first[part][-1] for part in axis.split("+")) + index
        return flat

    def counted(self, outputs: list[tuple[Slot, Scalar]]) -> tuple[tuple[LimbGroup, ...], list[StageCost]]:
        """Return the groups of limbs and the cost of each stage (a part that one group, or the core, computes). Sums
        over limbs that no output needs are not counted."""
        groups = tuple(group.vectors for group in self.groups)
        stored = self.tracer.stored(outputs)
        return groups, traced_stage_costs(self.tracer.steps, stored, self.sums.summed, groups)

    def needed(self, stored: list[tuple[Slot, Scalar]]) -> TracedLimbs:
        """The PROGRAM without sums that nothing needs."""
        sums = {
            group.vectors.partial: [Symbol(self.tracer, index) for index in self.sums.partials[group.number]]
            for group in self.groups
        }
        partials = [
            (Slot(vector, k), value) for vector, values in sums.items() for k, value in enumerate(values)
        ]
        left = len(partials) + 1
        while len(partials) < left:
            left = len(partials)
            program = self.tracer.finish([*stored, *partials])
            read = set(program.inputs())
            partials = [
                (slot, value)
                for slot, value in partials
                if Slot(slot.vector.replace("_partial", "_sum"), slot.index) in read
            ]
        groups = tuple(
            replace(group.vectors, constants=tuple(self.tracer.lane_constants.get(group.number, ())))
            for group in self.groups
        )
        return TracedLimbs(program, groups, self.products)
