"""examples/palletiser: the torques of its four motors beside MuJoCo's tree, and a pick in MuJoCo with soft loops."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[2] / "examples" / "palletiser" / "pick.py"


def test_the_palletiser_picks_up_a_box(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    picture = tmp_path / "pick.png"
    words = [sys.executable, str(EXAMPLE), "--plot", str(picture)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    rows = [re.split(r"\s{2,}", line)[:2] for line in done.stdout.splitlines()]
    assert rows[0] == ["10 joints, 4 motors, 25 base parameters"]
    found = {name: float(value.split()[0]) for name, value in rows[1:]}
    assert found["torques, largest difference from MuJoCo"] < 1e-12
    assert found["tracking error, largest"] < 1e-3
    assert found["joints of MuJoCo's loops, off by at most"] < 1e-5
    assert found["tilt of the flange, largest"] < 1e-5
    assert found["torque of axis_1, largest"] > 1000.0
    assert picture.stat().st_size > 20_000
