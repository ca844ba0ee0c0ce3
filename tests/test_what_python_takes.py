"""One name where names are taken, a path where a model is, and only real numbers where arrays are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model, robot_path

import psdmc
from psdmc.errors import InputError
from psdmc.lower.admitted import wanted
from psdmc.real_arrays import real_array


def test_functions_that_are_not_called_are_not_added() -> None:
    """A small arm's step and its Jacobians are a straight line; a Runge-Kutta step calls at any size."""
    robot = bundled_model("scara").mechanism
    assert wanted("semi_implicit_euler_derivatives", robot) == ("semi_implicit_euler_derivatives",)
    assert "forward_dynamics_derivatives" in wanted("rk4_step_derivatives", robot)


def test_a_text_is_one_function() -> None:
    assert wanted("gravity") == wanted(["gravity"]) == ("gravity",)
    assert wanted("all") == wanted(["all"])


def test_an_unknown_function_is_named_whole() -> None:
    with pytest.raises(InputError, match="function 'gravty' is not known"):
        wanted("gravty")


def test_a_text_is_one_frame_and_one_assumption() -> None:
    path = robot_path("rounded_arm")
    tip = bundled_model("rounded_arm").mechanism.tip_name
    assert psdmc.derive(path, frames=tip).content_hash == psdmc.derive(path, frames=[tip]).content_hash
    with pytest.raises(InputError, match="'nothing:mx'"):
        psdmc.derive(path, assume_zero="nothing:mx")


def test_a_text_is_one_adapter(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no adapter 'casady'"):
        psdmc.emit_c(bundled_model("two_link"), tmp_path / "out", adapters="casady")


def test_a_model_file_s_path_is_its_model(tmp_path: Path) -> None:
    model = bundled_model("two_link")
    model.save(tmp_path / "m.npz")
    for path in (tmp_path / "m.npz", str(tmp_path / "m.npz")):
        robot = psdmc.compile(path, functions="gravity")
        assert np.allclose(robot.gravity([0.1, 0.2]), model.gravity([0.1, 0.2]), rtol=1e-12, atol=1e-12)
    assert psdmc.emit_c(tmp_path / "m.npz", tmp_path / "c", functions="gravity")


@pytest.mark.parametrize(
    "call", [psdmc.compile, lambda model: psdmc.emit_c(model, "out"), lambda m: psdmc.calibrate(m, "logs")]
)
def test_what_is_no_model_is_refused_by_name(
    call: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = str(robot_path("kr6"))
    with pytest.raises(InputError, match="a robot's file was given where a model is expected") as caught:
        call(path)
    assert caught.value.hint == f"derive it first: psdmc.derive({path!r})"
    with pytest.raises(InputError, match="an object of the type dict was given where a model is expected"):
        call({})
    for missing in ("nowhere.npz", "nowhere.toml"):
        with pytest.raises(InputError, match=f"{missing}: no such file"):
            call(missing)
    assert not list(tmp_path.iterdir())


def test_a_model_is_no_robot_file() -> None:
    with pytest.raises(InputError, match="a DynamicsModel was given where a robot file's path is expected"):
        psdmc.derive(bundled_model("two_link"))


COMPLEX = np.array([0.1 + 1e-30j, 0.2])


def test_models_and_compiled_robots_refuse_complex_numbers() -> None:
    """Otherwise the imaginary part, as of a complex step, is dropped with a warning at most."""
    model = bundled_model("two_link")
    robot = psdmc.compile(model, functions=["gravity", "inverse_dynamics"])
    for call in (model.gravity, robot.gravity):
        with pytest.raises(InputError, match="q has dtype complex128, expected real numbers"):
            call(COMPLEX)
    with pytest.raises(InputError, match="inverse_dynamics: qdd has dtype complex128"):
        robot.inverse_dynamics([0, 0], [0, 0], list(COMPLEX))
    with pytest.raises(InputError, match="gravity: theta_b has dtype complex128"):
        robot.gravity([0.1, 0.2], theta_b=model.theta_b * 1j)
    with pytest.raises(InputError, match="theta_b has dtype complex128"):
        model.torques_for(model.theta_b * 1j, *np.zeros((3, 2)))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (["1.0", "2.0"], "q has dtype <U3, expected real numbers"),
        (np.array(["2026-01-01"], dtype="M8[D]"), "q has dtype datetime64"),
        ([[1.0], [1.0, 2.0]], "q is no array of numbers"),
        ([1.0, None], "q is no array of numbers"),
        ([1.0, 2j], "q has dtype complex128"),
        (np.array([1.0, 2j], dtype=object), "q is no array of numbers"),
    ],
)
def test_what_is_no_number_is_refused(values: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        real_array("q", values)


@pytest.mark.parametrize(
    "values", [[1, 2], (True, False), np.arange(3, dtype=np.uint8), np.float32(1.5), [np.nan, np.inf]]
)
def test_real_numbers_of_any_kind_are_taken(values: object) -> None:
    found = real_array("q", values, np.float64)
    assert found.dtype == np.float64
    assert np.array_equal(found, np.asarray(values, float), equal_nan=True)


def test_an_array_of_the_right_kind_is_not_copied() -> None:
    given = np.zeros(3)
    assert real_array("q", given) is given
