"""Documents do not drift from the code: their blocks run, their links lead somewhere, what they name exists."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest
from blocks import ROOT, blocks, documents, run
from installed import is_installed
from slow_cases import slow_but_for
from unoptimised import wrapper

from psdmc.cli.commands import app

LINK = re.compile(r"\[[^\]]*\]\(([^)#\s]+)(?:#[^)]*)?\)")
RUNNABLE = [path for path in documents() if any(b.language in ("pycon", "console") for b in blocks(path))]


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


DOCS = ROOT / "docs"
LONG = [
    DOCS / "how-to" / "plan-campaign.md",
    DOCS / "tutorials" / "controller.md",
    DOCS / "tutorials" / "quadruped.md",
    DOCS / "how-to" / "embedded.md",
    *(
        DOCS / "how-to" / f"{name}.md"
        for name in ("casadi", "derivatives", "floating-base", "frames", "many-robots")
    ),
    DOCS / "pipeline.md",
]
"""They plan the motion of six joints, or build packages: longer than all other documents together."""


@pytest.mark.parametrize(
    "document", slow_but_for([path for path in RUNNABLE if path not in LONG], RUNNABLE), ids=name
)
def test_blocks_run(document: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """What they build is not optimised: what they show does not depend on it."""
    if "\n$ cargo " in document.read_text(encoding="utf-8") and not is_installed("cargo"):
        pytest.skip("cargo is not installed")
    if "\n$ c++ " in document.read_text(encoding="utf-8") and not is_installed("c++"):
        pytest.skip("c++ is not installed")
    if "\n$ psdmc view " in document.read_text(encoding="utf-8"):
        pytest.importorskip("plotly")
    for library in re.findall(
        r"^>>> import (?:psdmc, )?(jax|torch)\b", document.read_text(encoding="utf-8"), re.MULTILINE
    ):
        pytest.importorskip(library)
    (tmp_path / "document").mkdir()
    monkeypatch.chdir(tmp_path / "document")
    monkeypatch.setenv("CC", str(wrapper(tmp_path)))
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")  # what they call `cc` likewise

    assert run(document, tmp_path / "document") > 0


def test_the_pipeline_is_run():
    assert ROOT / "docs" / "pipeline.md" in RUNNABLE


def said_by(found: Callable[[Path, str], Iterable[str]]) -> set[tuple[str, str]]:
    """What every document says, by its name."""
    return {
        (name(document), word)
        for document in documents()
        for word in found(document, document.read_text(encoding="utf-8"))
    }


def test_links_lead_somewhere():
    links = said_by(
        lambda document, text: [str(document.parent / t) for t in LINK.findall(text) if "://" not in t]
    )

    assert len(links) > 200
    assert [link for link in links if not Path(link[1]).exists()] == []


def test_make_targets_exist():
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    target = re.compile(r"`make ([a-z-]+)[^`]*`|^ {4}make ([a-z-]+)", re.MULTILINE)
    named = said_by(lambda _, text: [a or b for a, b in target.findall(text)])

    assert len(named) > 20
    assert [place for place in named if place[1] not in targets] == []


def test_commands_exist():
    known = {command.name or command.callback.__name__ for command in app.registered_commands} | {"is"}
    named = said_by(lambda _, text: re.findall(r"psdmc ([a-z]+(?:-c)?) [A-Z\w./-]+", _code(text)))

    assert len(named) > 20
    assert [place for place in named if place[1] not in known] == []


def test_paths_in_the_tree_exist():
    path = re.compile(r"`((?:psdmc|templates|docs|tests|benchmarks|examples)/[\w./-]+)`")
    named = said_by(lambda _, text: path.findall(text))

    assert len(named) > 200
    assert [place for place in named if not (ROOT / place[1]).exists()] == []


def _code(text: str) -> str:
    """Inline code and indented or fenced lines."""
    return "\n".join(
        [*re.findall(r"`([^`\n]+)`", text), *re.findall(r"^(?: {4}|\$ )(.*)$", text, re.MULTILINE)]
    )
