"""Calls without a detour through Python: same results bit for bit, same errors, nothing leaked, never required."""

from __future__ import annotations

import gc
import inspect
import sys
import sysconfig
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bundled import robot_path
from other_threads import counted_during
from traced import N, arm_kernels, arm_package, arm_references
from unoptimised import compiled, without_optimisation

import psdmc
from psdmc.backends.info import EmitOptions
from psdmc.errors import InputError
from psdmc.toolchain import direct_calls as module
from psdmc.toolchain.call import CompiledRobot
from psdmc.toolchain.direct_calls import direct_calls
from psdmc.toolchain.interface import interface_of

pytestmark = pytest.mark.skipif(direct_calls().make is None, reason=direct_calls().reason)

FUNCTIONS = {name: kernel.function for name, kernel in arm_kernels().items() if not kernel.theta}
RANDOM = np.random.default_rng(7)


def new_robot(real: str = "float64") -> CompiledRobot:
    package = arm_package(options=EmitOptions(real=real))
    return CompiledRobot(interface_of(package), compiled(package, optimised=False))


@pytest.fixture(scope="module", params=["float64", "float32"])
def robot(request: pytest.FixtureRequest) -> CompiledRobot:
    return new_robot(request.param)


def slow(robot: CompiledRobot, name: str):
    """The method that Python has, which goes through cffi."""
    return getattr(type(robot), name).__get__(robot)


def given(robot: CompiledRobot, name: str, *lead: int) -> list[np.ndarray]:
    sizes = robot._sizes
    return [
        RANDOM.normal(size=(*lead, *sizes.shape(quantity.axes))).astype(robot.dtype)
        for quantity in FUNCTIONS[name].inputs
    ]


def is_direct(call: object) -> bool:
    return type(call).__name__ == "DirectCall"


@pytest.mark.parametrize("lead", [(), (1,), (3,), (70,), (2, 3), (0,), (5, 0)], ids=str)
@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_gives_the_same_bits(robot: CompiledRobot, name: str, lead: tuple[int, ...]) -> None:
    states = given(robot, name, *lead)
    call = getattr(robot, name)
    assert is_direct(call)

    found, expected = call(*states), slow(robot, name)(*states)

    assert (found.dtype, found.shape) == (expected.dtype, expected.shape)
    assert np.array_equal(found, expected, equal_nan=True)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_results_go_where_the_caller_says(robot: CompiledRobot, name: str) -> None:
    states = given(robot, name, 4)
    expected = getattr(robot, name)(*states)
    for call in (getattr(robot, name), slow(robot, name)):
        out = np.full_like(expected, 99.0)
        assert call(*states, out=out) is out
        assert np.array_equal(out, expected)
        assert np.array_equal(call(*states, out=None), expected)


