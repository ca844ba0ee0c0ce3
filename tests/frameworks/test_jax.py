"""Robots as functions of JAX: transformations, derivatives against Pinocchio's, and refusals."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import cache, partial
from typing import Any

import numpy as np
import pytest
from differentiated import (
    QUICK,
    ROBOTS,
    RULED,
    Array,
    differentiated,
    near,
    on_its_sole,
    pulled,
    torques_of_gravity,
    weighed,
)
from slow_cases import slow_but_for
from unoptimised import without_optimisation

import psdmc
from psdmc.errors import InputError
from psdmc.frameworks.differentiation import ArgumentError, require_rule
from psdmc.functions import RECIPES, SIGNATURES

jax = pytest.importorskip("jax")
jnp = jax.numpy
check_grads = pytest.importorskip("jax.test_util").check_grads

energy_of = RECIPES["potential_energy"].pinocchio

EXACT, SOLVED = 1e-10, 1e-8
"""Of each Jacobian's largest entry; SOLVED where the mass matrix is inverted, and its condition comes in."""

COUNT = 4


@pytest.fixture(autouse=True)
def doubles() -> Iterator[None]:
    with jax.enable_x64(True), without_optimisation():
        yield


@cache
def robot_of(name: str, real: Any = None) -> Any:
    return psdmc.jax(differentiated(name).model, real=real)


def state(name: str, function: str = "forward_dynamics") -> list[Array]:
    """Inputs at one state."""
    inputs, _ = differentiated(name).drawn(SIGNATURES[function], 1)
    return [x[0] for x in inputs]


def of_entries(name: str, q: Array, along_tangent: Array) -> Array:
    """(..., nq) derivatives by the entries of q, from Pinocchio's (..., nv) along the tangent: with a floating base
    d tangent / dq is [R^T, 0; 0, 2 (vector part of conj(quaternion) times dq)], zero along the quaternion."""
    if name not in ("hopper", "hyq"):
        return along_tangent
    x, y, z, w = q[3:7]
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    twice = 2.0 * np.array([[w, z, -y, -x], [-z, w, x, -y], [y, -x, w, -z]])
    tangent = np.zeros((len(q) - 1, len(q)))
    tangent[:3, :3], tangent[3:6, 3:7], tangent[6:, 7:] = turn.T, twice, np.eye(len(q) - 7)
    return along_tangent @ tangent


@pytest.mark.parametrize("mode", ["jacfwd", "jacrev"])
@pytest.mark.parametrize("name", slow_but_for(QUICK, ROBOTS))
def test_jacobians_are_pinocchios(name: str, mode: str) -> None:
    """Of inverse and forward dynamics, by every input, jitted."""
    own, robot = differentiated(name), robot_of(name)
    q, qd, tau = state(name)
    qdd = own.pinocchio.forward_dynamics(q, qd, tau)
    _, *accelerations = own.pinocchio.forward_dynamics_derivatives(q, qd, tau)
    torques = own.pinocchio.inverse_dynamics_derivatives(q, qd, qdd)
    for function, given, blocks, limit in (
        (robot.inverse_dynamics, (q, qd, qdd), torques, EXACT),
        (robot.forward_dynamics, (q, qd, tau), accelerations, SOLVED if name == "hyq" else EXACT),
    ):
        found = jax.jit(getattr(jax, mode)(function, (0, 1, 2)))(*given)
        for own_block, expected in zip(found, (of_entries(name, q, blocks[0]), *blocks[1:]), strict=True):
            assert near(own_block, expected, limit)


