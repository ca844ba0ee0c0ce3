"""Tests that documents name exist, with their functions."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NAMED = re.compile(r"`(tests/[\w/]+\.py)(?:::(\w+))?`")
PAGES = [path for path in (ROOT / "docs").rglob("*.md") if "decisions" not in path.parts]
DOCUMENTS = [path for path in PAGES if NAMED.search(path.read_text("utf-8"))]


def test_some_are_named() -> None:
    assert ROOT / "docs" / "how_tested.md" in DOCUMENTS


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_each_is_there(document: Path) -> None:
    named = NAMED.findall(document.read_text("utf-8"))
    missing = [
        f"{path}::{function}"
        for path, function in named
        if not (ROOT / path).is_file()
        or (function and f"def {function}(" not in (ROOT / path).read_text("utf-8"))
    ]
    assert missing == []
