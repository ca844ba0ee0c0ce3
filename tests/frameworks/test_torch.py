"""Robots as functions of PyTorch: derivatives against Pinocchio's, transformations, memory, and refusals."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
import pytest
from differentiated import (
    QUICK,
    ROBOTS,
    RULED,
    WEIGHED,
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
from psdmc.functions import SIGNATURES
from psdmc.toolchain.compiled_functions import CompiledFunctions

torch = pytest.importorskip("torch")
pytest.importorskip("setuptools")  # torch.compile imports it, and it must be there before any other distutils
func = torch.func

EXACT, SOLVED = 1e-10, 1e-8
"""Of each Jacobian's largest entry; SOLVED for forward dynamics of HyQ, whose mass matrix has a condition number of 1e5."""

COUNT = 3
FIRST = ("inverse_dynamics", "forward_dynamics", "mass_matrix")

pytestmark = pytest.mark.filterwarnings("ignore::FutureWarning", "ignore::DeprecationWarning")


@pytest.fixture(autouse=True)
def fast_compiler() -> Iterator[None]:
    with without_optimisation():
        yield


@cache
def robot_of(name: str) -> Any:
    return psdmc.torch(differentiated(name).model)


def drawn(name: str, function: str, count: int = COUNT) -> list[Any]:
    """Inputs of a function at `count` states."""
    inputs, _ = differentiated(name).drawn(SIGNATURES[function], count)
    return [torch.tensor(np.ascontiguousarray(x)) for x in inputs]


def same(found: Any, expected: Any, limit: float) -> bool:
    """Whether the largest error of tensors or arrays is within a share of the largest entry."""
    return near(*(x.detach().numpy() if hasattr(x, "detach") else x for x in (found, expected)), limit)


def by_tangent(name: str, q: Array, by_entries: Array) -> Array:
    """(..., nv) derivatives along the tangent from those by the entries of q. If q has a quaternion, these must be zero
    along the quaternion: both conditions together determine them."""
    own = differentiated(name)
    if own.sizes.nq == own.sizes.nv:
        return by_entries
    along = np.zeros_like(q)
    along[3:7] = q[3:7]
    assert np.abs(by_entries @ along).max() <= EXACT * np.abs(by_entries).max()
    units = np.eye(own.sizes.nv)
    return by_entries @ own.pinocchio.coordinate_rates(np.tile(q, (len(units), 1)), units).T


@pytest.mark.parametrize("mode", ["jacfwd", "jacrev"])
@pytest.mark.parametrize("name", slow_but_for(QUICK, ROBOTS))
def test_jacobians_are_pinocchios(name: str, mode: str) -> None:
    """Of inverse and forward dynamics, by every input."""
    own, robot = differentiated(name), robot_of(name)
    q, qd, tau = drawn(name, "forward_dynamics", 1)
    qdd = torch.tensor(own.pinocchio.forward_dynamics(q.numpy(), qd.numpy(), tau.numpy()))
    arrays = [x.numpy() for x in (q, qd, tau, qdd)]
    _, *accelerations = own.pinocchio.forward_dynamics_derivatives(*arrays[:3])
    torques = own.pinocchio.inverse_dynamics_derivatives(arrays[0], arrays[1], arrays[3])
    for function, given, blocks, limit in (
        (robot.inverse_dynamics, (q, qd, qdd), torques, EXACT),
        (robot.forward_dynamics, (q, qd, tau), accelerations, SOLVED if name == "hyq" else EXACT),
    ):
        jacobian = func.vmap(getattr(func, mode)(function, (0, 1, 2)))
        found = [block[0].numpy() for block in jacobian(*given)]
        found[0] = by_tangent(name, arrays[0][0], found[0])
        for own_block, expected in zip(found, blocks, strict=True):
            assert near(own_block, expected[0], limit)


@pytest.mark.parametrize(
    ("name", "function"),
    slow_but_for(
        [("hopper", f) for f in RULED if f != "rk4_step"], [(r, f) for r in QUICK for f in RULED], spread=True
    ),
)
def test_gradcheck(name: str, function: str) -> None:
    """Both modes, by each input that has derivatives; quaternions need not have the length one."""
    rule, given = require_rule(function), drawn(name, function)
    if name == "hopper":
        given[0][:, 3:7] *= torch.tensor([0.5, 1.0, 3.0])[:, None]
    for quantity, x in zip(SIGNATURES[function].inputs, given, strict=True):
        x.requires_grad_(quantity.name not in rule.constant)
    assert torch.autograd.gradcheck(getattr(robot_of(name), function), given, check_forward_ad=True)
    if rule.parameters:
        theta = robot_of(name).theta_b.requires_grad_()
        states = [x.detach() for x in given]
        assert torch.autograd.gradcheck(
            lambda theta: getattr(robot_of(name), function)(*states, theta_b=theta),
            (theta,),
            check_forward_ad=True,
        )


