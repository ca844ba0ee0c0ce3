"""Programs that tests need and a machine may lack."""

from __future__ import annotations

import shutil
import subprocess
from functools import cache


@cache
def is_installed(program: str) -> bool:
    """Whether a program can be run. rustup's `cargo` is a proxy, which fails where no toolchain is installed."""
    found = shutil.which(program)
    if found is None or program != "cargo":
        return found is not None
    return subprocess.run([found, "--version"], capture_output=True, check=False).returncode == 0
