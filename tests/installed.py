"""Programs and robots that tests need and a machine may lack; and how to run a program that must succeed."""

from __future__ import annotations

import importlib.metadata
import os
import shutil
import subprocess
from functools import cache
from pathlib import Path

import pytest


@cache
def is_installed(program: str) -> bool:
    """Whether a program can be run. rustup's `cargo` is a proxy, which fails where no toolchain is installed."""
    found = shutil.which(program)
    if found is None or program != "cargo":
        return found is not None
    return subprocess.run([found, "--version"], capture_output=True, check=False).returncode == 0


def need(*programs: str) -> None:
    """Skip the test if one of these programs cannot be run."""
    for program in programs:
        if not is_installed(program):
            pytest.skip(f"{program} is not installed")


def run(*words: object, **environment: str) -> str:
    """Standard output of a program, which must succeed."""
    done = subprocess.run(
        [*map(str, words)], capture_output=True, text=True, check=False, env=os.environ | environment
    )
    assert done.returncode == 0, f"{words}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
    return done.stdout


def in_wheel(ending: str) -> Path:
    """The file of the wheel example-robot-data whose path ends so, as in `ur10_robot.urdf`. Skip the test without it."""
    try:
        wheel = importlib.metadata.distribution("example-robot-data")
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("example-robot-data is not installed")
    found = sorted(str(file) for file in wheel.files or () if f"/{file}".endswith(f"/{ending}"))
    if not found:
        pytest.skip(f"this example-robot-data has no {ending}")
    return Path(str(wheel.locate_file(found[0])))