@pytest.mark.parametrize(
    ("name", "function"),
    slow_but_for(
        [("hopper", f) for f in RULED if "step" not in f],
        [(r, f) for r in ROBOTS for f in RULED],
        spread=True,
    ),
)
def test_every_ruled_function_has_both_modes(name: str, function: str) -> None:
    """Along the tangent of q against Pinocchio's slopes; the gradient is the transpose of that."""
    own, robot, signature = differentiated(name), robot_of(name), SIGNATURES[function]
    inputs, ways = own.drawn(signature, COUNT)
    expected = own.slopes(signature, inputs, ways)
    entries = [
        own.pinocchio.coordinate_rates(q, way) if k == 0 else way
        for k, (q, way) in enumerate(zip(inputs, ways, strict=True))
    ]
    fixed = require_rule(function).constant
    moving = [k for k, quantity in enumerate(signature.inputs) if quantity.name not in fixed]
    entries = [entries[k] for k in moving]

    def values(*given: Any) -> list[Any]:
        known = dict(enumerate(inputs)) | dict(zip(moving, given, strict=True))
        return jax.tree.leaves(getattr(robot, function)(*(known[k] for k in range(len(inputs)))))

    given = tuple(inputs[k] for k in moving)
    found, along = jax.jit(lambda x, v: jax.jvp(values, x, v))(given, tuple(entries))
    outputs = jax.tree.leaves(getattr(robot.compiled, function)(*inputs))
    for k, (value, slope) in enumerate(zip(along, expected, strict=True)):
        if signature.outputs[k].axes == ("nq",):
            slope = own.pinocchio.coordinate_rates(outputs[k], slope)
        assert near(found[k], outputs[k], 1e-12)
        assert near(value, slope, SOLVED * 10)
    rng = np.random.default_rng(5)
    weights = [rng.normal(size=x.shape) for x in outputs]
    _, back = jax.vjp(values, *given)
    gradients = back(weights)
    forward = sum(float((w * a).sum()) for w, a in zip(weights, along, strict=True))
    assert float(sum((g * e).sum() for g, e in zip(gradients, entries, strict=True))) == pytest.approx(
        forward, rel=1e-10
    )


@pytest.mark.parametrize("mode", ["jacfwd", "jacrev"])
@pytest.mark.parametrize("name", slow_but_for(["scara"], ["scara", "hopper", "kr6"]))
def test_gravity_has_its_own_gradient(name: str, mode: str) -> None:
    """Results under another gravity are Pinocchio's, and derivatives by gravity and the other inputs, jitted and vmapped."""
    robot, q, qd, tau = psdmc.jax(weighed(name), gravity_input=True), *state(name)
    gravity = np.array([1.0, -3.0, -8.0])
    turned, by_gravity = pulled(name, gravity), torques_of_gravity(name, q)
    qdd, by_q, by_qd, inverse = turned.forward_dynamics_derivatives(q, qd, tau)
    blocks = (of_entries(name, q, by_q), by_qd, inverse, -inverse @ by_gravity)

    def forward(q: Any, qd: Any, tau: Any, gravity: Any) -> Any:
        return robot.forward_dynamics(q, qd, tau, gravity=gravity)

    jacobian = getattr(jax, mode)(forward, (0, 1, 2, 3))
    assert near(jax.jit(forward)(q, qd, tau, gravity), qdd, EXACT)
    for found, expected in zip(jax.jit(jacobian)(q, qd, tau, gravity), blocks, strict=True):
        assert near(found, expected, EXACT)
    many = jax.jit(jax.vmap(jacobian, (None, None, None, 0)))(q, qd, tau, jnp.stack([2.0 * gravity, gravity]))
    assert near(many[3][1], blocks[3], EXACT)

    def torques(gravity: Any) -> Any:
        return robot.inverse_dynamics(q, qd, qdd, robot.compiled.theta_b, gravity=gravity)

    assert near(torques(gravity), tau, EXACT)
    assert near(getattr(jax, mode)(torques)(gravity), by_gravity, EXACT)
    energy = jax.grad(lambda gravity: robot.potential_energy(q, gravity=gravity))(gravity)
    energies = [energy_of(pulled(name, unit), {"q": q[None]})["U"][0] for unit in np.eye(3)]
    assert near(energy, np.array(energies), EXACT)
    assert near(robot.gravity(q), differentiated(name).pinocchio.gravity(q), EXACT)  # that of the file


