"""PyTorch is optional, and nothing loads it before psdmc.torch is called."""

from __future__ import annotations

import subprocess
import sys

NOT_LOADED = """
import sys, psdmc, psdmc.cli
psdmc.compile, psdmc.torch if len(sys.argv) > 1 else None
assert "torch" not in sys.modules
"""

MISSING = """
import sys, psdmc
sys.modules["torch"] = None
try:
    psdmc.torch
except psdmc.ToolchainError as error:
    print(error.message, "|", error.hint)
"""


def test_importing_psdmc_does_not_import_torch() -> None:
    subprocess.run([sys.executable, "-c", NOT_LOADED], check=True)


def test_a_missing_pytorch_is_an_error_with_a_remedy() -> None:
    done = subprocess.run([sys.executable, "-c", MISSING], check=True, capture_output=True, text=True)
    assert done.stdout == "psdmc.torch needs PyTorch | pip install 'psdmc[torch]'\n"
