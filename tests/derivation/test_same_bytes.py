"""The same robot gives the same model file, whatever PYTHONHASHSEED."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys

import pytest
from bundled import bundled_model, robot_path
from slow_cases import slow_but_for

from psdmc.model.store import file_bytes

SCRIPT = """
import hashlib, sys
from psdmc.compiler import derive
from psdmc.model.store import file_bytes
for path in sys.argv[1:]:
    print(hashlib.sha256(file_bytes(derive(path))).hexdigest())
"""
ROBOTS = ("scara", "denso_wall", "rounded_arm")


@pytest.mark.parametrize("seed", slow_but_for(["4242"], ["0", "1", "4242"]))
def test_same_bytes_in_another_process(seed: str) -> None:
    command = [sys.executable, "-c", SCRIPT, *(str(robot_path(name)) for name in ROBOTS)]
    run = subprocess.run(
        command, env=os.environ | {"PYTHONHASHSEED": seed}, capture_output=True, text=True, check=True
    )
    here = [hashlib.sha256(file_bytes(bundled_model(name))).hexdigest() for name in ROBOTS]
    assert run.stdout.split() == here
