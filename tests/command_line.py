"""psdmc's command line: in this process, for speed, or in one of its own, as a user types it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from psdmc.cli import main

SECONDS = 300


def typed(*words: object, cwd: Path | None = None, **environment: str) -> subprocess.CompletedProcess[str]:
    """`psdmc WORDS` in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "psdmc", *map(str, words)],
        cwd=cwd,
        env=os.environ | environment,
        capture_output=True,
        encoding=environment.get("PYTHONIOENCODING", "utf-8"),
        timeout=SECONDS,
        check=False,
    )


def status(*words: object) -> int:
    """Exit status of `psdmc WORDS` in this process."""
    with pytest.raises(SystemExit) as left:
        main([str(word) for word in words])
    code = left.value.code
    return code if isinstance(code, int) else int(code is not None)


def files_in(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