@pytest.mark.parametrize("mode", ["jacfwd", "jacrev"])
@pytest.mark.parametrize("name", slow_but_for(["scara"], ["scara", "hopper", "kr6"]))
def test_gravity_has_its_own_gradient(name: str, mode: str) -> None:
    """Accelerations under another gravity, and their derivatives by gravity and by torques, are Pinocchio's."""
    robot, gravity = psdmc.torch(weighed(name), gravity_input=True), np.array([1.0, -3.0, -8.0])
    q, qd, tau = (x[0] for x in drawn(name, "forward_dynamics", 1))
    qdd, _, _, inverse = pulled(name, gravity).forward_dynamics_derivatives(
        q.numpy(), qd.numpy(), tau.numpy()
    )

    def forward(gravity: Any, tau: Any) -> Any:
        return robot.forward_dynamics(q, qd, tau, gravity=gravity)

    given = (torch.tensor(gravity), tau)
    assert near(forward(*given).numpy(), qdd, EXACT)
    by_gravity, by_tau = getattr(func, mode)(forward, (0, 1))(*given)
    assert near(by_gravity.numpy(), -inverse @ torques_of_gravity(name, q.numpy()), EXACT)
    assert near(by_tau.numpy(), inverse, EXACT)
    own = robot.gravity(q[None]).numpy()
    assert near(own, differentiated(name).pinocchio.gravity(q.numpy()[None]), EXACT)  # under that of the file


@pytest.mark.parametrize("function", slow_but_for(["inverse_dynamics", "potential_energy"], WEIGHED))
def test_gradcheck_by_gravity(function: str) -> None:
    """One gravity for all states and one for each, in both modes, and through torch.compile's checks of operators."""
    robot, given = psdmc.torch(differentiated("hopper").model, gravity_input=True), drawn("hopper", function)
    constant = require_rule(function, gravity=True).constant
    for gravity in (torch.tensor([1.0, -3.0, -8.0]), torch.randn(len(given[0]), 3)):
        gravity = gravity.double().requires_grad_()
        if "gravity" not in constant:
            assert torch.autograd.gradcheck(
                lambda pull: getattr(robot, function)(*given, gravity=pull), gravity, check_forward_ad=True
            )
        states = [
            x.detach().requires_grad_(quantity.name not in constant)
            for quantity, x in zip(SIGNATURES[function].inputs, given, strict=True)
        ]
        own = gravity.detach().requires_grad_("gravity" not in constant)
        torch.library.opcheck(robot.operator(function), (*states, own))


def test_gravity_where_it_is_no_input() -> None:
    robot, q = psdmc.torch(weighed("scara"), gravity_input=True), torch.zeros(4, dtype=torch.float64)
    pull = q[:3].clone().requires_grad_()
    with pytest.raises(InputError, match="mass_matrix has no input gravity"):
        robot.mass_matrix(q, gravity=pull)
    with pytest.raises(InputError, match="gravity has no input gravity"):
        robot_of("scara").gravity(q, gravity=pull)
    with pytest.raises(InputError, match="under the gravity of its file only"):
        psdmc.torch(differentiated("scara").model, gravity_input=True)
    with pytest.raises(TypeError, match=r"gravity: gravity is a list, expected a torch.Tensor"):
        robot.gravity(q, gravity=[0.0, 0.0, -9.81])
    with pytest.raises(ArgumentError, match="rk4_step has no derivative by gravity"):
        robot.rk4_step(q, q, q, q[0], gravity=pull).qd_next.sum().backward()


@pytest.mark.parametrize("name", slow_but_for(["hopper"], QUICK))
@pytest.mark.parametrize("function", slow_but_for(FIRST, RULED))
def test_opcheck(name: str, function: str) -> None:
    robot, constant = robot_of(name), require_rule(function).constant
    named = zip(SIGNATURES[function].inputs, drawn(name, function), strict=True)
    given = [x.requires_grad_(quantity.name not in constant) for quantity, x in named]
    torch.library.opcheck(robot.operator(function), given)
    if require_rule(function).parameters:
        torch.library.opcheck(robot.operator(function), (*given, robot.theta_b.requires_grad_()))


