"""Options of the recursions in generated code. They change the number of operations, but not the result."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Generic, TypeVar, cast


@dataclass(frozen=True, slots=True)
class Choices:
    """Options of the Newton-Euler recursion and of forward dynamics in generated code.

    w and dw are a body's angular velocity and its derivative. A point of the body at r accelerates with a + U r.

    compound           consecutive joints with parallel axes rotate w and dw once, by the sum of their angles
    fold               a body that carries no other is described in the frame before its joint's rotation. There U
                       differs from its parent's in six entries only; the body's parameters are rotated instead
    fold_double_angle  second moments of such a body are rotated with a separate sincos(2 q), not with products of
                       sincos(q)
    add_sines          the sine and cosine of a sum of angles are computed from those of the angles
    articulated        accelerations are computed by articulated bodies, not by a factorized mass matrix
    """

    compound: bool = False
    fold: bool = False
    fold_double_angle: bool = False
    add_sines: bool = False
    articulated: bool = False


PLAIN = Choices()

_T = TypeVar("_T")


class _Watched:
    """The choices, and in `read` those that a computation has read, with their values."""

    def __init__(self, choices: Choices) -> None:
        self.choices = choices
        self.read: dict[str, bool] = {}

    def __getattr__(self, name: str) -> bool:
        value: bool = getattr(self.choices, name)
        self.read[name] = value
        return value


class ByChoices(Generic[_T]):
    """A cache of results that depend on a key and on choices. It notes which choices a computation reads.

    A computation is not repeated for other choices that agree in all that it has read. An example: without a fold, no
    computation reads how a fold's angle is doubled.
    """

    def __init__(self) -> None:
        self._made: dict[Hashable, list[tuple[dict[str, bool], _T]]] = {}

    def known(self, key: Hashable, choices: Choices) -> _T | None:
        """Return the cached result, or None. Choices that agree in all that was read get the same object."""
        return next(
            (
                made
                for read, made in self._made.get(key, ())
                if all(getattr(choices, name) == value for name, value in read.items())
            ),
            None,
        )

    def made(self, key: Hashable, choices: Choices, make: Callable[[Choices], _T]) -> _T:
        """Return the cached result. If there is none, `make` computes it from the choices; it may not be None."""
        found = self.known(key, choices)
        if found is None:
            watched = _Watched(choices)
            found = make(cast(Choices, watched))
            self._made.setdefault(key, []).append((watched.read, found))
        return found