def test_gravity_where_it_is_no_input() -> None:
    robot, q = psdmc.jax(weighed("scara"), gravity_input=True), jnp.zeros(4)
    refused(
        lambda: robot.mass_matrix(q, gravity=q[:3]), "mass_matrix has no input gravity", "gravity_input=True"
    )
    refused(lambda: robot_of("scara").gravity(q, gravity=q[:3]), "gravity has no input", "gravity_input=True")
    refused(
        lambda: robot.gravity(q, gravity=q), r"gravity: gravity has shape \(4,\), expected \(..., 3\)", ""
    )
    step = jax.grad(lambda gravity: robot.rk4_step(q, q, q, 0.01, gravity=gravity).qd_next.sum())
    refused(lambda: step(q[:3]), "rk4_step has no derivative by gravity", "forward_dynamics")


def test_functions_without_derivatives_are_called_too() -> None:
    robot, numpy = robot_of("hopper"), robot_of("hopper").compiled
    for name in ("frame_jacobian", "mass_matrix_packed", "regressor", "neutral", "integrate", "difference"):
        inputs, _ = differentiated("hopper").drawn(SIGNATURES[name], COUNT)
        assert near(jax.jit(getattr(robot, name))(*inputs), getattr(numpy, name)(*inputs), 1e-13), name


def test_a_contact_of_six_rows() -> None:
    robot, q = psdmc.jax(on_its_sole()), state("hopper")[0]
    assert robot.contact_jacobian(q).shape == (6, 8)
    assert near(robot.contact_jacobian(q), robot.compiled.contact_jacobian(q), 1e-13)


def test_gradients_by_theta_b() -> None:
    own, robot = differentiated("hopper"), robot_of("hopper")
    inputs, _ = own.drawn(SIGNATURES["inverse_dynamics"], COUNT)
    regressor = robot.compiled.regressor(*inputs)
    theta = jnp.asarray(own.model.theta_b)
    for mode in (jax.jacfwd, jax.jacrev):
        assert near(mode(robot.inverse_dynamics, 3)(*inputs, theta), regressor, 1e-12)

    def cost(theta: Any, *given: Any) -> Any:
        return (robot.forward_dynamics(*given, theta) ** 2).sum()

    shared = jax.grad(cost)(theta, *inputs)
    each = jax.vmap(jax.grad(cost), (None, 0, 0, 0))(theta, *inputs)
    assert near(each.sum(0), shared, 1e-12)
    ahead, behind = (cost(theta * (1.0 + sign * 1e-6), *inputs) for sign in (1.0, -1.0))
    assert float(shared @ theta) == pytest.approx(float(ahead - behind) / 2e-6, rel=1e-7)


def test_each_state_may_have_its_theta_b() -> None:
    own, robot = differentiated("hopper"), robot_of("hopper")
    inputs, _ = own.drawn(SIGNATURES["inverse_dynamics"], COUNT)
    thetas = np.asarray(own.model.theta_b) * np.array([1.0, 1.0, 2.0, 3.0])[:, None]
    tau = robot.compiled.inverse_dynamics(*inputs) * np.array([1.0, 1.0, 2.0, 3.0])[:, None]

    assert near(robot.inverse_dynamics(*inputs, thetas), tau, 1e-13)
    assert near(jax.vmap(robot.inverse_dynamics)(*inputs, thetas), tau, 1e-13)
    both = jax.vmap(lambda theta: robot.inverse_dynamics(*inputs, theta))(
        thetas
    )  # of every state with every theta_b
    assert near(both[2], 2.0 * robot.compiled.inverse_dynamics(*inputs), 1e-13)
    many = jax.jit(jax.vmap(jax.grad(lambda theta, *x: robot.inverse_dynamics(*x, theta).sum())))(
        thetas, *inputs
    )
    assert near(many, robot.compiled.regressor(*inputs).sum(1), 1e-12)
    mass = jax.vmap(jax.jacrev(robot.mass_matrix, 1))(inputs[0], thetas)
    assert near(
        jnp.einsum("kijl,kl->kij", mass, thetas), jax.vmap(robot.mass_matrix)(inputs[0], thetas), 1e-11
    )


