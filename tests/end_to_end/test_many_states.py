"""examples/many_states: the same torques by Dask and by a plain loop, in chunks."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[2] / "examples" / "many_states" / "many_states.py"


def test_a_few_chunks_of_the_many_states() -> None:
    """Two whole chunks and one of another length."""
    pytest.importorskip("dask")
    words = [sys.executable, str(EXAMPLE), "--states", "120000"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert [line.split()[0] for line in lines] == ["Dask", "plain", "largest"]
    assert all("million states/s" in line for line in lines[:2])
