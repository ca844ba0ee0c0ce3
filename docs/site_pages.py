"""Builds the documentation site into generated/site: python docs/site_pages.py (`make docs`).

Gathers docs/, documents from beside it, and pages that the code itself says, makes links hold between them, and hands
the folder to Sphinx, for which any warning is an error. docs/conf.py is Sphinx's configuration."""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path
from posixpath import normpath, relpath

from reference_pages import c_header, command_line, python

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "generated/site_source"
SITE = ROOT / "generated/site"

EXAMPLES = ("*.ipynb", "*.py", "*.c", "*.cpp", "*.h", "Makefile")
"""Files of examples/ that the site offers for download."""

BESIDE = ("CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md", "examples/README.md")
"""Documents from outside docs/ that are pages of the same path."""

TABLES = ("tables.css", "tables.js")
"""What makes wide tables fit, here and in the reports' pages."""

UNSEARCHED = "---\nnosearch: true\n---\n\n"
"""Front matter that keeps a page out of the site's search index: a decision record would outrank the pages for users."""

LANDING = {"README.md": "index.md"}
"""Documents whose links lead to another page."""

MENU = {
    "Tutorials": (
        "install",
        "tutorials/controller",
        "tutorials/notebook",
        "tutorials/calibration",
        "tutorials/quadruped",
        "examples/README",
    ),
    "How to describe the robot": (
        "how-to/own-bodies",
        "how-to/no-inertias",
        "how-to/frames",
        "how-to/payload",
        "how-to/load-estimator",
        "how-to/floating-base",
    ),
    "How to use the code": (
        "how-to/cmake",
        "how-to/rust",
        "how-to/cuda",
        "how-to/embedded",
        "how-to/precision-and-simd",
        "how-to/batch",
        "how-to/many-robots",
        "how-to/sample",
        "how-to/derivatives",
        "how-to/casadi",
        "how-to/jax",
        "how-to/pytorch",
        "how-to/adapters",
        "how-to/matlab",
        "how-to/ros2",
        "how-to/contacts",
        "how-to/loops",
        "how-to/friction-cones",
        "how-to/whole-body",
        "how-to/reproducible-builds",
    ),
    "How to trust it": (
        "how-to/check",
        "how-to/view",
        "how-to/validate",
        "how-to/troubleshooting",
    ),
    "How to calibrate": (
        "how-to/calibration-log",
        "how-to/plan-campaign",
        "how-to/springs-and-friction",
        "how-to/priors",
        "how-to/figures",
    ),
    "Reference": (
        "functions",
        "command_line",
        "reference/cli",
        "python",
        "reference/python",
        "shipping",
        "reference/c",
        "notation",
        "robot_files",
        "files",
        "log_description",
        "calibration",
        "benchmarks",
        "side_by_side",
        "glossary",
        "CHANGELOG",
        "SECURITY",
    ),
    "Explanation": (
        "compare",
        "pipeline",
        "derivation",
        "factored",
        "passes",
        "trigonometry",
        "derivatives",
        "calibration_method",
        "verdict",
        "reliability",
    ),
    "Development": (
        "CONTRIBUTING",
        "how-to/extending",
        "how-to/adding-a-function",
        "how_tested",
        "campaigns",
        "decisions/index",
    ),
}
"""Pages by heading, in order."""

LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)#\s]+)(#[^)]*)?\)")


def gather(to: Path) -> None:
    """The site's sources, anew, in `to`."""
    shutil.rmtree(to, ignore_errors=True)
    shutil.copytree(ROOT / "docs", to, ignore=shutil.ignore_patterns("__pycache__", "*.py"))
    shutil.copy(ROOT / "docs/conf.py", to)
    for name in TABLES:
        shutil.copy(ROOT / f"templates/report/{name}.jinja", to / "static" / name)
    for example in (path for pattern in EXAMPLES for path in (ROOT / "examples").rglob(pattern)):
        (to / example.relative_to(ROOT)).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(example, to / example.relative_to(ROOT))
    for path in BESIDE:
        _write(to / path, (ROOT / path).read_text(encoding="utf-8"))
    pages = {"cli": command_line(), "python": python(), "c": c_header()}
    for name, text in pages.items():
        _write(to / f"reference/{name}.md", text)
    _write(to / "decisions/index.md", _decisions(to / "decisions"))
    known = {str(path.relative_to(to)) for path in to.rglob("*") if path.is_file()}
    for page in sorted(to.rglob("*.md")):
        text = linked(page.read_text(encoding="utf-8"), str(page.relative_to(to)), known)
        _write(page, UNSEARCHED + text if page.parent.name == "decisions" else text)
    with (to / "index.md").open("a", encoding="utf-8") as index:
        index.writelines(_toctree(pages, title) for title, pages in MENU.items())


def linked(text: str, page: str, known: set[str]) -> str:
    """The document with links that hold in the site: what is no page of it is named as code."""
    return LINK.sub(lambda link: _link(link, page, known), text)


def _link(link: re.Match[str], page: str, known: set[str]) -> str:
    mark, text, target, anchor = link[1], link[2], link[3], link[4] or ""
    if "://" in target:
        return link[0]
    found = normpath(f"{_folder(page)}/{target}")
    to = LANDING.get(found, found.removeprefix("docs/"))
    if to in known:
        return f"{mark}[{text}]({relpath(to, str(Path(page).parent))}{anchor})"
    return f"{text} (`{found}`)" if text.strip("`") != found else f"`{found}`"


def _folder(page: str) -> str:
    """Where a page's document is in the repository."""
    return str(Path(page if page in BESIDE else f"docs/{page}").parent)


def _decisions(folder: Path) -> str:
    names = [path.stem for path in sorted(folder.glob("[0-9]*.md"))]
    return f"# Decision records\n\nWhy psdmc is built as it is, newest last.\n{_toctree(tuple(names), '', hidden=False)}"


def _toctree(pages: tuple[str, ...], title: str, hidden: bool = True) -> str:
    options = [*([f":caption: {title}"] if title else []), *([":hidden:"] if hidden else []), ":maxdepth: 1"]
    return "\n".join(["", "```{toctree}", *options, "", *pages, "```", ""])


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def render(source: Path, site: Path) -> int:
    """Sphinx's pages of what was gathered; 0 where it had nothing to warn of."""
    from sphinx.cmd.build import build_main

    return build_main(["-W", "--keep-going", "-q", "-E", "-b", "html", str(source), str(site)])


if __name__ == "__main__":
    gather(SOURCE)
    sys.exit(render(SOURCE, SITE))
