"""Scripts that documents name run: each says what it is for, with the modules that it imports as they are now."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from slow_cases import slow_but_for

import psdmc

DOCS = Path(__file__).resolve().parents[2] / "docs"


SCRIPTS = ["verdicts.py", "planted_faults.py", "long_log.py", "excitation.py"]


@pytest.mark.parametrize("script", slow_but_for(SCRIPTS[:1], SCRIPTS))
def test_a_script_of_the_documents_starts(script: str):
    done = subprocess.run(
        [sys.executable, str(DOCS / script), "--help"], capture_output=True, text=True, check=False
    )

    assert done.returncode == 0, done.stderr
    assert "usage:" in done.stdout


def test_the_long_log_is_made_of_the_robots_own_torques(monkeypatch: pytest.MonkeyPatch):
    """Less friction, the model's at the same states but for the noise of 0.3 N m."""
    monkeypatch.syspath_prepend(str(DOCS))
    from long_log import ROBOT, rows_of_log

    model = psdmc.derive(ROBOT)
    log = rows_of_log(model, 0, 20_000, 1000.0)

    time, q, effort = (
        log.time[::20],
        log.position[::20],
        log.effort[::20],
    )  # rounded positions, differentiated twice
    qd = np.gradient(q, time, axis=0)
    rigid = model.inverse_dynamics(q, qd, np.gradient(qd, time, axis=0))
    friction = 2.0 * np.tanh(qd / 0.03) + 3.0 * qd
    assert 0.28 < (effort - rigid - friction)[5:-5].std() < 0.32
