"""Shared set-up: test helpers beside this file can be imported by name; hypothesis draws the same examples every time,
or, with HYPOTHESIS_PROFILE=explore, new ones."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from hypothesis import settings

sys.path.insert(0, str(Path(__file__).parent))

settings.register_profile("repeatable", derandomize=True)
settings.register_profile("explore", derandomize=False)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))
