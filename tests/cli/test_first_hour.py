"""What three new users met in their first hour, typed again."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model
from command_line import typed

import psdmc
from psdmc.backends.manifest import MANIFEST, target_of
from psdmc.errors import InputError
from psdmc.functions import DEFAULT
from psdmc.lower.admitted import wanted
from psdmc.toolchain.build_package import checks_of


def saved(folder: Path, name: str = "two_link") -> Path:
    bundled_model(name).save(folder / "arm.npz")
    return folder / "arm.npz"


def test_a_package_goes_where_its_model_is_called(tmp_path: Path) -> None:
    done = typed("emit-c", saved(tmp_path), "--functions", "gravity", cwd=tmp_path)

    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("arm: ")
    assert (tmp_path / "arm" / MANIFEST).is_file()
    assert "note: the prefix of C names is two_link; --name changes it" in done.stdout
    header = "arm/include/two_link/two_link.h"
    assert f"{header}: the header, #include <two_link/two_link.h>\n" in done.stdout
    assert (tmp_path / "arm" / "include" / "two_link" / "two_link.h").is_file()
    assert done.stderr.splitlines()[-1] == "next: psdmc build arm"


def test_a_folder_of_others_is_refused_before_the_work(tmp_path: Path) -> None:
    saved(tmp_path)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("all of it")

    for where in ("mine", ".", "mine/../mine/.", "/", "mine/thesis.tex"):
        done = typed("emit-c", "arm.npz", "-o", where, "--functions", "gravity", cwd=tmp_path)
        assert done.returncode == 2, done.stdout
        assert re.match(
            r"error: \S+: (psdmc did not write the files in this folder:|cannot be written: Not a dir)",
            done.stderr,
        )
        assert len(done.stderr.splitlines()) == 2, "there was progress"

    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["thesis.tex"]
    done = typed("emit-c", "arm.npz", "-o", "mine", "--functions", "gravity", "--force", cwd=tmp_path)
    assert done.returncode == 0
    assert (tmp_path / "mine" / "thesis.tex").read_text() == "all of it"
    assert (tmp_path / "mine" / MANIFEST).is_file()


def test_what_a_second_emission_removes_and_renames_is_said(tmp_path: Path) -> None:
    saved(tmp_path)
    typed("emit-c", "arm.npz", "--functions", "gravity,jacobian", cwd=tmp_path)
    (tmp_path / "arm" / "README.md").unlink()
    (tmp_path / "arm" / "notes.txt").write_text("mine")

    done = typed("emit-c", "arm.npz", "--functions", "gravity", "--name", "elbow", cwd=tmp_path)

    removed = next(line for line in done.stdout.splitlines() if ": removed, " in line)
    assert removed.startswith("arm: removed, because the package no longer has them: ")
    assert {"src/jacobian.c", "include/two_link/two_link.h"} <= set(removed.split(": ")[2].split(", "))
    assert not (tmp_path / "arm" / "src" / "jacobian.c").exists()
    assert "note: two_link_* of the old package is now called elbow_*\n" in done.stdout
    assert (tmp_path / "arm" / "notes.txt").read_text() == "mine"


def test_a_package_of_another_robot_is_replaced_with_a_line_about_it(tmp_path: Path) -> None:
    saved(tmp_path)
    bundled_model("scara").save(tmp_path / "other.npz")
    models = (["arm.npz"], ["arm.npz", "--name", "elbow"], ["arm.npz"], ["other.npz"], ["other.npz"])
    words = ["-o", "c", "--functions", "gravity"]
    said = [typed("emit-c", *model, *words, cwd=tmp_path).stdout for model in models]

    line = "note: the package of robot 'two_link' (2 joints) is replaced by that of 'scara' (4 joints)\n"
    assert [text.count("is replaced by") for text in said] == [0, 0, 0, 1, 0]
    assert line in said[3]


@pytest.mark.parametrize("given", ["", ",", " "])
def test_no_function_is_not_the_default_set(given: str, tmp_path: Path) -> None:
    done = typed("emit-c", saved(tmp_path), "--functions", given, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(
        "error: no function is named\nhint: give default, all, or names such as inverse_dynamics, "
    )
    assert not (tmp_path / "arm").exists()


@pytest.mark.parametrize("more", [(), ("-o", "other.npz")])
def test_a_model_is_no_robot_file(tmp_path: Path, more: tuple[str, ...]) -> None:
    saved(tmp_path)

    done = typed("derive", "arm.npz", *more, cwd=tmp_path)

    assert done.returncode == 2
    assert done.stderr.splitlines()[0] == "error: arm.npz: a model, which is derived already"
    assert not (tmp_path / "other.npz").exists()


def test_a_packed_file_is_no_robot_file(tmp_path: Path) -> None:
    shutil.copy(saved(tmp_path), tmp_path / "arm.urdf")
    with pytest.raises(InputError, match=r"arm\.urdf: a packed file, as models are") as refused:
        psdmc.derive(tmp_path / "arm.urdf")
    assert "URDF" in str(refused.value.hint)


@pytest.mark.parametrize(
    ("word", "hint"),
    [
        ("inverse_dynamic", "inverse_dynamics"),
        ("forward-dynamics", "forward_dynamics"),
        ("Jacobian", "jacobian"),
        ("defaults", "default"),
    ],
)
def test_a_mistyped_function_is_guessed(word: str, hint: str) -> None:
    with pytest.raises(InputError, match="is not known") as refused:
        wanted([word])
    assert str(refused.value.hint).startswith(f"do you mean {hint}")


def test_a_function_like_none_gets_the_default_functions_and_a_page() -> None:
    with pytest.raises(InputError) as refused:
        wanted(["qwxz"])
    assert set(DEFAULT) <= set(str(refused.value.hint).replace(",", "").replace(";", "").split())
    assert "the page Functions of the documentation lists all" in str(refused.value.hint)


def test_building_says_what_was_checked_and_the_next_command_needs_no_rights(tmp_path: Path) -> None:
    saved(tmp_path)
    typed("emit-c", "arm.npz", "--functions", "gravity", cwd=tmp_path)

    done = typed("build", "arm", cwd=tmp_path)

    assert "arm: built, self-test passed (5 checks of 2 functions)" in done.stdout
    words = done.stderr.splitlines()[-1].removeprefix("next: ")
    home = os.environ | {"HOME": str(tmp_path / "home")}
    subprocess.run(words, shell=True, check=True, cwd=tmp_path, env=home)
    assert list((tmp_path / "home" / ".local").rglob("libtwo_link.a"))


def test_a_boards_package_is_compiled_for_the_board_next(tmp_path: Path) -> None:
    saved(tmp_path)
    typed("emit-c", "arm.npz", "--functions", "gravity", "--target", "cortex-m4f", cwd=tmp_path)

    done = typed("build", "arm", cwd=tmp_path)

    words = done.stderr.splitlines()[-1].removeprefix("next: ")
    assert shlex.split(words)[:3] == ["BUILD=board", "CC=arm-none-eabi-gcc", "AR=arm-none-eabi-ar"]
    if shutil.which("arm-none-eabi-gcc"):
        subprocess.run(words, shell=True, check=True, cwd=tmp_path, capture_output=True)
        assert (tmp_path / "arm" / "board" / "libtwo_link.a").is_file()


@pytest.mark.parametrize(
    "text",
    ["", "[]", '{"generator": "psdmc", "target": 3}', '{"generator": "psdmc", "target": {"name": []}}'],
)
def test_a_manifest_that_names_no_machine(text: str, tmp_path: Path) -> None:
    (tmp_path / MANIFEST).write_text(text, encoding="utf-8")
    assert target_of(tmp_path) is None


def test_a_build_without_a_self_test_claims_none() -> None:
    assert checks_of("two_link: emitted without reference states, nothing to check") == "nothing to check"
    assert checks_of("1: arm: 39 checks of 15 functions, 0 failed") == "39 checks of 15 functions"


def test_a_robot_without_parameters_lists_its_functions_and_says_what_it_wants() -> None:
    model = bundled_model("two_link")
    robot = psdmc.compile(replace(model, theta_b=None), functions="gravity")
    q = np.array([0.3, 0.4])

    assert robot.functions == ("gravity",)
    np.testing.assert_allclose(robot.gravity(q, model.theta_b), model.gravity(q), rtol=1e-12)
    for given in ((), (None,)):
        with pytest.raises(
            InputError, match="gravity wants parameters, and this model's theta_b is unknown"
        ) as said:
            robot.gravity(q, *given)
        assert "theta_b=, 4 numbers" in str(said.value.hint)