@pytest.mark.parametrize(
    "function", ["mass_matrix_packed", "regressor", "inverse_dynamics_vjp", "frame_jacobian"]
)
def test_functions_without_derivatives_are_operators_too(function: str) -> None:
    robot, given = robot_of("hopper"), drawn("hopper", function)
    found = getattr(robot, function)(*given)
    expected = getattr(robot.compiled(), function)(*[x.numpy() for x in given])
    pairs = zip(found, expected, strict=True) if isinstance(found, tuple) else [(found, expected)]
    assert all(same(one, other, 1e-13) for one, other in pairs)
    assert getattr(found, "_fields", None) == getattr(expected, "_fields", None)
    torch.library.opcheck(robot.operator(function), given)
    last = getattr(robot, function)(*[x.requires_grad_() for x in given])
    with pytest.raises(ArgumentError, match=rf"^{function} has no derivatives"):
        (last[0] if isinstance(last, tuple) else last).sum().backward()


def test_gradients_by_theta_b() -> None:
    """The regressor, shared parameters' gradient being the sum over states."""
    robot, given = robot_of("hopper"), drawn("hopper", "inverse_dynamics")
    regressor = robot.regressor(*given)
    for mode in (func.jacfwd, func.jacrev):
        assert same(mode(robot.inverse_dynamics, 3)(*given, robot.theta_b), regressor, 1e-12)
    theta = robot.theta_b.requires_grad_()
    robot.inverse_dynamics(*given, theta_b=theta).sum().backward()
    assert same(theta.grad, regressor.sum((0, 1)), 1e-12)


@pytest.mark.parametrize("shape", [(3,), (2, 1), (2, 3), (1, 1), (4, 1, 1), (2, 1, 3)])
def test_each_state_may_have_its_theta_b(shape: tuple[int, ...]) -> None:
    """Of states (2, 3), with gradients of the same shape."""
    robot = robot_of("hopper")
    given = [x.reshape(2, 3, -1) for x in drawn("hopper", "inverse_dynamics", 6)]
    share = torch.arange(1.0, 1.0 + np.prod(shape), dtype=torch.float64).reshape(shape)
    thetas = (share[..., None] * robot.theta_b).requires_grad_()
    tau = robot.inverse_dynamics(*given, thetas)
    assert same(tau.detach(), share[..., None] * robot.inverse_dynamics(*given), 1e-13)
    (gradient,) = torch.autograd.grad(tau.sum(), thetas)
    regressor = robot.regressor(*given).sum(-2)
    whole = torch.broadcast_shapes(shape, (2, 3))
    assert same(gradient, regressor.expand(*whole, -1).sum_to_size(thetas.shape), 1e-12)


def test_vmap() -> None:
    """Nested, along other axes, of some inputs only, and over parameters."""
    robot = robot_of("hopper")
    q, qd, tau = (x.reshape(2, 3, -1) for x in drawn("hopper", "forward_dynamics", 6))
    expected = robot.forward_dynamics(q, qd, tau)
    assert same(func.vmap(func.vmap(robot.forward_dynamics))(q, qd, tau), expected, 0.0)
    turned = func.vmap(robot.forward_dynamics, (1, 2, 1), 2)(q, qd.movedim(1, 2), tau)
    assert same(turned.movedim(2, 1), expected, 0.0)
    of_q = func.vmap(robot.forward_dynamics, (0, None, None))(q[:, 0], qd[0], tau[0])
    assert same(of_q, robot.forward_dynamics(q[:, :1], qd[:1], tau[:1]), 0.0)
    thetas = torch.tensor([[1.0], [2.0]]) * robot.theta_b
    both = func.vmap(lambda theta: robot.inverse_dynamics(q, qd, tau, theta))(thetas)
    assert same(both[1], 2.0 * both[0], 1e-13)
    gradients = func.vmap(func.grad(lambda *x: robot.forward_dynamics(*x).sum(), (0, 1)))(q[0], qd[0], tau[0])
    leaves = [x[0].clone().requires_grad_() for x in (q, qd)]
    whole = torch.autograd.grad(robot.forward_dynamics(*leaves, tau[0]).sum(), leaves)
    assert all(same(one, other, 1e-13) for one, other in zip(gradients, whole, strict=True))


