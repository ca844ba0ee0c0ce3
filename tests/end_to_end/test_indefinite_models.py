"""A model whose mass matrix is no robot's: check, emit-c and compile say so, and nothing is dropped without a word."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from bundled import bundled_model
from command_line import status

import psdmc
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel


def indefinite() -> DynamicsModel:
    model = bundled_model("two_link")
    assert model.theta_b is not None
    return replace(model, theta_b=-model.theta_b)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    indefinite().save(tmp_path / "bad.npz")
    return tmp_path / "bad.npz"


def test_check_fails_and_names_poses_and_eigenvalue(file: Path, capsys: pytest.CaptureFixture[str]):
    assert status("check", file) == 5

    said = capsys.readouterr().out
    assert "FAIL: the mass matrix is not positive definite in " in said
    assert " of 2,000 poses within the joint limits; smallest eigenvalue -" in said


def test_emit_c_fails_with_the_reason_of_check(
    file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    assert status("emit-c", file, "-o", tmp_path / "c") == 2

    said = capsys.readouterr().err
    assert "no forward_dynamics: the mass matrix is not positive definite in " in said
    assert "--functions inverse_dynamics,mass_matrix" in said
    assert not (tmp_path / "c").exists()


def test_without_forward_dynamics_it_is_emitted_and_builds(file: Path, tmp_path: Path):
    wanted = "inverse_dynamics,mass_matrix"

    assert status("emit-c", file, "-o", tmp_path / "c", "--functions", wanted) == 0
    assert status("build", tmp_path / "c") == 0


def test_compile_fails_likewise():
    with pytest.raises(InputError, match="not positive definite in ") as caught:
        psdmc.compile(indefinite())
    assert caught.value.hint is not None
    assert "--functions" in caught.value.hint


def test_show_says_what_it_leaves_out(file: Path, capsys: pytest.CaptureFixture[str]):
    assert status("show", file, "--cost") == 0

    assert "note: forward_dynamics is left out: the mass matrix is not positive" in capsys.readouterr().out


def test_unknown_parameters_are_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    replace(bundled_model("two_link"), theta_b=None).save(tmp_path / "unknown.npz")

    assert status("emit-c", tmp_path / "unknown.npz", "-o", tmp_path / "c") == 0

    said = capsys.readouterr().out
    assert "so functions take theta_b as an argument: inverse_dynamics_theta, forward_dynamics_theta" in said
    assert status("check", tmp_path / "unknown.npz") == 0
    assert "mass matrix: not tested" in capsys.readouterr().out
