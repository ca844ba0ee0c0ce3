"""A pass of the code generator: it takes common factors out of sums, and leaves out terms that are both added and
subtracted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from psdmc.program.passes.drop_unused import drop_unused
from psdmc.program.program import Instr, Op, Program

_ADD, _MUL = Op.ADD, Op.MUL
_SUMS = frozenset((_ADD, Op.SUB))


@dataclass(frozen=True, slots=True)
class _Term:
    """A sign times a product. A factor is the index of a value, or a sum that is yet to be computed."""

    sign: int
    factors: tuple[int | _Sum, ...]

    def is_product_with(self, factor: int) -> bool:
        """Return whether the term is a product of this factor and at least one other. A term that is the factor alone
        does not count, because a * (b + 1) needs as many operations as a * b + a."""
        return len(self.factors) > 1 and factor in self.factors

    def without(self, factor: int) -> _Term:
        position = self.factors.index(factor)
        return _Term(self.sign, self.factors[:position] + self.factors[position + 1 :])


@dataclass(frozen=True, slots=True)
class _Sum:
    terms: tuple[_Term, ...]


def factor_common(program: Program) -> Program:
    """Return the PROGRAM (list of operations to generate) with every a*b + a*c written as a*(b + c).

    Products and partial sums that are used elsewhere, too, stay as they are.

    The factor that most terms of a sum share is taken out first. The function repeats this for the other terms and
    within the bracket. A term that is both added and subtracted is left out. A sum stays as it is if no two terms share
    a factor or cancel.

    Needs:  every argument precedes its use.
    Keeps:  outputs up to rounding (it reorders floating point); output names and order.
    Gives:  fewer multiplications, no more additions; every instruction is needed.
    """
    grouped = _grouped_sums(program)
    if not grouped:
        return drop_unused(program)
    builder = _Builder([], [])
    for i, instr in enumerate(program.body):
        builder.new_index.append(
            builder.total(grouped[i]) if i in grouped else builder.append(instr.renumbered(builder.new_index))
        )
    outputs = tuple((slot, builder.new_index[i]) for slot, i in program.outputs)
    return drop_unused(Program(tuple(builder.body), outputs))


def _grouped_sums(program: Program) -> dict[int, tuple[_Term, ...]]:
    """The sums that get shorter, by the index of their value."""
    uses = program.uses()
    inside = _parts_of_larger_sums(program, uses)
    found: dict[int, tuple[_Term, ...]] = {}
    for i, (op, args, _, _) in enumerate(program.body):
        if inside[i] or op not in _SUMS or _share_nothing(program.body, uses, args):
            continue
        signed = _signed_factors(program.body, uses, i)
        kept = _without_what_cancels(signed)
        if len(kept) < len(signed) or _shares_a_factor(kept):
            grouped = _grouped(tuple(_Term(sign, tuple(factors)) for sign, factors in kept))
            if len(grouped) < len(signed):
                found[i] = grouped
    return found


def _share_nothing(body: tuple[Instr, ...], uses: Sequence[int], args: tuple[int, ...]) -> bool:
    """Whether a sum has just these two terms, and they have no factor in common: true for most sums."""
    first, second = args
    ops = [body[a][0] if uses[a] == 1 else None for a in args]
    if first == second or ops[0] in _SUMS or ops[1] in _SUMS:
        return False
    if ops[0] is not _MUL or ops[1] is not _MUL:
        return True
    return set(_factors(body, uses, first)).isdisjoint(_factors(body, uses, second))


def _parts_of_larger_sums(program: Program, uses: Sequence[int]) -> list[bool]:
    inside = [False] * len(program.body)
    for op, args, _, _ in program.body:
        if op in _SUMS:
            for a in args:
                if uses[a] == 1 and program.body[a][0] in _SUMS:
                    inside[a] = True
    return inside


def _signed_factors(body: tuple[Instr, ...], uses: Sequence[int], index: int) -> list[tuple[int, list[int]]]:
    """Sign and factors of each term of a chain of sums, left to right, by a stack: chains can be long."""
    terms: list[tuple[int, list[int]]] = []
    stack = [(index, 1)]
    while stack:
        i, own = stack.pop()
        op, args, _, _ = body[i]
        if op in _SUMS and (i == index or uses[i] == 1):
            stack.append((args[1], own if op is _ADD else -own))
            stack.append((args[0], own))
        else:
            terms.append((own, [i] if op is not _MUL or uses[i] != 1 else _factors(body, uses, i)))
    return terms


def _without_what_cancels(terms: list[tuple[int, list[int]]]) -> list[tuple[int, list[int]]]:
    """The terms but for pairs that differ in their signs alone; a term with a plus comes first. All of them where nothing
    with a plus would be left."""
    found: dict[tuple[int, ...], list[int]] = {}
    for at, (sign, factors) in enumerate(terms):
        alike = found.setdefault(tuple(sorted(factors)), [])
        if alike and terms[alike[-1]][0] != sign:
            alike.pop()
        else:
            alike.append(at)
    left = sorted(at for alike in found.values() for at in alike)
    plus = next((at for at in left if terms[at][0] > 0), None)
    if len(left) == len(terms) or plus is None:
        return terms
    return [terms[at] for at in (plus, *(at for at in left if at != plus))]


def _shares_a_factor(terms: list[tuple[int, list[int]]]) -> bool:
    """Whether two of the terms are products with a common factor; false for most sums."""
    seen: set[int] = set()
    for _, factors in terms:
        if len(factors) > 1:
            if not seen.isdisjoint(factors):
                return True
            seen.update(factors)
    return False


def _factors(body: tuple[Instr, ...], uses: Sequence[int], index: int) -> list[int]:
    """Return the factors of a product that nothing else uses, left to right."""
    factors: list[int] = []
    stack = [index]
    while stack:
        i = stack.pop()
        op, args, _, _ = body[i]
        if op is _MUL and uses[i] == 1:
            stack.extend(args[::-1])
        else:
            factors.append(i)
    return factors


def _grouped(terms: tuple[_Term, ...]) -> tuple[_Term, ...]:
    """The terms with common factors taken out, the most frequent first; a group stands where its first term stood."""
    remaining = list(enumerate(terms))
    done: list[tuple[int, _Term]] = []
    while (factor := _most_frequent([term for _, term in remaining])) is not None:
        sharing = [(at, term) for at, term in remaining if term.is_product_with(factor)]
        remaining = [(at, term) for at, term in remaining if not term.is_product_with(factor)]
        sign = sharing[0][1].sign
        inner = _grouped(tuple(_Term(t.sign * sign, t.without(factor).factors) for _, t in sharing))
        bracket = inner[0].factors if len(inner) == 1 and inner[0].sign == 1 else (_Sum(inner),)
        done.append((sharing[0][0], _Term(sign, (factor, *bracket))))
    return tuple(term for _, term in sorted(done + remaining, key=lambda item: item[0]))


def _most_frequent(terms: list[_Term]) -> int | None:
    """The factor that most products contain, at least two; of several the earliest value."""
    count: Counter[int] = Counter()
    for term in terms:
        if len(term.factors) > 1:
            count.update(sorted({f for f in term.factors if isinstance(f, int)}))
    best = max(count.items(), key=lambda item: (item[1], -item[0]), default=(0, 0))
    return best[0] if best[1] > 1 else None


@dataclass(frozen=True, slots=True)
class _Builder:
    """The new body, and where the old one's values are in it."""

    body: list[Instr]
    new_index: list[int]

    def append(self, instr: Instr) -> int:
        self.body.append(instr)
        return len(self.body) - 1

    def total(self, terms: tuple[_Term, ...]) -> int:
        """Add instructions for the sum of some terms, the first with a plus sign; return the sum's index."""
        value = self._product(terms[0])
        for term in terms[1:]:
            op = Op.ADD if term.sign > 0 else Op.SUB
            value = self.append(Instr(op, (value, self._product(term))))
        return value

    def _product(self, term: _Term) -> int:
        values = [self.new_index[f] if isinstance(f, int) else self.total(f.terms) for f in term.factors]
        value = values[0]
        for other in values[1:]:
            value = self.append(Instr(Op.MUL, (value, other)))
        return value
