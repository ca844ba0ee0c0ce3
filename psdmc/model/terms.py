"""Terms of the base parameters' equations as objects, such as `2 d4 my4` or `mx1/a1`, from which text and LaTeX are
made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple


class Symbol(NamedTuple):
    """A quantity of one joint in an equation, such as mx2: letters, and the joint's number from 1."""

    letters: str
    number: int

    def __str__(self) -> str:
        return f"{self.letters}{self.number}"


class Power(NamedTuple):
    """A symbol and its exponent, 1 or more."""

    symbol: Symbol
    exponent: int = 1

    def __str__(self) -> str:
        return f"{self.symbol}" if self.exponent == 1 else f"{self.symbol}^{self.exponent}"


@dataclass(frozen=True, slots=True)
class Term:
    """One term of an equation of a base parameter: number * times * of / over, to be added or subtracted.

    of        the standard parameter
    is_minus  whether the term is subtracted
    number    decimal digits; None: one
    times     lengths in the numerator
    over      lengths in the denominator
    """

    of: Symbol
    is_minus: bool = False
    number: str | None = None
    times: tuple[Power, ...] = ()
    over: tuple[Power, ...] = ()

    def __str__(self) -> str:
        """The term without its sign."""
        product = " ".join([*([self.number] if self.number else []), *map(str, self.times), str(self.of)])
        if not self.over:
            return product
        divisor = " ".join(map(str, self.over))
        return f"{product}/({divisor})" if len(self.over) > 1 else f"{product}/{divisor}"


def equation(terms: Sequence[Term]) -> str:
    """Return the sum of the terms as one line of text, without a plus before the first term."""
    first, *others = terms
    return str(first) + "".join(f" {'-' if term.is_minus else '+'} {term}" for term in others)