def test_leading_axes_broadcast_and_vmap_is_one_call() -> None:
    robot = robot_of("hopper")
    inputs, _ = differentiated("hopper").drawn(SIGNATURES["forward_dynamics"], 6)
    q, qd, tau = (x.reshape(2, 3, -1) for x in inputs)
    expected = robot.compiled.forward_dynamics(q, qd, tau)

    assert near(
        robot.forward_dynamics(q, qd[:1], tau), robot.compiled.forward_dynamics(q, qd[:1], tau), 1e-13
    )
    assert near(jax.vmap(jax.vmap(robot.forward_dynamics))(q, qd, tau), expected, 1e-13)
    turned = jax.vmap(robot.forward_dynamics, (1, 2, 1), 2)(q, np.moveaxis(qd, 1, 2), tau)
    assert near(np.moveaxis(turned, 2, 1), expected, 1e-13)
    mapped = jax.lax.map(lambda x: robot.forward_dynamics(*x), (q, qd, tau))
    assert near(mapped, expected, 1e-13)
    donated = jax.jit(robot.forward_dynamics, donate_argnums=2)(q, qd, jnp.array(tau))
    assert near(donated, expected, 1e-13)
    gradient = jax.jit(jax.vmap(jax.grad(lambda *x: robot.forward_dynamics(*x).sum(), (0, 1, 2))))
    text = gradient.lower(*inputs).as_text()
    assert "while" not in text
    assert text.count("@psdmc_call") == 1  # forward dynamics itself is not needed
    assert robot.forward_dynamics(q[:, :0], qd[:, :0], tau[:, :0]).shape == (2, 0, 8)


def test_a_rollout_has_a_gradient() -> None:
    """Through 50 steps of lax.scan on a floating base, by the torque and the first rates."""
    robot = robot_of("hopper")
    q, qd, tau = state("hopper")

    def end(qd: Any, tau: Any) -> Any:
        def step(state: Any, _: None) -> Any:
            q, qd = state
            qd = qd + 0.002 * robot.forward_dynamics(q, qd, tau)
            return (robot.integrate(q, 0.002 * qd), qd), None

        (q_end, qd_end), _ = jax.lax.scan(step, (jnp.asarray(q), qd), None, length=50)
        return q_end.sum() + (qd_end**2).sum()

    check_grads(jax.jit(end), (0.1 * qd, 0.1 * tau), 1, rtol=1e-6)


def test_quaternions_of_any_length_are_normalized() -> None:
    robot = robot_of("hopper")
    q, qd, tau = state("hopper")
    longer = q * np.where((np.arange(9) >= 3) & (np.arange(9) < 7), 3.0, 1.0)

    assert near(robot.forward_dynamics(longer, qd, tau), robot.compiled.forward_dynamics(q, qd, tau), 1e-12)
    gradient = jax.grad(lambda q: robot.potential_energy(q))(longer)
    assert abs(float(gradient[3:7] @ longer[3:7])) < 1e-12
    assert np.isnan(robot.gravity(q * 0.0)).all()


def test_the_tangent_space_is_reached_by_integrate() -> None:
    own, robot = differentiated("hopper"), robot_of("hopper")
    q, v, _ = state("hopper")
    rates = own.pinocchio.coordinate_rates(q[None], v[None])[0]
    for mode in (jax.jacfwd, jax.jacrev):
        assert near(mode(robot.integrate, 1)(q, 0.0 * v) @ v, rates, 1e-10)
        assert near(mode(robot.difference, 1)(q, q) @ rates, v, 1e-10)


def test_a_state_without_accelerations_is_nan_alone() -> None:
    robot = robot_of("scara")
    inputs, _ = differentiated("scara").drawn(SIGNATURES["forward_dynamics"], 3)
    thetas = np.asarray(robot.compiled.theta_b) * np.array([1.0, -1.0, 1.0])[:, None]

    found = np.asarray(jax.jit(robot.forward_dynamics)(*inputs, thetas))

    assert np.isnan(found[1]).all()
    assert near(found[::2], robot.compiled.forward_dynamics(*(x[::2] for x in inputs)), 1e-13)


