"""Array frameworks are optional: psdmc imports none until it is asked for one, and says what to install."""

from __future__ import annotations

import subprocess
import sys

import pytest

import psdmc
from psdmc.errors import ToolchainError


def test_psdmc_imports_no_framework() -> None:
    code = "import sys, psdmc, psdmc.compiler; sys.exit(bool({'jax', 'torch'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_missing_framework_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "jax", None)
    monkeypatch.delitem(sys.modules, "psdmc.frameworks.jax_robot", raising=False)
    with pytest.raises(ToolchainError, match=r"^psdmc\.jax needs JAX, which is not installed") as caught:
        psdmc.jax("robot.npz")
    assert caught.value.hint == "pip install 'psdmc[jax]'"