def rollout(robot: Any, q: Any, qd: Any, tau: Any) -> Any:
    """Semi-implicit Euler, with quaternions by `integrate`."""
    for _ in range(3):
        qd = qd + 0.01 * robot.forward_dynamics(q, qd, tau)
        q = robot.integrate(q, 0.01 * qd)
    return q


def test_compiled_graphs_have_no_breaks() -> None:
    """A rollout and its gradient, forward mode and vmap, each against the same without torch.compile."""
    robot = robot_of("hopper")
    given = [x.requires_grad_() for x in drawn("hopper", "forward_dynamics")]
    whole = torch.compile(rollout, fullgraph=True, backend="aot_eager")
    results = [f(robot, *given) for f in (rollout, whole)]
    assert same(*results, 1e-14)
    slopes = [torch.autograd.grad(x.sin().sum(), given) for x in results]
    assert all(same(one, other, 1e-13) for one, other in zip(*slopes, strict=True))
    states = [x.detach() for x in given]
    for made in (
        func.vmap(func.jacfwd(robot.forward_dynamics)),
        func.vmap(func.jacrev(robot.forward_dynamics)),
        lambda *x: func.jvp(robot.mass_matrix, x[:1], x[:1])[1],
    ):
        traced = torch.compile(made, fullgraph=True, backend="aot_eager")
        assert same(traced(*states), made(*states), 1e-14)


def test_a_rollout_is_that_of_the_step() -> None:
    """With gradients: the step's Jacobians are another way to them."""
    robot = robot_of("hopper")
    q, qd, tau = (x.requires_grad_() for x in drawn("hopper", "forward_dynamics"))
    dt = torch.tensor(0.01, dtype=torch.float64)
    end, rates = q, qd
    for _ in range(3):
        end, rates = robot.semi_implicit_euler(end, rates, tau, dt)
    other = rollout(robot, q, qd, tau)
    assert same(end.detach(), other.detach(), 1e-13)
    pairs = zip(*(torch.autograd.grad(x.cos().sum(), (q, qd, tau)) for x in (end, other)), strict=True)
    assert all(same(one, two, 1e-11) for one, two in pairs)


def test_positions_are_differentiated_twice() -> None:
    """integrate and difference are PyTorch's own operations."""
    robot = robot_of("hopper")
    q, v = (x.requires_grad_() for x in drawn("hopper", "integrate", 2))
    q0, q1 = (x.requires_grad_() for x in drawn("hopper", "difference", 2))
    for function, given in ((robot.integrate, (q, v)), (robot.difference, (q0, q1))):
        assert torch.autograd.gradgradcheck(function, given)
    expected = robot.compiled().integrate(q.detach().numpy(), v.detach().numpy())
    assert same(robot.integrate(q, v).detach(), expected, 1e-13)


def test_second_derivatives_are_refused() -> None:
    robot, given = robot_of("hopper"), [x.requires_grad_() for x in drawn("hopper", "inverse_dynamics")]
    (slope,) = torch.autograd.grad(robot.inverse_dynamics(*given).sum(), given[:1], create_graph=True)
    with pytest.raises(ArgumentError, match=r"^inverse_dynamics has no second derivatives") as caught:
        slope.sum().backward()
    assert "create_graph" in caught.value.hint
    (slope,) = torch.autograd.grad(robot.gravity(given[0]).sum(), given[:1], create_graph=True)
    with pytest.raises(ArgumentError, match=r"^gravity has no second derivatives") as caught:
        slope.sum().backward()
    assert "robot.inverse_dynamics_second_derivatives with zero rates" in caught.value.hint
    with pytest.raises(ArgumentError, match=r"^inverse_dynamics_vjp has no derivatives"):
        robot.inverse_dynamics_vjp(*given, given[1]).tau.sum().backward()
    with pytest.raises(ArgumentError, match=r"^forward_dynamics has no second derivatives"):
        func.hessian(lambda q: robot.forward_dynamics(q, *given[1:]).sum())(given[0])


