"""Symbols stand for numbers and record every operation on them in a PROGRAM (list of operations to generate).
Operations are simplified at the same time.

Equal operations are recorded once; the order of commutative arguments does not matter. A sign is stored with the symbol
and costs no operation. So a - b and b - a, or x * y and x * -y, are one instruction. Exact zeros and ones disappear.
Constants along a product are multiplied into one, which reorders floating point.

A search for the best arrangement records some hundred PROGRAMs. For speed, the arithmetic of symbols works on plain
tuples without function calls. `finish` turns the tuples into instructions.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import compress
from typing import Any, Protocol

from psdmc.program.cost import Cost, counted
from psdmc.program.lanes import Lanes
from psdmc.program.program import Instr, Op, Program, Slot, operation, slots_of

Number = float | int
Constant = Number | Lanes
"""What is known when code is generated: a number, or one for each limb of a group."""

Step = tuple[Op, Any, Any]
"""An instruction while it is recorded: its operation and its argument or two; of more arguments their tuple, of a load the
slot, of a constant the value."""

_ADD, _SUB, _MUL, _DIV, _NEG, _SIN, _COS = Op.ADD, Op.SUB, Op.MUL, Op.DIV, Op.NEG, Op.SIN, Op.COS
_LOAD, _CONST = Op.LOAD, Op.CONST


def arguments_of(step: Step) -> tuple[int, ...]:
    """Return the indices of the values that a recorded operation takes as arguments."""
    op, a, b = step
    if b is not None:
        return (a, b)
    if op is _LOAD or op is _CONST:
        return ()
    return a if type(a) is tuple else (a,)


Outputs = Sequence[tuple[Slot, "Symbol | Constant"]]
"""What a trace puts out, in order of storing."""


def group_name(group: int) -> str:
    """Return the prefix, such as 'group0', of the names of all vectors of a limb group (equal branches)."""
    return f"group{group}"


def constants_of(group: int) -> str:
    """Return the name of the vector of the constants that differ between the limbs of a group."""
    return f"{group_name(group)}_constants"


class SumsOverLimbs(Protocol):
    """The interface by which a Tracer (recorder of operations) sums values over limbs, which are equal branches such as
    legs. The class that implements it is in limb_program.py."""

    summed: dict[int, int]

    def group_of(self, index: int) -> int:
        """Return the number of the limb group (equal branches, such as legs) on whose limb a value depends. Return -1
        if the value does not depend on a limb."""

    def total(self, group: int, value: Symbol | Constant) -> Symbol | Constant:
        """Return the sum of a value over all limbs of a group. The arithmetic of a limb is recorded once, so one symbol
        stands for the value of every limb."""

    def stand_ins(self, vector: str, values: Sequence[Symbol | Constant]) -> list[Symbol]:
        """Return new input symbols for these values. An input differs between limbs if its value does."""


class Tracer:
    """Records operations on symbols: `symbols` makes inputs, and `finish` makes the PROGRAM."""

    __slots__ = ("__weakref__", "_places", "constants", "known", "lane_constants", "limb_sums", "steps")

    def __init__(self) -> None:
        self.steps: list[Step] = []
        self.known: dict[Step, int] = {}
        self.constants: dict[int, Any] = {}
        self.lane_constants: dict[int, list[tuple[float, ...]]] = {}
        self.limb_sums: SumsOverLimbs | None = None
        self._places: dict[float | Lanes, int] = {}

    def symbols(self, vector: str, count: int) -> list[Symbol]:
        """Inputs vector[0] ... vector[count - 1]."""
        return [self.symbol(slot) for slot in slots_of(vector, count)]

    def stand_ins(self, vector: str, values: Sequence[Symbol | Constant]) -> list[Symbol]:
        """Return new input symbols for these values, which `substituted` (interpret.py) puts in their place."""
        if self.limb_sums is None:
            return self.symbols(vector, len(values))
        return self.limb_sums.stand_ins(vector, values)

    def symbol(self, slot: Slot) -> Symbol:
        """One input."""
        return Symbol(self, self.record((_LOAD, slot, None)))

    def record(self, step: Step) -> int:
        """Return the index of the value of an operation, which is recorded if no equal one has been."""
        index = self.known.get(step)
        if index is None:
            index = self.known[step] = len(self.steps)
            self.steps.append(step)
        return index

    def constant(self, value: Constant) -> Symbol:
        """Return a symbol for a constant. The recorded constant is positive; the symbol stores the sign."""
        if isinstance(value, Lanes):
            return self._lanes(value)
        # A Python number even where it is NumPy's: signs are compared by identity, which fails for its booleans.
        number = float(value)
        return Symbol(self, self.magnitude(abs(number)), number < 0)

    def _lanes(self, value: Lanes) -> Symbol:
        """A constant of limbs, which is loaded; its sign is such that its first number that is not zero is positive."""
        negative = next(x for x in value.values if x) < 0
        value = -value if negative else value
        index = self._places.get(value)
        if index is None:
            table = self.lane_constants.setdefault(value.group, [])
            index = self._places[value] = self.record(
                (_LOAD, Slot(constants_of(value.group), len(table)), None)
            )
            self.constants[index] = value
            table.append(value.values)
        return Symbol(self, index, negative)

    def magnitude(self, value: float) -> int:
        """The index of a constant."""
        index = self._places.get(value)
        if index is None:
            index = self._places[value] = self.record((_CONST, value, None))
            self.constants[index] = value
        return index

    def arguments(self, index: int) -> tuple[int, ...]:
        """Return the indices of the arguments of the value with this index. A sum over limbs (equal branches) has one
        argument: the value that is summed."""
        if self.limb_sums is not None and index in self.limb_sums.summed:
            return (self.limb_sums.summed[index],)
        return arguments_of(self.steps[index])

    def needed(self, roots: Collection[int], known: Collection[int]) -> list[bool]:
        """Return for each value up to the last root whether a root is computed from it. The search does not go on behind
        known values."""
        needed = [False] * (max(roots, default=-1) + 1)
        for root in roots:
            needed[root] = True
        for index in range(len(needed) - 1, -1, -1):
            if needed[index] and index not in known:
                _, a, b = self.steps[index]
                if b is not None:  # as in nearly all
                    needed[a] = needed[b] = True
                else:
                    for argument in self.arguments(index):
                        needed[argument] = True
        return needed

    def finish(self, outputs: Outputs) -> Program:
        """Return the PROGRAM (list of operations to generate) that stores these values as outputs. Operations that no
        output needs are left out. If the symbol of an output has a minus sign, a negation is added."""
        stored = self.stored(outputs)
        steps = self.steps
        needed = [False] * len(steps)
        for _, index in stored:
            needed[index] = True
        for i in range(len(steps) - 1, -1, -1):
            if needed[i]:
                _, a, b = steps[i]
                if b is not None:
                    needed[a] = needed[b] = True
                else:
                    for argument in arguments_of(steps[i]):
                        needed[argument] = True
        places = [0] * len(steps)
        body: list[Instr] = []
        for i in compress(range(len(steps)), needed):
            places[i] = len(body)
            body.append(_instruction(steps[i], places))
        return Program(tuple(body), tuple((slot, places[i]) for slot, i in stored))

    def cost(self, outputs: Outputs) -> Cost:
        """Return the number of operations of each kind in the PROGRAM that `finish` would return. It is faster than
        `finish`, for searches that only compare costs."""
        stored = self.stored(outputs)
        steps, uses = self.steps, [0] * len(self.steps)
        for _, index in stored:
            uses[index] += 1
        mul = fused = 0
        sums: list[Step] = []
        others: list[Op] = []
        angles: set[int] = set()
        for used, step in zip(reversed(uses), reversed(steps), strict=True):
            if not used:  # by what lies behind: it has been counted
                continue
            op, a, b = step
            if b is not None:
                uses[a] += 1
                uses[b] += 1
                if op is _MUL:
                    mul += 1
                elif op is _ADD or op is _SUB:
                    sums.append(step)
                else:
                    others.append(op)
            elif op is not _LOAD and op is not _CONST:
                for argument in arguments_of(step):
                    uses[argument] += 1
                if op is _SIN or op is _COS:
                    angles.add(a)
                else:
                    others.append(op)
        for _, a, b in sums:
            if (uses[a] == 1 and steps[a][0] is _MUL) or (uses[b] == 1 and steps[b][0] is _MUL):
                fused += 1
        return counted(others, mul, len(sums), len(angles), fused)

    def stored(self, outputs: Outputs) -> list[tuple[Slot, int]]:
        """Return for each output its place (slot) and the index of its value. Outputs that are constants or have a
        minus sign are recorded as operations first."""
        stored: list[tuple[Slot, int]] = []
        for slot, value in outputs:
            if isinstance(value, Lanes):
                value = self.constant(value)
            if isinstance(value, Symbol):
                stored.append((slot, self._unsigned(value)))
            else:
                stored.append((slot, self.magnitude(float(value) + 0.0)))
        return stored

    def operated(self, op: Op, arguments: Sequence[Symbol | Constant]) -> Symbol:
        """Record an operation, such as a square root, for which Python has no operator, and return a symbol for its
        result. If all arguments are numbers and the result is finite, the result is a constant."""
        given = [each if isinstance(each, Symbol) else self.constant(each) for each in arguments]
        known = [value for each in given if isinstance(value := each.constant_value(), float)]
        if len(known) == len(given):
            folded = op.of_numbers(known)
            if folded is not None:
                return self.constant(folded)
        negative = bool(op.operation.parity) and given[0].negative
        if negative:
            given[0] = -given[0]
        indices = [self._unsigned(each) for each in given]
        if op.operation.commutative:
            indices.sort()
        first, second = indices if op.arity == 2 else (indices[0] if op.arity == 1 else tuple(indices), None)
        return Symbol(self, self.record((op, first, second)), negative and op.operation.parity == "odd")

    def _unsigned(self, value: Symbol) -> int:
        """The index of a value with its sign; a negative one costs a negation."""
        return self.record((_NEG, value.index, None)) if value.negative else value.index


def _instruction(step: Step, places: Sequence[int]) -> Instr:
    op, a, b = step
    if b is not None:
        return operation(op, (places[a], places[b]))
    if op is _LOAD:
        return Instr(op, slot=a)
    return (
        Instr(op, value=a)
        if op is _CONST
        else operation(op, tuple([places[each] for each in arguments_of(step)]))
    )


class Symbol:
    """A signed reference to a recorded value."""

    __slots__ = ("index", "negative", "tracer")
    __array_ufunc__ = None

    def __init__(self, tracer: Tracer, index: int, negative: bool = False) -> None:
        self.tracer = tracer
        self.index = index
        self.negative = negative

    def __neg__(self) -> Symbol:
        return Symbol(self.tracer, self.index, not self.negative)

    def __pos__(self) -> Symbol:
        return self

    def __add__(self, other: Symbol | Constant) -> Symbol | float:
        if isinstance(other, Symbol):
            return _sum(self.tracer, self.index, self.negative, other.index, other.negative)
        return self if other == 0 else self + self.tracer.constant(other)

    __radd__ = __add__

    def __sub__(self, other: Symbol | Constant) -> Symbol | float:
        if isinstance(other, Symbol):
            return _sum(self.tracer, self.index, self.negative, other.index, not other.negative)
        return self if other == 0 else self + self.tracer.constant(-other)

    def __rsub__(self, other: Constant) -> Symbol | float:
        return -self + other

    def __mul__(self, other: Symbol | Constant) -> Symbol | float:
        if not isinstance(other, Symbol):
            if other == 0:
                return 0.0
            if other == 1:
                return self
            return -self if other == -1 else _scaled(self, other)
        tracer, a, b = self.tracer, self.index, other.index
        if b in tracer.constants:
            return _scaled(self, -tracer.constants[b] if other.negative else tracer.constants[b])
        step = (_MUL, a, b) if a < b else (_MUL, b, a)
        index = tracer.known.get(step)
        if index is None:
            index = tracer.known[step] = len(tracer.steps)
            tracer.steps.append(step)
        return Symbol(tracer, index, self.negative is not other.negative)

    __rmul__ = __mul__

    def __truediv__(self, other: Symbol | Constant) -> Symbol | float:
        if not isinstance(other, Symbol):
            return self * (1.0 / other)
        divisor = other.constant_value()
        return _quotient(self, other) if divisor is None else self / divisor

    def __rtruediv__(self, other: Constant) -> Symbol | float:
        return 0.0 if other == 0 else _quotient(self.tracer.constant(other), self)

    def sincos(self) -> tuple[Symbol, Symbol]:
        sine = self.tracer.record((_SIN, self.index, None))
        cosine = self.tracer.record((_COS, self.index, None))
        return Symbol(self.tracer, sine, self.negative), Symbol(self.tracer, cosine)

    def root(self) -> Symbol:
        """Return the square root of this symbol. If the symbol is a constant, the root is a constant, too."""
        return self.tracer.operated(Op.SQRT, (self,))

    def operated(self, op: Op, arguments: Sequence[Symbol | Constant]) -> Symbol:
        """Return the result of an operation, such as a minimum, on this symbol and other arguments."""
        return self.tracer.operated(op, arguments)

    @property
    def slot(self) -> Slot | None:
        """Return the place (slot) that this symbol is loaded from if it is an input; None if it is computed."""
        op, slot, _ = self.tracer.steps[self.index]
        return slot if op is _LOAD and not self.negative else None

    def constant_value(self) -> float | Lanes | None:
        value = self.tracer.constants.get(self.index)
        return -value if value is not None and self.negative else value


def _sum(tracer: Tracer, a: int, a_negative: bool, b: int, b_negative: bool) -> Symbol | float:
    """The sum of two signed values: an addition with a sign, or a difference of the earlier and the later one."""
    if a_negative is b_negative:
        step, negative = ((_ADD, a, b) if a < b else (_ADD, b, a)), a_negative
    elif a == b:
        return 0.0
    elif a < b:
        step, negative = (_SUB, a, b), a_negative
    else:
        step, negative = (_SUB, b, a), b_negative
    index = tracer.known.get(step)
    if index is None:
        index = tracer.known[step] = len(tracer.steps)
        tracer.steps.append(step)
    return Symbol(tracer, index, negative)


def _scaled(a: Symbol, factor: Constant) -> Symbol | float:
    """A constant times a value; constants along a product become one."""
    tracer, index, constants = a.tracer, a.index, a.tracer.constants
    own = constants.get(index)
    if own is not None:
        product: Symbol | float = (-own if a.negative else own) * factor
        return product
    op, left, right = tracer.steps[index]
    if op is _MUL:
        for this, rest in ((left, right), (right, left)):
            inner = constants.get(this)
            if inner is not None:
                both: Constant = inner * factor
                return Symbol(tracer, rest, a.negative) * both
    if isinstance(factor, Lanes):
        loaded = tracer.constant(factor)
        constant, negative = loaded.index, loaded.negative
    else:
        number = float(factor)  # also NumPy's numbers, as in `constant`
        constant, negative = tracer.magnitude(abs(number)), number < 0
    step = (_MUL, index, constant) if index < constant else (_MUL, constant, index)
    return Symbol(tracer, tracer.record(step), a.negative is not negative)


def _quotient(a: Symbol, b: Symbol) -> Symbol:
    index = a.tracer.record((_DIV, a.index, b.index))
    return Symbol(a.tracer, index, a.negative is not b.negative)
