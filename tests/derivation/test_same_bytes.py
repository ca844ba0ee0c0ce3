"""The same robot gives the same model file and the same package, whatever the processor, PYTHONHASHSEED and the folder.

tests/golden/bytes.json holds SHA-256 sums without psdmc's version number; PSDMC_REWRITE_GOLDEN=1 rewrites it. `make
test-machines` computes all of them as other processors do.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from bundled import bundled_model, robot_path
from installed import in_wheel
from slow_cases import slow_but_for

import psdmc
from psdmc.compiler import derive
from psdmc.model.store import file_bytes

GOLDEN = Path(__file__).parents[1] / "golden" / "bytes.json"
VERSION = "0.0.0"
"""What the sums have in place of psdmc's version."""

FOREIGN = {
    "panda": ("panda.urdf", False),
    "hyq": ("hyq_no_sensors.urdf", True),
    "talos": ("talos_reduced.urdf", True),
}
"""File in the example-robot-data wheel, and whether the robot has a floating base."""

SEEN = ("kr6", "lbr7", *FOREIGN)

SCRIPT = """
import hashlib, sys
from psdmc.compiler import derive
from psdmc.model.store import file_bytes
for path in sys.argv[1:]:
    print(hashlib.sha256(file_bytes(derive(path))).hexdigest())
"""
ROBOTS = ("scara", "denso_wall", "rounded_arm")


def held(key: str, found: str) -> str:
    """The sum that the golden file has, which is `found` where it is rewritten."""
    sums = json.loads(GOLDEN.read_text()) if GOLDEN.exists() else {}
    if os.environ.get("PSDMC_REWRITE_GOLDEN"):
        sums[key] = found
        GOLDEN.write_text(json.dumps(dict(sorted(sums.items())), indent=1) + "\n")
    return sums[key]


def model_of(name: str) -> psdmc.DynamicsModel:
    if name not in FOREIGN:
        return derive(robot_path(name))
    file, floating = FOREIGN[name]
    source = hashlib.sha256(in_wheel(file).read_bytes()).hexdigest()
    if held(f"{name} file", source) != source:
        pytest.skip("another release of example-robot-data has another file of this robot")
    return derive(in_wheel(file), floating=floating)


@pytest.fixture
def without_version(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("psdmc.version.VERSION", VERSION)


@pytest.mark.usefixtures("without_version")
@pytest.mark.parametrize("name", SEEN)
def test_a_model_file_has_the_bytes_of_every_processor(name: str) -> None:
    found = hashlib.sha256(file_bytes(model_of(name))).hexdigest()

    assert found == held(f"{name} model", found)


@pytest.mark.usefixtures("without_version")
@pytest.mark.parametrize("name", slow_but_for(["kr6"], SEEN))
def test_a_package_has_the_bytes_of_every_processor(name: str, tmp_path: Path) -> None:
    psdmc.emit_c(model_of(name), tmp_path / name)

    sums = hashlib.sha256()
    for path in sorted(path for path in tmp_path.rglob("*") if path.is_file()):
        sums.update(repr((path.relative_to(tmp_path).as_posix(), path.read_bytes())).encode())
    assert sums.hexdigest() == held(f"{name} package", sums.hexdigest())


@pytest.mark.parametrize("seed", slow_but_for(["4242"], ["0", "1", "4242"]))
def test_same_bytes_in_another_process(seed: str) -> None:
    command = [sys.executable, "-c", SCRIPT, *(str(robot_path(name)) for name in ROBOTS)]
    run = subprocess.run(
        command, env=os.environ | {"PYTHONHASHSEED": seed}, capture_output=True, text=True, check=True
    )
    here = [hashlib.sha256(file_bytes(bundled_model(name))).hexdigest() for name in ROBOTS]
    assert run.stdout.split() == here
