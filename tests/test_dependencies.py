"""What pyproject.toml asks of dependencies, and what `make test-lowest` tests of it, are the same; and what it packs."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tomllib
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


def test_a_wheel_holds_every_folder():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    named = set(project["tool"]["setuptools"]["packages"]) - {"psdmc.templates"}
    found = {".".join(file.parent.relative_to(ROOT).parts) for file in (ROOT / "psdmc").rglob("__init__.py")}
    assert named == found


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
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
