"""Where the real robot's log lies in a developer's checkout; tests that read it skip where it is absent."""

from __future__ import annotations

from pathlib import Path

UR10_LOG = Path(__file__).resolve().parents[2] / "shared" / "datasets" / "ur10_jointstate"
