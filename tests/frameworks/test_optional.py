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


@pytest.mark.parametrize(("name", "library"), [("jax", "JAX"), ("torch", "PyTorch")])
def test_a_missing_framework_is_named(name: str, library: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.delitem(sys.modules, f"psdmc.frameworks.{name}_robot", raising=False)
    message = rf"^psdmc\.{name} needs {library}, which is not installed"
    with pytest.raises(ToolchainError, match=message) as caught:
        getattr(psdmc, name)("robot.npz")
    assert caught.value.hint == f"pip install 'psdmc[{name}]'"
