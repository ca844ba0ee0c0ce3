"""`psdmc new` and `psdmc doctor`: a file to begin with, and what is installed for what."""

from __future__ import annotations

import importlib.metadata
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from command_line import status, typed

from psdmc.cli.starting import NEEDED, OPTIONAL, findings, missing
from psdmc.model.load import load


def test_the_new_robot_is_derived_as_it_is_and_passes_every_check(tmp_path: Path) -> None:
    assert typed("new", "arm two.toml", cwd=tmp_path).returncode == 0
    done = typed("derive", "arm two.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "note" not in done.stdout

    model = load(tmp_path / "arm two.npz")
    assert (model.mechanism.name, model.joint_names) == ("arm two", ("waist", "shoulder", "elbow"))
    assert model.theta_b is not None
    assert typed("check", "arm two.npz", cwd=tmp_path).returncode == 0


def test_what_it_explains_may_be_uncommented(tmp_path: Path) -> None:
    """Each commented line of the table is one that the reader takes."""
    assert status("new", tmp_path / "arm.toml") == 0
    text = (tmp_path / "arm.toml").read_text(encoding="utf-8")
    opened, count = re.subn(r"^# (?=(?:drive_inertia|zero|parent) = )", "", text, flags=re.MULTILINE)
    assert count == 3
    assert len(tomllib.loads(opened)["joint"]) == 3
    (tmp_path / "arm.toml").write_text(opened, encoding="utf-8")

    assert status("derive", tmp_path / "arm.toml", "-o", tmp_path / "arm.npz") == 0


@pytest.mark.parametrize("name", ['quo"te', "back\\slash", "\u00e4rm", "a\nb", "a\x1b[2J"])
def test_any_name_gives_a_file_that_can_be_read(name: str, tmp_path: Path) -> None:
    assert status("new", tmp_path / f"{name}.toml") == 0
    assert tomllib.loads((tmp_path / f"{name}.toml").read_text(encoding="utf-8"))["name"] == name


@pytest.mark.parametrize("kind", ["file", "folder", "link to nothing"])
def test_nothing_is_overwritten(kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "arm.toml"
    if kind == "file":
        path.write_text("mine", encoding="utf-8")
    elif kind == "folder":
        path.mkdir()
    else:
        path.symlink_to(tmp_path / "elsewhere")

    assert status("new", path) == 2
    assert "exists already" in capsys.readouterr().err
    if kind == "file":
        assert path.read_text(encoding="utf-8") == "mine"
    assert not (tmp_path / "elsewhere").exists()


def test_another_ending_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert status("new", tmp_path / "arm.urdf") == 2
    assert "hint: such as psdmc new arm.toml" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_the_doctor_says_every_part_and_what_it_is_for(tmp_path: Path) -> None:
    done = typed("doctor", PSDMC_CACHE_DIR=str(tmp_path))

    assert done.returncode == 0, done.stdout
    for name, purpose in NEEDED:
        version = re.escape(importlib.metadata.version(name))
        assert re.search(rf"^{re.escape(name)} +{version} \({purpose[:10]}", done.stdout, re.MULTILINE)
    assert re.search(r"^C compiler +\S+.* \d+\.\d+", done.stdout, re.MULTILINE)
    assert re.search(rf"^cache +{tmp_path}", done.stdout, re.MULTILINE)


def test_a_missing_compiler_is_an_error_with_its_remedy(tmp_path: Path) -> None:
    done = typed("doctor", CC="no-such-compiler", PSDMC_CACHE_DIR=str(tmp_path))

    assert done.returncode == 4
    assert re.search(r"^C compiler +MISSING", done.stdout, re.MULTILINE)
    assert "error: C compiler: " in done.stdout


def test_parts_that_are_missing_have_their_remedy() -> None:
    """In a process that finds neither MuJoCo nor NumPy."""
    code = (
        "import sys, importlib.metadata as m\n"
        "sys.modules['numpy'] = None\n"
        "was = m.version\n"
        "def version(name):\n"
        "    if name in ('mujoco', 'numpy'): raise m.PackageNotFoundError(name)\n"
        "    return was(name)\n"
        "m.version = version\n"
        "from psdmc.cli import main; main(['doctor'])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)

    assert done.returncode == 4
    assert "hint: mujoco: pip install 'psdmc[mjcf]'" in done.stdout
    assert "error: numpy: pip install numpy" in done.stdout
    assert re.search(r"direct calls +not installed .*: no numpy", " ".join(done.stdout.split()))


def test_a_command_that_lacks_a_package_names_it() -> None:
    code = "import sys; sys.modules['numpy'] = None\nfrom psdmc.cli import main; main(['show', 'robot.urdf'])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)

    assert done.returncode == 4
    assert done.stderr.splitlines()[0] == "error: the Python package numpy is not installed"


def test_the_doctor_says_whether_calls_are_direct_and_why_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PSDMC_DIRECT_CALLS", "0")
    (found,) = (part for part in findings() if part.part == "direct calls")
    assert (found.found, found.needed, found.remedy) == ("", False, "unset PSDMC_DIRECT_CALLS")
    assert found.purpose.endswith("PSDMC_DIRECT_CALLS is 0")


def test_every_dependency_that_psdmc_declares_for_its_users_is_known_to_the_doctor() -> None:
    users = (
        "bench",
        "calibrate",
        "cluster",
        "cuda",
        "examples",
        "fmu",
        "jax",
        "mjcf",
        "notebook",
        "torch",
        "view",
        "xacro",
    )
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))[
        "project"
    ]
    extras = project["optional-dependencies"]

    def bare(requirement: str) -> str:
        return re.match(r"[\w.-]+", requirement)[0]  # type: ignore[index]

    assert {bare(text) for text in project["dependencies"]} == {name for name, _ in NEEDED}
    assert {bare(text) for extra in users for text in extras[extra]} == {name for name, _, _ in OPTIONAL}
    for name, extra, _ in OPTIONAL:
        assert name in map(bare, extras[extra])
    assert not missing(findings())