def test_single_precision() -> None:
    own, robot = differentiated("scara"), robot_of("scara", "float32")
    inputs, _ = own.drawn(SIGNATURES["inverse_dynamics"], COUNT)
    given = [x.astype(np.float32) for x in inputs]

    found = jax.vmap(jax.grad(lambda *x: robot.inverse_dynamics(*x).sum(), 2))(*given)

    assert found.dtype == np.float32
    assert near(found, own.pinocchio.mass_matrix(inputs[0]).sum(1), 1e-5)
    with jax.enable_x64(False):  # where Python's numbers are float32
        assert robot.inverse_dynamics(*inputs).dtype == np.float32


def refused(call: Callable[[], Any], message: str, hint: str = "") -> None:
    with pytest.raises(InputError, match=message) as caught:
        call()
    assert hint in (caught.value.hint or "")
    assert "\n" not in caught.value.message


def test_wrong_arguments_are_refused() -> None:
    robot = robot_of("scara")
    q = jnp.zeros(4)
    refused(
        lambda: robot.gravity(q.astype(np.float32)),
        "^gravity: q has dtype float32, expected float64",
        "real='float32'",
    )
    refused(lambda: robot.gravity(q[:3]), r"^gravity: q has shape \(3,\), expected \(..., 4\)", "J1")
    refused(lambda: robot.gravity(0.0), r"^gravity: q has shape \(\)")
    refused(lambda: robot.gravity("q"), "^gravity: q is no array")
    with pytest.raises(InputError, match=r"^gravity: q has dtype complex128") as complex_numbers:
        robot.gravity(q + 1j)
    assert complex_numbers.value.hint == "convert the array"
    refused(lambda: robot.gravity(q, theta_b=q), r"^gravity: theta_b has shape \(4,\), expected \(..., 8\)")
    several = jnp.zeros((2, 4)), jnp.zeros((3, 4))
    refused(lambda: robot.nonlinear_effects(*several), r"do not broadcast: q \(2, 4\), qd \(3, 4\)")
    with pytest.raises(ValueError, match="shape"):  # JAX's own kind
        jax.jit(robot.gravity)(q[:3])
    with pytest.raises(TypeError, match="no argument 'out'"):
        robot.gravity(q, out=q)
    with pytest.raises(TypeError, match=r"^gravity\(\)"):
        robot.gravity(q, q, q, q)


def test_the_handler_checks_arrays_itself() -> None:
    """Whoever calls it from another program: with a number of no function, too few arrays, or arrays that do not fit."""
    robot = robot_of("scara")
    number = robot._kernel(SIGNATURES["gravity"], False).number(by_rows=False)

    def call(number: int, *given: Array) -> Any:
        out = jax.ShapeDtypeStruct((2, 4), np.float64)
        return jax.ffi.ffi_call("psdmc_call", out)(*given, function=np.int64(number))

    q = np.zeros((2, 4))
    assert near(call(number, q), robot.compiled.gravity(q), 1e-13)
    for found, message in (
        (lambda: call(number ^ 1, q), "not loaded"),
        (lambda: call(number, q, q), "number of arrays"),
        (lambda: call(number, q[:, :3]), "shape or dtype"),
        (lambda: call(number, q[:1]), "shape or dtype"),
        (lambda: call(number, q.astype(np.float32)), "shape or dtype"),
    ):
        with pytest.raises(jax.errors.JaxRuntimeError, match=message):
            jax.block_until_ready(found())