def detours(robot: CompiledRobot, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The functions that are called through Python from now on."""
    seen: list[str] = []
    whole = CompiledRobot.call

    def recorded(self: CompiledRobot, function: Any, *given: Any) -> Any:
        seen.append(function.name)
        return whole(self, function, *given)

    monkeypatch.setattr(CompiledRobot, "call", recorded)
    return seen


@pytest.mark.parametrize("lead", [(), (3,), (70,), (0,)], ids=str)
@pytest.mark.parametrize("name", [name for name in FUNCTIONS if f"{name}_theta" in arm_kernels()])
def test_parameters_at_run_time_give_the_same_bits_without_a_detour(
    robot: CompiledRobot, name: str, lead: tuple[int, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    states, call = given(robot, name, *lead), getattr(robot, name)
    theta = (1.1 * robot.theta_b).astype(robot.dtype)
    expected = slow(robot, name)(*states, theta_b=theta)
    seen = detours(robot, monkeypatch)

    out = np.empty_like(expected)
    found = [call(*states, theta), call(*states, theta_b=theta), call(*states, out=out, theta_b=theta)]

    assert seen == []
    assert found[2] is out
    assert all(np.array_equal(one, expected, equal_nan=True) for one in found)


def test_parameters_that_c_cannot_read_take_the_other_way(robot: CompiledRobot) -> None:
    states = given(robot, "inverse_dynamics", 4)
    theta = robot.theta_b.astype(robot.dtype)
    expected = slow(robot, "inverse_dynamics")(*states, theta)
    for same in (theta.tolist(), np.repeat(theta, 2)[::2], theta.astype(np.longdouble)):
        assert np.array_equal(robot.inverse_dynamics(*states, same), expected)
    assert np.array_equal(robot.inverse_dynamics(*states, None), robot.inverse_dynamics(*states))
    with pytest.raises(InputError, match=r"theta_b has shape \(2,\)"):
        robot.inverse_dynamics(*states, theta[:2])
    with pytest.raises(InputError, match="theta_b"):
        robot.inverse_dynamics(*states, theta[None, :2])
    with pytest.raises(TypeError, match=r"inverse_dynamics\(\)"):
        robot.inverse_dynamics(*states, theta, theta_b=theta)
    with pytest.raises(TypeError, match=r"jacobian\(\)"):
        robot.jacobian(states[0], None)


def test_out_may_lie_across_the_parameters(robot: CompiledRobot) -> None:
    states = given(robot, "inverse_dynamics", 4)
    memory = np.zeros(4 * N + robot.l, robot.dtype)
    theta, out = memory[: robot.l], memory[: 4 * N].reshape(4, N)
    theta[:] = robot.theta_b
    expected = slow(robot, "inverse_dynamics")(*states, theta.copy())

    robot.inverse_dynamics(*states, theta, out=out)

    assert np.array_equal(out, expected)


def test_out_may_be_an_input_or_lie_across_inputs(robot: CompiledRobot) -> None:
    states = given(robot, "inverse_dynamics", 9)
    expected = robot.inverse_dynamics(*states)
    for k in range(3):
        copies = [array.copy() for array in states]
        robot.inverse_dynamics(*copies, out=copies[k])
        assert np.array_equal(copies[k], expected)
    memory = np.empty((30, N), robot.dtype)
    for shift in (-1, 0, 1, 5):
        memory[10:19] = states[0]
        out = memory[10 + shift : 19 + shift]
        robot.inverse_dynamics(memory[10:19], *states[1:], out=out)
        assert np.array_equal(out, expected)


def test_out_may_have_strides(robot: CompiledRobot) -> None:
    states = given(robot, "inverse_dynamics", 5)
    memory = np.zeros((5, 2 * N), robot.dtype)
    robot.inverse_dynamics(*states, out=memory[:, ::2])
    assert np.array_equal(memory[:, ::2], robot.inverse_dynamics(*states))
    assert not memory[:, 1::2].any()


def read_only(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array


@pytest.mark.parametrize(
    ("out", "message"),
    [
        (lambda real: np.zeros((4, N + 1), real), r"out for tau has shape \(4, 5\), expected \(4, 4\)"),
        (lambda real: np.zeros(N, real), r"out for tau has shape \(4,\), expected \(4, 4\)"),
        (lambda real: np.zeros((4, N), int), "out for tau has dtype int64, expected float"),
        (lambda real: [[0.0] * N] * 4, "out for tau is a list, expected an array"),
        (lambda real: read_only(np.zeros((4, N), real)), "out for tau is read-only"),
    ],
)
def test_an_out_that_does_not_fit_is_refused_and_left_alone(robot: CompiledRobot, out, message: str) -> None:
    array = out(robot.dtype)
    for call in (robot.inverse_dynamics, slow(robot, "inverse_dynamics")):
        with pytest.raises(InputError, match=f"inverse_dynamics: {message}"):
            call(*given(robot, "inverse_dynamics", 4), out=array)
    assert not np.any(array)


@pytest.mark.parametrize(
    "change",
    [
        lambda q: q.tolist(),
        lambda q: q[::-1],
        lambda q: np.asfortranarray(q),
        lambda q: q.astype(q.dtype.newbyteorder()),
        lambda q: q.astype(np.float16),
        lambda q: np.round(10 * q).astype(int),
        lambda q: q[None],
        lambda q: q[0],
        lambda q: q.view(np.matrix),
        lambda q: np.ma.masked_array(q),
        lambda q: np.frombuffer(b"\0" + q.tobytes(), np.uint8)[1:].view(q.dtype).reshape(q.shape),
    ],
)
def test_what_c_cannot_read_takes_the_other_way(robot: CompiledRobot, change) -> None:
    q, qd = given(robot, "nonlinear_effects", 6)
    expected = slow(robot, "nonlinear_effects")(change(q), qd)
    assert np.array_equal(robot.nonlinear_effects(change(q), qd), expected)
    assert np.array_equal(robot.nonlinear_effects(np.array(change(q), robot.dtype), qd), expected)


def test_names_and_parameters_are_taken_as_ever(robot: CompiledRobot) -> None:
    q, qd = given(robot, "nonlinear_effects", 2)
    theta = robot.theta_b.astype(robot.dtype)
    expected = slow(robot, "nonlinear_effects")(q, qd, theta)
    assert np.array_equal(robot.nonlinear_effects(qd=qd, q=q), robot.nonlinear_effects(q, qd))
    for found in (robot.nonlinear_effects(q, qd, theta), robot.nonlinear_effects(q, qd, theta_b=theta)):
        assert np.array_equal(found, expected)
    out = np.empty_like(expected)
    assert robot.nonlinear_effects(q, qd, theta, out=out) is out
    assert np.array_equal(out, expected)


@pytest.mark.parametrize(
    "call", [lambda r: r.gravity(), lambda r: r.gravity([0] * N, 1, 2), lambda r: r.gravity([0] * N, speed=1)]
)
def test_wrong_arguments_are_type_errors_that_name_the_function(robot: CompiledRobot, call) -> None:
    with pytest.raises(TypeError, match=r"gravity\(\)"):
        call(robot)


def test_a_nan_stays_one_state_s() -> None:
    robot = new_robot()
    one = arm_references(3).given
    q, qd, tau = (one[name].copy() for name in ("q", "qd", "tau"))
    q[1, 0] = np.nan
    found = robot.forward_dynamics(q, qd, tau)
    assert np.isnan(found[1]).all()
    assert np.isfinite(found[[0, 2]]).all()
    assert np.isnan(robot.forward_dynamics(q[1], qd[1], tau[1])).all()


def test_a_call_is_described_as_the_method_that_it_is(robot: CompiledRobot) -> None:
    call = robot.inverse_dynamics
    assert call.__name__ == "inverse_dynamics"
    assert call.__self__ is robot
    assert str(inspect.signature(call)) == "(q, qd, qdd, theta_b=None, *, gravity=None, out=None)"
    assert "\nqdd      (..., nv) joint accelerations, rad/s^2" in call.__doc__
    assert "\ntau  (..., nv) joint torques" in call.__doc__.split("Returns an array:")[1]
    assert callable(call)


def test_robots_that_nobody_holds_go_and_functions_keep_theirs() -> None:
    robot = new_robot()
    call, gone = robot.gravity, weakref.ref(robot)
    del robot
    gc.collect()
    assert gone() is not None
    assert call(np.zeros(N)).shape == (N,)
    del call
    gc.collect()
    assert gone() is None


def test_nothing_is_leaked(robot: CompiledRobot) -> None:
    q = np.zeros(N, robot.dtype)
    out = np.empty(N, robot.dtype)
    theta = robot.theta_b.astype(robot.dtype)

    def calls() -> None:
        for _ in range(1000):
            robot.gravity(q)
            robot.gravity(q, out=out)
            robot.gravity(q, theta, out=out)
            robot.gravity(q, theta_b=theta)
            with pytest.raises(InputError):
                robot.gravity(q, out=q[:1])

    def counts() -> tuple[int, ...]:
        held = (q, out, robot.gravity, theta)
        references = [sys.getrefcount(one) for one in held]
        return (*references, sys.getallocatedblocks())

    calls()
    before = counts()
    calls()
    after = counts()
    assert after[:4] == before[:4]
    assert after[4] - before[4] < 200


def test_other_threads_run_during_a_call_for_many_states() -> None:
    robot = new_robot()
    q = RANDOM.normal(size=(100_000, N))
    out = np.empty((len(q), N, N))
    during = counted_during(lambda: robot.coriolis_matrix(q, q, out=out))
    assert during > 10, "with the GIL held there is at most one"


@pytest.fixture
def looked_for_again():
    module._found.cache_clear()
    yield
    module._found.cache_clear()


def test_without_headers_everything_works(
    looked_for_again: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    expected = new_robot().gravity(np.ones(N))
    monkeypatch.setattr(sysconfig, "get_path", lambda name: str(tmp_path))
    module._found.cache_clear()
    robot = new_robot()
    assert direct_calls().make is None
    assert direct_calls().reason == f"no Python.h in {tmp_path}"
    assert direct_calls().remedy == "apt install python3-dev"
    assert not is_direct(robot.gravity)
    assert np.array_equal(robot.gravity(np.ones(N)), expected)


def test_headers_that_do_not_compile_are_no_error(
    looked_for_again: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "Python.h").write_text("#error these are not the headers\n")
    monkeypatch.setattr(sysconfig, "get_path", lambda name: str(tmp_path))
    module._found.cache_clear()
    assert direct_calls().make is None
    assert "these are not the headers" in direct_calls().reason
    assert new_robot().gravity(np.ones(N)).shape == (N,)


def test_the_variable_turns_them_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PSDMC_DIRECT_CALLS", "0")
    assert not is_direct(new_robot().gravity)


def test_the_module_is_kept_and_sealed_like_any_library(compile_cache: Path) -> None:
    library = module._library(Path(sysconfig.get_path("include")))
    assert library.parent.parent == compile_cache
    assert module._library(Path(sysconfig.get_path("include"))) == library
    good = library.read_bytes()
    library.unlink()  # a new file: this process has the old one open
    library.write_bytes(good[: len(good) // 2])
    assert module._library(Path(sysconfig.get_path("include"))).read_bytes()[:4] == b"\x7fELF"
    assert len(library.read_bytes()) > len(good) // 2


@pytest.fixture(scope="module")
def floating() -> CompiledRobot:
    with without_optimisation():
        model = psdmc.derive(robot_path("rounded_arm"), floating=True)
        return psdmc.compile(model, functions=["gravity", "difference"])


def test_quaternions_of_length_one_are_direct_and_others_refused_as_ever(floating: CompiledRobot) -> None:
    q = np.concatenate(
        [RANDOM.normal(size=(5, 3)), [[0.0, 0.6, 0.0, 0.8]] * 5, RANDOM.normal(size=(5, floating.nq - 7))], 1
    )
    assert is_direct(floating.gravity)
    assert np.array_equal(floating.gravity(q), slow(floating, "gravity")(q))
    assert np.array_equal(floating.difference(q, q[::-1].copy()), slow(floating, "difference")(q, q[::-1]))
    q[3, 3:7] *= 1.0 + 1e-5
    for call in (floating.gravity, slow(floating, "gravity")):
        with pytest.raises(InputError, match=r"gravity: q\[3:7\] of row 3 has length 1\.00001"):
            call(q)
    for bad in (np.nan, np.inf, 0.0):
        with pytest.raises(InputError, match=r"gravity: q\[3:7\] has length"):
            floating.gravity(np.where(np.arange(floating.nq) == 6, bad, q[0]))
    with pytest.raises(InputError, match="difference: "):
        floating.difference(q[0], q[3])
