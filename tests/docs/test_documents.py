"""Documents do not drift from the code: their blocks run, their links lead somewhere, what they name exists."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from blocks import ROOT, blocks, documents, run
from unoptimised import wrapper

from psdmc.cli.commands import app

LINK = re.compile(r"\[[^\]]*\]\(([^)#\s]+)(?:#[^)]*)?\)")
RUNNABLE = [path for path in documents() if any(b.language in ("pycon", "console") for b in blocks(path))]


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


@pytest.mark.parametrize("document", RUNNABLE, ids=name)
def test_blocks_run(document: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """What they build is not optimised: what they show does not depend on it."""
    (tmp_path / "document").mkdir()
    monkeypatch.chdir(tmp_path / "document")
    monkeypatch.setenv("CC", str(wrapper(tmp_path)))
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")  # what they call `cc` likewise

    assert run(document, tmp_path / "document") > 0


def test_the_pipeline_is_run():
    assert ROOT / "docs" / "pipeline.md" in RUNNABLE


@pytest.mark.parametrize("document", documents(), ids=name)
def test_links_lead_somewhere(document: Path):
    targets = LINK.findall(document.read_text(encoding="utf-8"))
    missing = [t for t in targets if "://" not in t and not (document.parent / t).exists()]

    assert not missing


@pytest.mark.parametrize("document", documents(), ids=name)
def test_make_targets_exist(document: Path):
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    named = re.findall(
        r"`make ([a-z-]+)[^`]*`|^ {4}make ([a-z-]+)", document.read_text(encoding="utf-8"), re.MULTILINE
    )

    assert {a or b for a, b in named} <= targets


@pytest.mark.parametrize("document", documents(), ids=name)
def test_commands_exist(document: Path):
    known = {command.name or command.callback.__name__ for command in app.registered_commands}
    named = set(re.findall(r"psdmc ([a-z]+(?:-c)?) [A-Z\w./-]+", _code(document)))

    assert named <= known | {"is"}


@pytest.mark.parametrize("document", documents(), ids=name)
def test_paths_in_the_tree_exist(document: Path):
    text = document.read_text(encoding="utf-8")
    paths = re.findall(r"`((?:psdmc|templates|docs|tests|benchmarks|examples)/[\w./-]+)`", text)

    assert [path for path in paths if not (ROOT / path).exists()] == []


def _code(document: Path) -> str:
    """Inline code and indented or fenced lines."""
    text = document.read_text(encoding="utf-8")
    return "\n".join(
        [*re.findall(r"`([^`\n]+)`", text), *re.findall(r"^(?: {4}|\$ )(.*)$", text, re.MULTILINE)]
    )
