"""What the documents tell a user to install is what pyproject.toml offers, and is enough."""

from __future__ import annotations

import ast
import json
import re
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
from slow_cases import slow_but_for

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS: dict[str, list[str]] = PROJECT["optional-dependencies"]
NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))
BESIDE_IMPORTS = {
    "psdmc.calibrate(": "cvxpy",
    'distribution("example-robot-data")': "example-robot-data",
    ".to_frame(": "pandas",
    ".torque_expression(": "sympy",
}
"""What a notebook's text needs without importing it."""


def named(requirements: list[str]) -> set[str]:
    return {re.split(r"[<>=;\s\[]", text)[0].lower() for text in requirements}


def told(command: str) -> set[str]:
    """Distributions that `pip install COMMAND` brings beside psdmc's own."""
    found: set[str] = set(named(PROJECT["dependencies"]))
    for word in command.replace("'", "").split():
        extras = re.fullmatch(r"(?:psdmc|\.)\[([\w,]+)\]", word)
        found |= (
            {name for extra in extras[1].split(",") for name in named(EXTRAS[extra])}
            if extras
            else {word.lower()}
        )
    return found


def sources(path: Path) -> list[str]:
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]


def imported(source: str) -> set[str]:
    nodes = list(ast.walk(ast.parse(source)))
    plain = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    return {
        name.split(".")[0]
        for name in plain + [n.module or "" for n in nodes if isinstance(n, ast.ImportFrom)]
    }


def test_every_extra_is_in_the_table_once() -> None:
    rows = [
        line.split("|")[1]
        for line in (ROOT / "docs" / "install.md").read_text("utf-8").splitlines()
        if line.startswith("| ")
    ]
    names = [name for row in rows for name in re.findall(r"`(\w+)`", row)]
    assert sorted(names) == sorted(EXTRAS)


def test_extras_that_documents_name_exist() -> None:
    texts = [
        path.read_text("utf-8")
        for path in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), ROOT / "examples" / "README.md")
    ]
    found = {
        extra
        for text in texts
        for group in re.findall(r"(?:psdmc|'\.)\[([\w,]+)\]'", text)
        for extra in group.split(",")
    }
    assert found
    assert found <= set(EXTRAS)


@pytest.mark.parametrize("path", slow_but_for(NOTEBOOKS[:1], NOTEBOOKS), ids=lambda path: path.stem)
def test_what_is_told_to_install_is_enough_for_a_notebook(path: Path) -> None:
    command = re.search(
        r"pip install ('(?:psdmc|\.)\[[^`\n]*jupyterlab)",
        (ROOT / "examples" / "README.md").read_text("utf-8"),
    )
    assert command
    brought = told(command[1])
    distributions = packages_distributions()
    for source in sources(path):
        needs = {need for text, need in BESIDE_IMPORTS.items() if text in source}
        for name in imported(source) - set(sys.stdlib_module_names) - {"psdmc"}:
            needs.add("pin" if name == "pinocchio" else distributions[name][0].lower())
        assert needs <= brought


def test_no_system_is_claimed_that_tests_do_not_run_on() -> None:
    """The metadata name Linux alone, and a page that names macOS says somewhere that it was not tried."""
    systems = [word for word in PROJECT["classifiers"] if word.startswith("Operating System")]
    assert systems == ["Operating System :: POSIX :: Linux"]
    pages = [
        ROOT / "README.md",
        *(page for page in (ROOT / "docs").rglob("*.md") if page.parent.name != "decisions"),
    ]
    named = {page.name: page.read_text(encoding="utf-8") for page in pages}
    named = {name: text for name, text in named.items() if "macOS" in text}
    assert "install.md" in named
    assert [
        name for name, text in named.items() if not re.search(r"macOS[^.|]* not (tested|tried)", text)
    ] == []
