"""The documentation site builds without a warning, and every document is in its menu."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest
from blocks import ROOT

sys.path.insert(0, str(ROOT / "docs"))
import site_pages


def test_every_document_is_in_the_menu(tmp_path: Path):
    site_pages.gather(tmp_path / "source")
    pages = {str(path.relative_to(tmp_path / "source"))[:-3] for path in (tmp_path / "source").rglob("*.md")}
    listed = {page for group in site_pages.MENU.values() for page in group}

    assert {page for page in pages - listed if not page.startswith("decisions/")} == {"index"}


def test_decision_records_alone_are_out_of_the_search(tmp_path: Path):
    site_pages.gather(tmp_path / "source")
    pages = sorted((tmp_path / "source").rglob("*.md"))
    unsearched = {page.parent.name for page in pages if "nosearch: true" in page.read_text(encoding="utf-8")}

    assert unsearched == {"decisions"}


def test_links_out_of_the_site_are_names():
    text = site_pages.linked(
        "[the consumers](../examples/consumers), [pass](passes.md#x), [h](../README.md)",
        "a.md",
        {"passes.md"},
    )

    assert text == "the consumers (`examples/consumers`), [pass](passes.md#x), h (`README.md`)"


@pytest.mark.slow
def test_the_site_builds_without_a_warning(tmp_path: Path):
    pytest.importorskip("furo")
    site_pages.gather(tmp_path / "source")

    assert site_pages.render(tmp_path / "source", tmp_path / "site") == 0
    assert (tmp_path / "site/reference/cli.html").exists()
    searched = (tmp_path / "site/searchindex.js").read_text(encoding="utf-8")
    assert "Compute a batch of states" in searched
    assert "matrices come with their patterns" not in searched  # a decision record's title


@pytest.mark.slow
def test_a_broken_link_is_an_error(tmp_path: Path):
    pytest.importorskip("furo")
    source = tmp_path / "source"
    shutil.copytree(ROOT / "docs/static", source / "static")
    shutil.copy(ROOT / "docs/conf.py", source)
    (source / "index.md").write_text("# Page\n\n[nowhere](nowhere.md)\n", encoding="utf-8")

    assert site_pages.render(source, tmp_path / "site") != 0
