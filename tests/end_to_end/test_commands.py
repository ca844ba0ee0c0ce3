"""The command line from a robot file to a tested library, as a user types it."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model, robot_path
from command_line import files_in, status, typed
from unoptimised import wrapper


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the README's commands were typed, one after the other."""
    folder, compiler = tmp_path_factory.mktemp("work"), wrapper(tmp_path_factory.mktemp("unoptimised"))
    for words in (
        ("derive", robot_path("scara"), "-o", "scara.npz"),
        ("emit-c", "scara.npz", "-o", "scara"),
        ("build", "scara"),
    ):
        done = typed(*words, cwd=folder, CC=str(compiler))
        assert done.returncode == 0, done.stderr
        assert done.stdout.count("\n") >= 1
    return folder


def test_the_model_file_is_readable_with_numpy_alone(work: Path):
    with np.load(work / "scara.npz", allow_pickle=False) as file:
        manifest = json.loads(str(file["manifest"]))
        E, B = file["E"], file["B"]

    assert manifest["schema"] == 1
    assert E.shape == (20, 69)
    assert B.shape == (8, 44)


def test_show_says_what_an_engineer_asks(work: Path):
    done = typed("show", "scara.npz", cwd=work)

    assert done.returncode == 0, done.stderr
    for words in (
        "p = 69",
        "l = 8",
        "gravity",
        "prismatic",
        "rad",
        "kg m^2",
        "largest torque error",
        "sha256",
    ):
        assert words in done.stdout, words


def test_show_lists_functions_and_costs(work: Path, capsys: pytest.CaptureFixture[str]):
    assert status("show", work / "scara.npz", "--terms") == 0
    assert capsys.readouterr().out.count("\n") == 69
    assert status("show", work / "scara.npz", "--cost") == 0
    assert "inverse_dynamics" in capsys.readouterr().out


def test_check_passes_and_fails_with_a_status(work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert status("check", work / "scara.npz") == 0
    assert "FAIL" not in capsys.readouterr().out
    text = robot_path("scara").read_text(encoding="utf-8")
    other = tmp_path / "other.toml"
    other.write_text(text.replace("a = 0.3\n", "a = 0.31\n"), encoding="utf-8")
    assert other.read_text(encoding="utf-8") != text

    assert status("check", work / "scara.npz", "--robot", other) != 0
    assert "FAIL" in capsys.readouterr().out


def test_the_package_holds_what_a_c_project_needs(work: Path):
    made = {path for path in files_in(work / "scara") if not path.startswith("build/")}

    assert {"CMakeLists.txt", "Makefile", "manifest.json", "README.md", "include/scara/scara.h"} <= made
    assert any(path.endswith(".c") for path in made)


def test_emitting_twice_changes_nothing(work: Path, capsys: pytest.CaptureFixture[str]):
    before = files_in(work / "scara")

    assert status("emit-c", work / "scara.npz", "-o", work / "scara") == 0

    assert "nothing changed" in capsys.readouterr().out
    assert files_in(work / "scara") == before


def test_no_expand_gives_the_same_base_parameters(tmp_path: Path):
    assert status("derive", robot_path("scara"), "--no-expand", "-o", tmp_path / "m.npz") == 0

    with np.load(tmp_path / "m.npz") as file:
        np.testing.assert_allclose(file["theta_b"], bundled_model("scara").theta_b, rtol=1e-12)
        assert file["E"].shape[1] == 0


def test_help_names_every_command():
    done = typed("--help")

    assert done.returncode == 0
    for command in ("derive", "show", "check", "emit-c", "build", "bench", "excite", "simulate", "calibrate"):
        assert command in done.stdout


NAMES = ('a; system("x")', "int", "Gelenk_ü*/ #include", "x" * 300)


def test_names_from_a_file_never_become_code(tmp_path: Path):
    """The robot and its joints are called what an attacker would call them; the package builds, and none of it is code."""
    rows = "".join(
        f"[[joint]]\nname = '{name}'\na = 0.3\nlink = {{ mass = 1.0, com = [0.1, 0.0, 0.0], "
        f"inertia_com = {{ xx = 0.1, yy = 0.1, zz = 0.1, xy = 0.0, xz = 0.0, yz = 0.0 }} }}\n"
        for name in NAMES
    )
    (tmp_path / "robot.toml").write_text(f"name = '{NAMES[0]}'\n{rows}", encoding="utf-8")

    assert status("derive", tmp_path / "robot.toml", "-o", tmp_path / "m.npz") == 0
    assert status("emit-c", tmp_path / "m.npz", "-o", tmp_path / "c", "--functions", "gravity") == 0
    assert status("build", tmp_path / "c") == 0

    for path, content in files_in(tmp_path / "c").items():
        if path.endswith((".c", ".h")):
            code = code_alone(content.decode())
            assert not re.search(r"\bsystem\b", code), path
            assert code.isascii(), path


def code_alone(text: str) -> str:
    """C without its comments and string literals."""
    code, i = [], 0
    while i < len(text):
        if text.startswith("/*", i):
            i = text.index("*/", i) + 2
        elif text.startswith("//", i):
            i = text.index("\n", i)
        elif text[i] in "\"'":
            quote, i = text[i], i + 1
            while text[i] != quote:
                i += 2 if text[i] == "\\" else 1
            i += 1
        else:
            code.append(text[i])
            i += 1
    return "".join(code)


def test_the_version_is_the_installed_one(capsys: pytest.CaptureFixture[str]):
    assert status("--version") == 0
    assert re.fullmatch(r"psdmc \d+\.\d+\.\d+\S*\n", capsys.readouterr().out)
