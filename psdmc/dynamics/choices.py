"""How the recursions are arranged: choices that change the number of operations, but not the result."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Generic, TypeVar, cast


@dataclass(frozen=True, slots=True)
class Choices:
    """The arrangement of a recursion; w, dw and U are those of motion.py.

    compound           consecutive parallel axes turn w and dw once, by the sum of their angles, from the frame before the
                       first
    fold               a leaf (a body that carries no other) is described in the frame before its joint's turn, where U
                       differs from its parent's in six entries only; the body's parameters are turned instead
    fold_double_angle  a folded body's second moments are turned by a sincos(2 q) of their own, not by products of sincos(q)
    add_sines          a compound turn's sincos is made from those of its parts, not by a sincos of the sum
    articulated        accelerations are found by articulated bodies, not by a factorized mass matrix
    """

    compound: bool = False
    fold: bool = False
    fold_double_angle: bool = False
    add_sines: bool = False
    articulated: bool = False


PLAIN = Choices()

_T = TypeVar("_T")


class _Watched:
    """Choices that note which of them are read."""

    def __init__(self, choices: Choices) -> None:
        self.choices = choices
        self.read: dict[str, bool] = {}

    def __getattr__(self, name: str) -> bool:
        value: bool = getattr(self.choices, name)
        self.read[name] = value
        return value


class ByChoices(Generic[_T]):
    """What is made of choices and a key, made once for all choices that it does not tell apart.

    What has read some of the choices is the same for all choices in which these are the same: without a fold, nothing asks
    how a fold's angle is doubled.
    """

    def __init__(self) -> None:
        self._made: dict[Hashable, list[tuple[dict[str, bool], _T]]] = {}

    def known(self, key: Hashable, choices: Choices) -> _T | None:
        """What was made before; None if nothing was. The same object for all choices that are not told apart."""
        return next(
            (
                made
                for read, made in self._made.get(key, ())
                if all(getattr(choices, name) == value for name, value in read.items())
            ),
            None,
        )

    def made(self, key: Hashable, choices: Choices, make: Callable[[Choices], _T]) -> _T:
        """What was made before, or is made now by `make`. Nothing that is None is kept."""
        found = self.known(key, choices)
        if found is None:
            watched = _Watched(choices)
            found = make(cast(Choices, watched))
            self._made.setdefault(key, []).append((watched.read, found))
        return found
