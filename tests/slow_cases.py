"""Cases that `make test` leaves to `make test-slow`: parameters that differ from one of `make test` in extent alone."""

from __future__ import annotations

from collections.abc import Iterable

import pytest


def slow_but_for(quick: Iterable[object], cases: Iterable[object], *, spread: bool = False) -> list[object]:
    """`cases` as parameters, marked slow but for those in `quick`; with `spread` a case is several arguments."""
    kept = list(quick)
    known = list(cases)
    strange = [case for case in kept if case not in known]
    if strange:
        raise ValueError(f"{strange[0]!r} is no case")

    def marks(case: object) -> list[pytest.MarkDecorator]:
        return [] if case in kept else [pytest.mark.slow]

    def words(case: object) -> tuple[object, ...]:
        return tuple(case) if spread else (case,)  # type: ignore[arg-type]

    return [pytest.param(*words(case), marks=marks(case)) for case in known]
