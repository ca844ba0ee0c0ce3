"""Every refusal says what would help: an InputError, DerivationError or ToolchainError has a hint wherever it is made."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from psdmc import errors

PACKAGE = Path(errors.__file__).parent
REFUSALS = ("InputError", "DerivationError", "ToolchainError")


def without_hint(source: str) -> Iterator[int]:
    """Lines that make a refusal from a message alone."""
    if not any(name in source for name in REFUSALS):
        return  # a third of the files, which need no parsing
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in REFUSALS:
            starred = any(isinstance(argument, ast.Starred) for argument in node.args)
            if len(node.args) + len(node.keywords) < 2 and not starred:
                yield node.lineno


def test_it_has_a_hint():
    sources = sorted(PACKAGE.rglob("*.py"))
    assert [
        f"{path.relative_to(PACKAGE)}:{line}"
        for path in sources
        for line in without_hint(path.read_text(encoding="utf-8"))
    ] == []
    assert len(sources) > 300


def test_one_without_is_seen():
    assert list(without_hint("def f():\n    raise InputError(f'{x}: wrong')")) == [2]
    assert list(without_hint("raise InputError('wrong', 'correct it')")) == []
