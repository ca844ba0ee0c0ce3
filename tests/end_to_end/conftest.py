"""One compile cache for the whole run, shared by all workers and thrown away with it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture(scope="session", autouse=True)
def compile_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if base.name.startswith("popen-gw") else base) / "compile-cache"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PSDMC_CACHE_DIR", str(folder))
        yield folder