@pytest.mark.parametrize("real", ["float64", "float32"])
def test_time_steps_take_numbers(real: str) -> None:
    """dt as a number of Python, by place and by name, gives what a tensor gives, and gradients by the other inputs."""
    robot, dtype = robot_of("scara"), getattr(torch, real)
    q, qd, tau, _ = (x.to(dtype) for x in drawn("scara", "semi_implicit_euler"))
    dt = torch.tensor(0.25, dtype=dtype)
    for step in (robot.semi_implicit_euler, robot.rk4_step):
        expected = step(q, qd, tau, dt)
        for found in (step(q, qd, tau, 0.25), step(q, qd, tau, dt=0.25), step(q, qd, tau, np.float64(0.25))):
            assert found.q_next.dtype == dtype
            assert torch.equal(found.q_next, expected.q_next)
            assert torch.equal(found.qd_next, expected.qd_next)
        slopes = [
            torch.autograd.grad(step(q, qd, given, each).q_next.sum(), given)[0]
            for given, each in ((tau.clone().requires_grad_(), 0.25), (tau.clone().requires_grad_(), dt))
        ]
        assert torch.equal(*slopes)
        assert slopes[0].abs().max() > 0.0
    assert torch.equal(robot.rk4_step(q, qd, tau, 0).q_next, q)
    compiled = torch.compile(lambda dt: robot.semi_implicit_euler(q, qd, tau, dt).q_next, fullgraph=True)
    for each in (0.25, 0.5):
        assert same(compiled(each), robot.semi_implicit_euler(q, qd, tau, each).q_next, 1e-6)
    with pytest.raises(TypeError, match=r"tau is a float, expected a torch\.Tensor"):
        robot.semi_implicit_euler(q, qd, 0.1, 0.25)
    with pytest.raises(TypeError, match="dt is a str"):
        robot.semi_implicit_euler(q, qd, tau, "0.25")


def test_what_has_no_derivative_is_named() -> None:
    robot = robot_of("hopper")
    q, qd, tau, dt = drawn("hopper", "semi_implicit_euler")
    with pytest.raises(ArgumentError, match=r"^semi_implicit_euler has no derivative by dt"):
        robot.semi_implicit_euler(q, qd, tau, dt.requires_grad_()).q_next.sum().backward()
    with pytest.raises(ArgumentError, match=r"^potential_energy has no derivative by theta_b"):
        robot.potential_energy(q, robot.theta_b.requires_grad_()).sum().backward()


def test_float32() -> None:
    robot = robot_of("hopper")
    given = drawn("hopper", "inverse_dynamics")
    single = [x.float().requires_grad_() for x in given]
    tau = robot.inverse_dynamics(*single)
    assert tau.dtype == torch.float32
    expected = robot.compiled(torch.float32).inverse_dynamics(*[x.detach().numpy() for x in single])
    assert same(tau.detach(), expected, 1e-6)
    slopes = torch.autograd.grad(tau.sum(), single)
    double = [x.requires_grad_() for x in given]
    expected = torch.autograd.grad(robot.inverse_dynamics(*double).sum(), double)
    assert all(a.dtype == torch.float32 and same(a, b, 1e-5) for a, b in zip(slopes, expected, strict=True))


def test_contiguous_tensors_are_not_copied(monkeypatch: pytest.MonkeyPatch) -> None:
    """C reads the memory of the caller's tensors and writes that of the results; others are copied, and right."""
    robot = robot_of("scara")
    given = drawn("scara", "inverse_dynamics")
    expected = robot.inverse_dynamics(*given)
    seen: list[int] = []
    whole = CompiledFunctions.call_at

    def call_at(self: Any, kernel: str, count: int, addresses: Any) -> None:
        seen.extend(addresses)
        whole(self, kernel, count, addresses)

    monkeypatch.setattr(CompiledFunctions, "call_at", call_at)
    tau = robot.inverse_dynamics(*given)
    assert seen == [x.data_ptr() for x in (*given, tau)]
    columns = [x.T.contiguous().T for x in given]
    strided = [torch.stack([x, x], -1).flatten(1)[:, ::2] for x in given]
    for others in (columns, strided):
        assert not others[0].is_contiguous()
        assert torch.equal(robot.inverse_dynamics(*others), expected)
    negative = torch.imag(torch.complex(given[0], -given[1]).conj())
    assert negative.is_neg()
    assert torch.equal(robot.inverse_dynamics(given[0], negative, given[2]), expected)


def test_a_state_that_fails_is_nan() -> None:
    """Forward dynamics of negative masses, and a quaternion of length zero."""
    robot = robot_of("hopper")
    q, qd, tau = drawn("hopper", "forward_dynamics")
    thetas = torch.tensor([[1.0], [-1.0], [1.0]]) * robot.theta_b
    qdd = robot.forward_dynamics(q, qd, tau, thetas)
    assert qdd.isnan().all(-1).tolist() == [False, True, False]
    assert not qdd[0].isnan().any()
    q[0, 3:7] = 0.0
    assert robot.inverse_dynamics(q, qd, tau).isnan().any(-1).tolist() == [True, False, False]