def test_what_has_no_derivative_is_refused_by_name() -> None:
    robot = robot_of("scara")
    q = jnp.zeros(4)
    refused(
        lambda: jax.grad(lambda q: robot.jacobian(q).sum())(q),
        "^jacobian has no derivatives",
        "inverse_dynamics",
    )
    seconds = {
        "gravity": "call robot.inverse_dynamics_second_derivatives with zero rates and accelerations",
        "mass_matrix": "take differences of first derivatives",
        "forward_kinematics": "take differences",
    }
    for name, remedy in seconds.items():
        first = partial(lambda call, q: call(q)[0].sum(), getattr(robot, name))
        for second in (jax.hessian(first), jax.jacrev(jax.jit(jax.jacrev(first)))):
            refused(partial(second, q), f"^{name} has no second derivatives", remedy)
    energy = jax.jacfwd(jax.hessian(robot.potential_energy))
    refused(lambda: energy(q), "^potential_energy has no third derivatives", "take differences")
    forward = jax.hessian(lambda tau: robot.forward_dynamics(q, q, tau).sum())
    refused(
        lambda: forward(q), "^forward_dynamics has no second", "robot.forward_dynamics_second_derivatives: it"
    )
    by_vjp = jax.grad(lambda q: robot.inverse_dynamics_vjp(q, q, q, q).tau.sum())
    refused(
        lambda: by_vjp(q), "^inverse_dynamics_vjp has no derivatives", "inverse_dynamics_second_derivatives"
    )
    step = jax.jacfwd(lambda dt: robot.semi_implicit_euler(q, q, q, dt).q_next)
    refused(lambda: step(0.01), "^semi_implicit_euler has no derivative by dt", "forward_dynamics")
    energy = jax.grad(lambda theta: robot.potential_energy(q, theta))
    refused(
        lambda: energy(robot.compiled.theta_b),
        "^potential_energy has no derivative by theta_b",
        "inverse_dyn",
    )
    with pytest.raises(ArgumentError, match="second"):
        jax.jit(jax.jacfwd(jax.jacfwd(lambda q: robot.gravity(q).sum())))(q)


def test_energy_has_second_derivatives() -> None:
    """The gradient of the potential energy is a function that has derivatives."""
    robot = robot_of("hopper")
    q = state("hopper", "gravity")[0]
    check_grads(robot.potential_energy, (1.3 * q,), 2, rtol=1e-6, atol=1e-6)
    assert near(
        jax.jacfwd(jax.jacfwd(robot.potential_energy))(q), jax.hessian(robot.potential_energy)(q), 1e-12
    )


def test_float64_needs_jax_enable_x64() -> None:
    model = differentiated("scara").model
    with jax.enable_x64(False):
        refused(lambda: psdmc.jax(model), "JAX's option jax_enable_x64 is off", 'real="float32"')


def test_an_equal_robot_is_the_same_one() -> None:
    model = differentiated("scara").model
    robot = psdmc.jax(model)
    assert psdmc.jax(model) is robot
    assert copy.copy(robot) is copy.deepcopy(robot) is pickle.loads(pickle.dumps(robot)) is robot
    assert repr(psdmc.jax(model)) == "JaxRobot 'scara': 4 joints, float64"
    with pytest.raises(AttributeError, match=r"^JaxRobot has no function 'grvity'; do you mean gravity"):
        robot.grvity  # noqa: B018
    assert not hasattr(robot, "__zzz__")
    assert "Compute the gravity torques" in psdmc.jax(model).gravity.__doc__


DEVICES = """
import jax, numpy as np, psdmc
from jax.sharding import NamedSharding, PartitionSpec
jax.config.update("jax_enable_x64", True)
robot = psdmc.jax(psdmc.derive("examples/robots/scara.toml"))
q, qd, tau = np.random.default_rng(0).normal(size=(3, 8, 4))
gradient = jax.vmap(jax.grad(lambda *x: (robot.forward_dynamics(*x) ** 2).sum(), (0, 1, 2)))
expected = gradient(q, qd, tau)
for kind in jax.sharding.AxisType.Explicit, jax.sharding.AxisType.Auto:
    mesh = jax.make_mesh((2,), ("rows",), axis_types=(kind,))
    own = NamedSharding(mesh, PartitionSpec("rows"))
    for function in jax.jit(gradient), jax.jit(jax.shard_map(gradient, mesh=mesh, in_specs=own.spec, out_specs=own.spec)):
        found = function(*(jax.device_put(x, own) for x in (q, qd, tau)))
        assert all(np.array_equal(a, b) for a, b in zip(found, expected))
assert len(found[0].sharding.device_set) == 2
by_two = jax.pmap(gradient)(*(x.reshape(2, 4, 4) for x in (q, qd, tau)))
assert all(np.array_equal(a.reshape(8, 4), b) for a, b in zip(by_two, expected))
"""


@pytest.mark.slow
def test_several_devices() -> None:
    flags = {"XLA_FLAGS": "--xla_force_host_platform_device_count=2"}
    import os

    subprocess.run([sys.executable, "-c", DEVICES], check=True, env=os.environ | flags)
