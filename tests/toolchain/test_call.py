"""A compiled robot from Python: broadcasting, precisions, threads, and what it says to wrong shapes."""

from __future__ import annotations

import numpy as np
import pytest
from direct import error, expected
from other_threads import counted_during
from traced import SIZES, L, N, arm_kernels, arm_package, arm_references
from unoptimised import compiled

from psdmc.backends.info import EmitOptions
from psdmc.errors import InputError
from psdmc.toolchain.call import CompiledRobot
from psdmc.toolchain.compile import compile_library
from psdmc.toolchain.interface import interface_of

KERNELS = arm_kernels()
RANDOM = np.random.default_rng(11)


@pytest.fixture(scope="module", params=["direct", "through cffi"])
def robot(request: pytest.FixtureRequest) -> CompiledRobot:
    """The same robot with direct calls and without: nothing but time may differ."""
    package = arm_package()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PSDMC_DIRECT_CALLS", "1" if request.param == "direct" else "0")
        return CompiledRobot(interface_of(package), compiled(package, optimised=False))


@pytest.mark.parametrize("name", [name for name, kernel in KERNELS.items() if not kernel.theta])
def test_every_function_broadcasts_like_a_ufunc(robot: CompiledRobot, name: str) -> None:
    function = KERNELS[name].function
    shapes = [(3, 1, N), (5, N), (N,), (1, 1, N)][: len(function.inputs)]
    given = {q.name: RANDOM.normal(size=shape) for q, shape in zip(function.inputs, shapes, strict=True)}
    leading = np.broadcast_shapes(*shapes)[:-1]
    tail = SIZES.shape(function.outputs[0].axes)

    found = getattr(robot, name)(*given.values())

    assert found.shape == (*leading, *tail)
    assert found.dtype == np.float64
    reference = expected(KERNELS[name], given, N, L)
    assert error(found.reshape(reference.shape), reference) < 1e-12


@pytest.mark.parametrize("name", [kernel.function.name for kernel in KERNELS.values() if kernel.theta])
def test_parameters_may_be_given(robot: CompiledRobot, name: str) -> None:
    function = KERNELS[name].function
    given = {q.name: RANDOM.normal(size=(4, N)) for q in function.inputs}
    parameters = np.array([p.value for p in arm_package().info.parameters])

    baked = getattr(robot, name)(*given.values())

    assert np.allclose(
        getattr(robot, name)(*given.values(), theta_b=parameters), baked, rtol=1e-10, atol=1e-10
    )
    assert not np.allclose(getattr(robot, name)(*given.values(), theta_b=parameters * 2 + 1), baked)


def test_inverse_undoes_forward(robot: CompiledRobot) -> None:
    given = arm_references(50).given
    q, qd, qdd, tau = (given[name] for name in ("q", "qd", "qdd", "tau"))
    assert np.allclose(robot.forward_dynamics(q, qd, tau), qdd, rtol=1e-9, atol=1e-9)
    assert np.allclose(robot.inverse_dynamics(q, qd, qdd), tau, rtol=1e-12, atol=1e-10)


def test_lists_strides_and_integers_are_taken(robot: CompiledRobot) -> None:
    q = np.arange(2.0 * N).reshape(N, 2).T
    assert np.array_equal(robot.gravity(q), robot.gravity(q.copy()))
    assert np.array_equal(robot.gravity([1, 2, 3, 4]), robot.gravity(np.array([1.0, 2.0, 3.0, 4.0])))


def test_no_states_give_no_results(robot: CompiledRobot) -> None:
    assert robot.mass_matrix(np.zeros((0, N))).shape == (0, N, N)


def test_inputs_are_never_written(robot: CompiledRobot) -> None:
    q = RANDOM.normal(size=(9, N))
    before = q.copy()
    q.setflags(write=False)
    robot.inverse_dynamics(q, q, q)
    assert np.array_equal(q, before)


def test_single_precision_gives_single_precision() -> None:
    package = arm_package(options=EmitOptions(real="float32"), names=["gravity"])
    robot = CompiledRobot(interface_of(package), compile_library(package))
    q = RANDOM.normal(size=(20, N))
    found = robot.gravity(q)
    assert found.dtype == np.float32
    assert error(found, expected(KERNELS["gravity"], {"q": q}, N, L)) < 1e-4


def test_other_threads_run_during_a_call(robot: CompiledRobot) -> None:
    q = RANDOM.normal(size=(300_000, N))
    out = np.empty((len(q), N * N))
    arguments = [robot._address(array) for array in (q, q, out)]
    during = counted_during(lambda: robot._library.test_arm_coriolis_matrix_batch(len(q), *arguments))
    assert during > 10, "with the GIL held there is at most one"


def test_a_wrong_number_of_joints_names_the_joints(robot: CompiledRobot) -> None:
    with pytest.raises(
        InputError, match=r"inverse_dynamics: qd has shape \(3, 5\), expected \(\.\.\., 4\)"
    ) as caught:
        robot.inverse_dynamics(np.zeros(N), np.zeros((3, 5)), np.zeros(N))
    assert caught.value.hint == f"the robot has {N} joints: joint 0, joint 1, joint 2, joint 3"


def test_a_scalar_is_no_state(robot: CompiledRobot) -> None:
    with pytest.raises(InputError, match=r"gravity: q has shape \(\), expected"):
        robot.gravity(1.0)


def test_shapes_that_do_not_broadcast_are_all_named(robot: CompiledRobot) -> None:
    with pytest.raises(InputError, match=r"do not broadcast: q \(3, 4\), qd \(2, 4\)"):
        robot.nonlinear_effects(np.zeros((3, N)), np.zeros((2, N)))


def test_a_wrong_number_of_parameters_is_said(robot: CompiledRobot) -> None:
    with pytest.raises(InputError, match=rf"gravity: theta_b has shape \(3,\), expected \({L},\)"):
        robot.gravity(np.zeros(N), theta_b=np.zeros(3))


def test_a_function_that_was_not_compiled_is_said() -> None:
    package = arm_package(names=["gravity"])
    robot = CompiledRobot(interface_of(package), compile_library(package))
    with pytest.raises(AttributeError) as unknown:
        robot.mass_matrx  # noqa: B018
    assert str(unknown.value) == (
        "CompiledRobot has no function 'mass_matrx'; do you mean mass_matrix or mass_matrix_packed or mass_matrix_inverse?"
    )
    assert "mass_matrix" in dir(robot)
    assert not hasattr(robot, "zzz")
    with pytest.raises(AttributeError, match=r"has no function 'zzz'; dir\(robot\) lists all$"):
        robot.zzz  # noqa: B018
    with pytest.raises(InputError, match="mass_matrix was not compiled") as caught:
        robot.mass_matrix(np.zeros(N))
    assert caught.value.hint == (
        "add 'mass_matrix' to the argument functions of psdmc.compile; compiled are gravity, gravity_theta"
    )
