"""The methods of a model for the functions that compiled robots have, such as forward_dynamics, computed in NumPy.

The module psdmc.model_functions has the code of these functions. It imports the model, so the model cannot import it.
The package `psdmc` registers it here instead. Type checkers read the methods from answers.pyi, which `python -m
psdmc.toolchain.stubs` writes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple


class Provider(NamedTuple):
    """The object from which models get functions such as forward_dynamics.

    names  returns the names of all functions
    bound  (model, name) -> the function of that model
    """

    names: Callable[[], Iterable[str]]
    bound: Callable[[Any, str], Callable[..., Any]]


_PROVIDERS: list[Callable[[], Provider]] = []


def provide(provider: Callable[[], Provider]) -> None:
    """Register the provider (a function without arguments that returns a Provider). Models call it when a function such
    as forward_dynamics is first used."""
    _PROVIDERS[:] = [provider]


class Answers:
    """The functions of compiled robots as methods."""

    __slots__ = ()

    def _answer(self, name: str, *given: Any, **named: Any) -> Any:
        """Return what one of these functions computes."""
        return _PROVIDERS[0]().bound(self, name)(*given, **named)

    def __getattr__(self, name: str) -> Any:
        if not name.startswith("_") and _PROVIDERS:
            provider = _PROVIDERS[0]()
            if name in provider.names():
                return provider.bound(self, name)
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *(_PROVIDERS[0]().names() if _PROVIDERS else ())})
