"""Scripts that documents name run: each says what it is for, with the modules that it imports as they are now."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.mark.parametrize("script", ["verdicts.py", "long_log.py"])
def test_a_script_of_the_documents_starts(script: str):
    done = subprocess.run(
        [sys.executable, str(DOCS / script), "--help"], capture_output=True, text=True, check=False
    )

    assert done.returncode == 0, done.stderr
    assert "usage:" in done.stdout
