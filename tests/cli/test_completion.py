"""Shell completion, by the protocol of each shell; in bash, where it is installed, as its readline asks for it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PSDMC = Path(sys.executable).parent / "psdmc"


def asked(**environment: str) -> str:
    """What psdmc answers to a shell."""
    done = subprocess.run(
        [sys.executable, "-m", "psdmc"],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    return done.stdout


def test_bash_gets_commands_options_and_values() -> None:
    def answer(line: str) -> list[str]:
        count = len(line.split(" ")) - 1
        return asked(_PSDMC_COMPLETE="complete_bash", COMP_WORDS=line, COMP_CWORD=str(count)).split()

    assert answer("psdmc de") == ["derive"]
    assert {"emit-c", "show", "calibrate"} <= set(answer("psdmc "))
    assert answer("psdmc derive --grav") == ["--gravity", "--gravity-input"]
    assert answer("psdmc emit-c m.npz --target cortex") == ["cortex-m4f", "cortex-m7"]
    assert answer("psdmc emit-c m.npz --lowering f") == ["factored"]


@pytest.mark.parametrize(
    ("shell", "variables"), [("zsh", {}), ("fish", {"_TYPER_COMPLETE_FISH_ACTION": "get-args"})]
)
def test_other_shells_get_them(shell: str, variables: dict[str, str]) -> None:
    said = asked(_PSDMC_COMPLETE=f"complete_{shell}", _TYPER_COMPLETE_ARGS="psdmc emi", **variables)

    assert "emit-c" in said
    assert "derive" not in said


@pytest.mark.skipif(
    not PSDMC.exists() or not shutil.which("bash"), reason="no bash, or psdmc is not installed"
)
def test_the_script_that_is_installed_works_in_bash(tmp_path: Path) -> None:
    home = {"HOME": str(tmp_path), "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
    path = {"PATH": f"{PSDMC.parent}{os.pathsep}{os.environ['PATH']}"}
    environment = os.environ | home | path
    subprocess.run([PSDMC, "--install-completion", "bash"], env=environment, check=True, capture_output=True)
    asks = 'source ~/.bashrc; COMP_WORDS=(psdmc ca); COMP_CWORD=1; _psdmc_completion psdmc; echo "${COMPREPLY[@]}"'

    done = subprocess.run(["bash", "-c", asks], env=environment, capture_output=True, text=True, check=True)

    assert done.stdout.split() == ["calibrate", "cache"]
