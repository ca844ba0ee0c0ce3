"""A call executes the same instructions whatever the state: what a real-time loop wants to hear, counted by valgrind."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from direct import write_sources
from traced import arm_package

PROGRAM = r"""
#include <stdlib.h>
#include <test_arm/test_arm.h>

int main(int count, char **words)
{
    const double scale = atof(words[count - 1]);
    double state[3][test_arm_DOF], out[test_arm_DOF];
    srand((unsigned)scale);
    for (int call = 0; call < 50; call++) {
        for (int k = 0; k < 3 * test_arm_DOF; k++) {
            state[k / test_arm_DOF][k % test_arm_DOF] = scale * (rand() / (double)RAND_MAX - 0.5);
        }
        test_arm_inverse_dynamics(state[0], state[1], state[2], out);
        (void)test_arm_forward_dynamics(state[0], state[1], state[2], out);
    }
    return 0;
}
"""
SCALES = ("0", "1e-300", "1", "6", "1e5")
"""Standing still, denormal squares, ordinary motion, several turns, the sincos's whole range."""


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    for needed in ("gcc", "valgrind"):
        if shutil.which(needed) is None:
            pytest.skip(f"{needed} is not installed")
    folder = tmp_path_factory.mktemp("constant")
    package = arm_package(names=["inverse_dynamics", "forward_dynamics"])
    write_sources(package, folder)
    (folder / "main.c").write_text(PROGRAM)
    sources = [str(folder / source) for source in ("main.c", *package.sources)]
    words = ["gcc", "-std=c99", "-O2", f"-I{folder}/include", *sources, "-lm", "-o", str(folder / "main")]
    subprocess.run(words, check=True)
    return folder / "main"


@pytest.mark.parametrize("function", ["inverse_dynamics", "forward_dynamics"])
def test_the_number_of_instructions_does_not_depend_on_the_state(function: str, program: Path) -> None:
    counts = {scale: _instructions(program, f"test_arm_{function}", scale) for scale in SCALES}
    assert min(counts.values()) > 50 * 100
    assert len(set(counts.values())) == 1, counts


def _instructions(program: Path, symbol: str, scale: str) -> int:
    words = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", f"--toggle-collect={symbol}"]
    done = subprocess.run([*words, str(program), scale], capture_output=True, text=True, check=True)
    found = re.search(r"Collected\s*:\s*(\d+)", done.stderr)
    assert found, done.stderr
    return int(found[1])
