"""Every input that once broke the rule, again: it succeeds, or is refused in one line with a hint.

corpus/<format>/ holds them, made small; `owed.json` names those that still break it, and how.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from formats import FORMATS
from keep import CORPUS, OWED
from limits import limited_memory
from outcome import outcome_of, warnings_are_errors
from seeds import write_seeds
from worker import scratch

KNOWN = json.loads(OWED.read_text(encoding="utf-8"))
"""Strict xfails: who mends one removes its line."""


LONG = {"dh/tooslow-derive-reduce-reflect-53c8df.toml"}
"""Which `make test` leaves to `make test-slow`: seconds each."""

FATAL = ("SIG", "Exit", "Hang", "TooSlow")
"""Ways to end that a test run does not wait for."""


def entries() -> Iterator[object]:
    for path in sorted(CORPUS.glob("*/*")):
        name = str(path.relative_to(CORPUS))
        fatal = KNOWN.get(name, "").startswith(FATAL)
        marks = [pytest.mark.xfail(strict=True, run=not fatal, reason=KNOWN[name])] if name in KNOWN else []
        marks += [pytest.mark.slow] if name in LONG else []
        yield pytest.param(path, id=name, marks=marks)


@pytest.fixture(scope="module")
def around(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_seeds(tmp_path_factory.mktemp("fuzz"))


@pytest.mark.parametrize("entry", list(entries()))
def test_the_rule_holds(entry: Path, around: Path):
    format = FORMATS[entry.parent.name]
    with scratch(around) as folder, warnings_are_errors(), limited_memory():
        format.set_up(folder)

        found = outcome_of(lambda: format.run(entry.read_bytes(), folder, True))

    assert not found.is_find, f"{found.key}: {found.said}\n{found.trace}"


def test_what_is_owed_exists():
    assert [name for name in KNOWN if not (CORPUS / name).exists()] == []
