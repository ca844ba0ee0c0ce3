"""The programs of examples/jax do what they promise."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("jax")

ROOT = Path(__file__).parents[2]


def printed(program: str, iterations: int) -> str:
    words = [sys.executable, f"examples/jax/{program}.py", "--iterations", str(iterations)]
    return subprocess.run(words, cwd=ROOT, check=True, capture_output=True, text=True).stdout


@pytest.mark.slow
def test_torques_by_the_gradient_reach_the_target() -> None:
    found = printed("rollout", 100)
    distance, rate = map(float, re.findall(r"(\d\.\d+) rad", found))
    assert distance < 0.01  # rad, of 0.5 at the start
    assert rate < 0.1  # rad/s


@pytest.mark.slow
def test_gradient_descent_finds_the_load() -> None:
    found = printed("identify", 60).splitlines()[-1]
    values = re.search(r"load of (\S+) kg at \((\S+), (\S+), (\S+)\) m", found)
    assert values is not None
    assert [*map(float, values.groups())] == pytest.approx([2.5, 0.02, 0.0, 0.05], abs=0.005)
