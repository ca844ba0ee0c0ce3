from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from bundled import bundled_model

from psdmc.bench.case import Case

sys.path.insert(0, os.path.dirname(__file__))


@pytest.fixture(scope="session")
def two_link() -> Case:
    return Case("two-link", bundled_model("two_link_full"), "as bundled")


@pytest.fixture(autouse=True, scope="session")
def private_cache(tmp_path_factory: pytest.TempPathFactory):
    """Builds of a test run are its own, and shared by its tests."""
    before = os.environ.get("PSDMC_CACHE_DIR")
    os.environ["PSDMC_CACHE_DIR"] = str(before or tmp_path_factory.mktemp("cache"))
    yield Path(os.environ["PSDMC_CACHE_DIR"])
    if before is None:
        del os.environ["PSDMC_CACHE_DIR"]
