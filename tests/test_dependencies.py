"""What pyproject.toml asks of dependencies, and what `make test-lowest` tests of it, are the same; and what it packs."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import numpy
import pytest

ROOT = Path(__file__).parent.parent
UNTESTED = {"build", "mypy", "pytest-cov", "reuse", "ruff"}
"""Tools of `make check`, `make coverage` and releases: no fast test imports them."""


def lowest() -> dict[str, str]:
    text = (ROOT / "constraints" / "lowest.txt").read_text(encoding="utf-8")
    return dict(line.split("==") for line in text.splitlines() if line and not line.startswith("#"))


def bounds() -> dict[str, str]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    asked = [*project["dependencies"], *extras["test"], *extras["calibrate"]]
    found = (re.fullmatch(r"([\w.-]+)>=([\d.]+)(;.*)?", one) for one in asked)
    return {match[1]: match[2] for match in found if match}


def padded(version: str) -> str:
    return ".".join([*version.split("."), "0", "0"][:3])


def test_every_lower_bound_is_tested():
    asked = {name: padded(version) for name, version in bounds().items() if name not in UNTESTED}
    tested = {name: padded(version) for name, version in lowest().items()}
    assert tested == asked


def imported_at_once(file: Path) -> set[str]:
    """The packages that a test file cannot be collected without."""
    body = ast.parse(file.read_text(encoding="utf-8")).body
    plain = {alias.name for one in body if isinstance(one, ast.Import) for alias in one.names}
    return {
        name.split(".")[0]
        for name in plain | {one.module or "" for one in body if isinstance(one, ast.ImportFrom)}
    }


def test_fast_tests_are_collected_without_the_other_extras():
    """`make test-lowest` installs the packages below only: a fast test asks for any other by `pytest.importorskip`."""
    make = (ROOT / "Makefile").read_text(encoding="utf-8").replace("\\\n", " ")
    fast, files = (re.search(rf"^{name} *:?= *(.*)$", make, re.M)[1] for name in ("FAST", "LOWEST_TESTS"))  # type: ignore[index]
    named = [ROOT / path for path in f"{fast} {files}".split() if not path.startswith("$")]
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "optional-dependencies"
    ]
    there, asked = (
        {re.split(r"[^\w.-]", one)[0] for name in names for one in extras[name]}
        for names in ({"calibrate"}, extras)
    )
    installed = {*re.search(r"--editable '\.\[calibrate\]' (.*)", make)[1].split(), *there}  # type: ignore[index]
    other = {
        name
        for name, owners in packages_distributions().items()
        if {*owners} & asked and not {*owners} & installed
    }
    tests = [file for path in named for file in ([path] if path.is_file() else path.rglob("*.py"))]

    assert len(tests) > 50
    assert {file.name: found for file in tests if (found := imported_at_once(file) & other)} == {}


def test_a_wheel_holds_every_folder():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    named = set(project["tool"]["setuptools"]["packages"]) - {"psdmc.templates"}
    found = {".".join(file.parent.relative_to(ROOT).parts) for file in (ROOT / "psdmc").rglob("__init__.py")}
    assert named == found


@pytest.mark.needs("make")
@pytest.mark.parametrize("answer", [None, '{"info": {}}', "<html>a mirror</html>"])
def test_an_audit_that_reaches_no_advisories_says_so_in_a_line(answer: str | None, tmp_path: Path):
    """No answer, one of an index without advisories, and a page in place of one."""
    page = tmp_path / "numpy" / numpy.__version__ / "json"
    page.parent.mkdir(parents=True)
    if answer is not None:
        page.write_text(answer)
    index = tmp_path.as_uri()
    words = ["make", "-s", f"VENV={sys.prefix}", "-o", f"{sys.prefix}/ready", f"ADVISORIES={index}"]

    done = subprocess.run([*words, "audit"], cwd=ROOT, capture_output=True, text=True, check=False)

    assert done.returncode == 2
    assert done.stdout.splitlines() == [
        f"error: {index} gives no advisories of numpy: nothing is audited",
        "hint: run make audit where the index of packages is reached",
    ]
    assert "Traceback" not in done.stderr
    assert "pip_audit" not in done.stderr
