"""`--version` and every `--help` load none of the packages that the work needs: they answer at once on any machine."""

from __future__ import annotations

import subprocess
import sys

import pytest

from psdmc.cli.commands import COMMANDS

HEAVY = (
    *("numpy", "scipy", "pinocchio", "matplotlib", "cffi", "jinja2", "mujoco", "casadi", "cvxpy", "rosbags"),
    *("rich", "pygments", "setuptools"),
)
"""Packages that take from 20 ms to 2 s to load."""

PROGRAM = """
import sys
sys.argv = ["psdmc", *sys.argv[1:]]
from psdmc.cli import main
try:
    main()
finally:
    sys.stdout.flush()
    print(*sorted({name.partition(".")[0] for name in sys.modules}), file=sys.stderr)
"""


def loaded(*words: str) -> tuple[str, set[str]]:
    """What `psdmc WORDS` prints, and the packages that it has loaded then."""
    done = subprocess.run([sys.executable, "-c", PROGRAM, *words], capture_output=True, text=True, check=True)
    return done.stdout, set(done.stderr.split())


HELP = [("--help",), *((function.__name__.replace("_", "-"), "--help") for function, _ in COMMANDS)]


@pytest.mark.parametrize("words", HELP, ids=" ".join)
def test_help_loads_nothing_heavy(words: tuple[str, ...]) -> None:
    said, packages = loaded(*words)

    assert "Usage: psdmc" in said
    assert "psdmc" in packages
    assert packages.isdisjoint(HEAVY), sorted(packages & set(HEAVY))


def test_the_version_does_not_load_typer_either() -> None:
    said, packages = loaded("--version")

    assert said.startswith("psdmc ")
    assert packages.isdisjoint({*HEAVY, "typer", "click"})


def test_the_version_is_the_same_among_other_options() -> None:
    assert loaded("--debug", "--version")[0] == loaded("--version")[0]
