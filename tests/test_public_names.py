"""Names of psdmc 0.1: they work, or fail with the new one."""

from __future__ import annotations

import importlib

import pytest

import psdmc

NAMES = [
    "DerivationError",
    "DynamicsModel",
    "InputError",
    "InternalError",
    "PsdmcError",
    "ToolchainError",
    "compile",
    "derive",
    "emit_c",
    "load",
]
"""What `import psdmc` offered."""

DOCUMENTED = {
    "psdmc.robot.load": ["load_robot"],
    "psdmc.dynamics.frames": ["base_acceleration", "frames_of"],
    "psdmc.dynamics.newton_euler": ["inverse_dynamics"],
    "psdmc.dynamics.parameters": ["bodies_of"],
    "psdmc.model.summary": ["term_texts"],
    "psdmc.lower.kernels": ["lower"],
    "psdmc.program.text": ["show"],
    "psdmc.program.cost": ["cost"],
    "psdmc.program.interpret": ["interpret"],
}
"""Modules that its documents imported from."""

MOVED = {
    "psdmc.derive.from_callable": "psdmc.derivation",
    "psdmc.derive": "psdmc.derivation",
    "psdmc.calibrate.actuators": "psdmc.calibration",
    "psdmc.derivation.functions": "psdmc.derivation.monomials",
    "psdmc.emit.package": "psdmc.backends.c",
    "psdmc.emit": "psdmc.backends.c",
    "psdmc.model.check": "psdmc.verification.check",
    "psdmc.program.functions": "psdmc.program.signature",
    "psdmc.robot.chain": "psdmc.robot.mechanism",
}
"""Module -> the name that the error must give."""


@pytest.mark.parametrize("name", NAMES)
def test_what_psdmc_offered_is_there(name: str) -> None:
    assert getattr(psdmc, name).__module__.startswith("psdmc.")


@pytest.mark.parametrize("module", DOCUMENTED)
def test_what_documents_imported_is_there(module: str) -> None:
    found = importlib.import_module(module)
    assert all(callable(getattr(found, name)) for name in DOCUMENTED[module])


@pytest.mark.parametrize("module", MOVED)
def test_a_moved_module_is_told_by_its_new_name(module: str) -> None:
    with pytest.raises(ModuleNotFoundError, match=f"'{MOVED[module]}'") as caught:
        importlib.import_module(module)
    assert "psdmc 0.1" in str(caught.value)
    importlib.import_module(MOVED[module])


def test_other_missing_modules_are_missing_as_ever() -> None:
    with pytest.raises(ModuleNotFoundError, match=r"No module named 'psdmc\.derived'"):
        importlib.import_module("psdmc.derived")