def test_no_states() -> None:
    robot, given = robot_of("hopper"), drawn("hopper", "inverse_dynamics", 1)
    none = [x[:0] for x in given]
    assert robot.inverse_dynamics(*none).shape == (0, 8)
    assert robot.inverse_dynamics(*none, robot.theta_b[None][:0]).shape == (0, 8)
    with torch.inference_mode():
        assert robot.inverse_dynamics(*(x[0] for x in given)).shape == (8,)


WRONG = {
    "shape": (lambda q, v: (q[:, :3], v, v), ValueError, r"inverse_dynamics: q has shape \(3, 3\), expected \(\.\.\., 4\)"),
    "no axes": (lambda q, v: (q, v[0, 0], v), ValueError, r"qd has shape \(\), expected \(\.\.\., 4\)"),
    "leads": (lambda q, v: (q, v[:2], v), ValueError, r"shapes do not broadcast: q \(3, 4\), qd \(2, 4\), qdd \(3, 4\)"),
    "theta_b": (lambda q, v: (q, v, v, v), ValueError, r"theta_b has shape \(3, 4\), expected \(\.\.\., 8\)"),
    "half": (lambda q, v: (q.half(), v, v), TypeError, r"q is torch.float16, expected torch.float64 or torch.float32"),
    "mixed": (lambda q, v: (q, v.float(), v), TypeError, r"qd is torch.float32, expected torch.float64"),
    "integers": (lambda q, v: (q.long(), v, v), TypeError, r"q is torch.int64, expected"),
    "array": (lambda q, v: (q, v.numpy(), v), TypeError, r"qd is a ndarray, expected a torch.Tensor"),
    "missing": (lambda q, v: (q, v), TypeError, r"inverse_dynamics\(q, qd, qdd, theta_b\): qdd was not given"),
    "many": (lambda q, v: (q, v, v, v, v), TypeError, r"5 tensors were given"),
    "device": (lambda q, v: (q, v.to("meta"), v), ValueError, r"qd is on the device meta; psdmc computes on the CPU"),
    "sparse": (lambda q, v: (q, v.to_sparse(), v), ValueError, r"qd is torch.sparse_coo; psdmc computes on the CPU"),
}  # fmt: skip
"""What is given instead of q (3, 4), qd and qdd; the error."""


@pytest.mark.parametrize("wrong", WRONG)
def test_wrong_tensors_are_refused_by_name(wrong: str) -> None:
    make, kind, message = WRONG[wrong]
    q, v, _ = drawn("scara", "inverse_dynamics")
    with pytest.raises(kind, match=message):
        robot_of("scara").inverse_dynamics(*make(q, v))


def test_unknown_arguments_and_unknown_parameters() -> None:
    robot = robot_of("scara")
    q, v, _ = drawn("scara", "inverse_dynamics")
    assert torch.equal(robot.inverse_dynamics(q, qdd=v, qd=v), robot.inverse_dynamics(q, v, v))
    with pytest.raises(TypeError, match=r"there is no argument out$"):
        robot.inverse_dynamics(q, v, v, out=v)
    with pytest.raises(ArgumentError, match="device meta") as caught:
        robot.gravity(q.to("meta"))
    assert "to('cpu')" in caught.value.hint


def test_a_robot_is_one_object() -> None:
    """Also for a module that is copied, and for another process's robot."""
    robot = robot_of("scara")
    assert psdmc.torch(differentiated("scara").model) is robot
    assert copy.deepcopy(robot) is robot
    assert pickle.loads(pickle.dumps(robot)) is robot
    assert copy.copy(robot) is robot
    with pytest.raises(AttributeError, match=r"^TorchRobot has no function 'grvity'; do you mean gravity"):
        robot.grvity  # noqa: B018
    assert not hasattr(robot, "__zzz__")
    assert repr(robot) == "TorchRobot 'scara': 4 joints"
    assert robot.neutral().tolist() == [0.0] * 4
    assert robot.neutral(torch.float32).dtype == torch.float32
    assert same(robot.theta_b, differentiated("scara").model.theta_b, 0.0)
    with pytest.raises(InputError, match="no such file"):
        psdmc.torch("nothing.npz")


def test_a_contact_of_six_rows() -> None:
    model = on_its_sole()
    robot, q = psdmc.torch(model), torch.tensor(model.neutral())
    found = robot.contact_jacobian(q)
    assert found.shape == (6, 8)
    assert near(found, robot.compiled().contact_jacobian(q.numpy()), 1e-13)
