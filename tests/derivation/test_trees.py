"""Trees are refused so far; but nothing in the derivation and lowering assumes that a body hangs on the one before."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from random_trees import TREES, RandomTree

from psdmc.derivation import derive
from psdmc.derivation.link_by_link import reduction_link_by_link
from psdmc.derivation.sampled import sampled_reduction
from psdmc.derivation.units import scaled
from psdmc.dynamics.body import body_from_parameters
from psdmc.dynamics.frames import frames_of
from psdmc.dynamics.kinematics import jacobian
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.dynamics.parameters import moved
from psdmc.errors import InputError
from psdmc.lower import kernels
from psdmc.lower.kernels import lower
from psdmc.lower.reframe import reframe
from psdmc.model import chain_json
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.store import file_bytes
from psdmc.program.interpret import interpret
from psdmc.robot.mechanism import Placement

SMALL = [("a fork", "RRR"), ("a fork", "PRP"), ("two on the base", "RPR"), ("two on the base", "RRR")]
LARGER = [("a trunk with two arms", "RRRPRR"), ("interleaved", "RPRRPRPR")]


@pytest.fixture
def lets_trees_pass(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the refusal, which is at one place."""
    for module in (derive, kernels, chain_json):
        monkeypatch.setattr(module, "require_derivable", lambda chain: None)


def derived(tree: RandomTree, expand: bool = True) -> DynamicsModel:
    return derive.derive_model(tree.mechanism(), expand=expand)


def rank_by_pinocchio(tree: RandomTree) -> int:
    """Of the regressor of Pinocchio's standard parameters at random states, drive inertias beside."""
    rows = []
    for q, qd, qdd in tree.states(40, 3).transpose(1, 0, 2):
        row = pin.computeJointTorqueRegressor(tree.model, tree.data, *map(tree.theirs, (q, qd, qdd)))
        rows.append(np.hstack([row, np.diag(tree.theirs(qdd))]))
    return int(np.linalg.matrix_rank(np.vstack(rows), tol=1e-9))


@pytest.mark.usefixtures("lets_trees_pass")
@pytest.mark.parametrize(("name", "kinds"), SMALL)
def test_e_and_p_of_small_trees_are_pinocchios_torques(name: str, kinds: str) -> None:
    tree = RandomTree(11, TREES[name], kinds)
    model = derived(tree)
    q, qd, qdd = tree.states(20, 3)
    expected = tree.each(pin.rnea, q, qd, qdd)
    np.testing.assert_allclose(model.inverse_dynamics(q, qd, qdd), expected, rtol=0, atol=1e-11)
    assert model.certificate.max() < 1e-12
    assert model.l == rank_by_pinocchio(tree)


@pytest.mark.usefixtures("lets_trees_pass")
@pytest.mark.parametrize(("name", "kinds"), LARGER)
def test_base_parameters_of_trees_are_as_many_as_pinocchios_rank(name: str, kinds: str) -> None:
    tree = RandomTree(12, TREES[name], kinds)
    model = derived(tree, expand=False)
    q, qd, qdd = tree.states(20, 3)
    expected = tree.each(pin.rnea, q, qd, qdd)
    np.testing.assert_allclose(model.inverse_dynamics(q, qd, qdd), expected, rtol=0, atol=1e-10)
    assert model.l == rank_by_pinocchio(tree)


@pytest.mark.usefixtures("lets_trees_pass")
@pytest.mark.parametrize("kinds", ["RRRR", "RPRR", "PRPP"])
@pytest.mark.parametrize("parents", [(-1, 0, 1, 0), (-1, -1, 0, 1)])
@pytest.mark.parametrize("parallel", [0.0, 0.6])
def test_link_by_link_finds_the_same_base_parameters(parents, kinds: str, parallel: float) -> None:
    robot = scaled(RandomTree(13, parents, kinds, parallel).mechanism())
    one, other = reduction_link_by_link(robot), sampled_reduction(robot)
    assert len(one.pivots) == len(other.pivots)
    across = one.echelon[
        :, other.pivots
    ]  # both have the row space of the regressor: each is the other's image
    np.testing.assert_allclose(across @ other.echelon, one.echelon, atol=1e-11)


@pytest.mark.usefixtures("lets_trees_pass")
@pytest.mark.parametrize(
    ("name", "kinds", "parallel"),
    [
        ("a fork", "RRR", 0.6),
        ("a fork", "PRP", 0.0),
        ("two on the base", "RPR", 0.6),
        ("a wrist with two fingers", "RRPR", 1.0),
    ],
)
def test_lowered_trees_are_pinocchios(name: str, kinds: str, parallel: float) -> None:
    """Re-framed, searched, traced, optimised: every choice of the search on a tree."""
    tree = RandomTree(14, TREES[name], kinds, parallel)
    model = derived(tree, expand=False)
    made = lower(
        model,
        "factored",
        ("inverse_dynamics", "forward_dynamics", "mass_matrix", "nonlinear_effects", "jacobian", "regressor"),
    )
    q, qd, qdd = tree.states(20, 3)
    tau = tree.each(pin.rnea, q, qd, qdd)
    given = {
        "q": q,
        "qd": qd,
        "qdd": qdd,
        "tau": tau,
        "theta_b": np.broadcast_to(model.theta_b, (20, model.l)),
    }

    def run(kernel: str, vector: str, size: int) -> np.ndarray:
        both = [
            interpret(program, given, {vector: size, "pivot": n})[vector]
            for program in (made[kernel].single, made[kernel].batch)
        ]
        np.testing.assert_allclose(both[0], both[1], atol=1e-9)
        return both[0]

    n = tree.n
    np.testing.assert_allclose(run("inverse_dynamics", "tau", n), tau, atol=1e-10)
    np.testing.assert_allclose(run("inverse_dynamics_theta", "tau", n), tau, atol=1e-10)
    np.testing.assert_allclose(run("forward_dynamics", "qdd", n), qdd, atol=1e-7)
    M = run("mass_matrix", "M", n * n).reshape(20, n, n)
    h = run("nonlinear_effects", "h", n)
    np.testing.assert_allclose(np.einsum("sij,sj->si", M, qdd) + h, tau, atol=1e-10)
    np.testing.assert_allclose(h, tree.each(pin.nonLinearEffects, q, qd), atol=1e-10)
    rows = run("regressor", "Y", n * model.l).reshape(20, n, model.l)
    np.testing.assert_allclose(rows @ model.theta_b, tau, atol=1e-10)
    chain = model.chain
    expected = jacobian(frames_of(chain), chain.tip_body, chain.tip, list(q.T))
    expected = np.stack([np.broadcast_to(entry, (20,)) for row in expected for entry in row], axis=-1)
    np.testing.assert_allclose(run("jacobian", "J", 6 * n), expected, atol=1e-12)


def test_a_second_child_may_lie_along_its_parents_x() -> None:
    """Re-framing turns a body's x along the normal to its first child's axis: here the second child's axis."""
    tree = RandomTree(17, TREES["a fork"], "RRR")
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    about_y = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    tree.places = [Placement.identity(), Placement(about_x, np.zeros(3)), Placement(about_y, np.zeros(3))]
    tree.model, tree.joints = tree._pinocchio()
    tree.data = tree.model.createData()
    chain = tree.mechanism()
    for foot in ("previous", "next"):
        reframed = reframe(chain, (foot,) * 3)
        axes = [np.array(frame.rotation) for frame in reframed.frames]
        assert all(np.allclose(axis @ axis.T, np.eye(3)) for axis in axes)
        states = [list(v.T) for v in tree.states(20, 3)]
        bodies = [
            body_from_parameters(moved(row[:10], place).tolist())
            for row, place in zip(chain.parameters, reframed.link_frames, strict=True)
        ]
        tau = inverse_dynamics(reframed.frames, bodies, tree.drives, *states, reframed.base_acceleration)
        expected = tree.each(pin.rnea, *tree.states(20, 3))
        np.testing.assert_allclose(np.stack(tau, axis=1), expected, atol=1e-11)


@pytest.mark.parametrize("name", TREES)
def test_a_tree_is_refused_in_a_sentence(name: str) -> None:
    chain = RandomTree(15, TREES[name], "RRRRRRRR").mechanism()
    with pytest.raises(
        InputError, match=r"^'tree': link '\w+' carries joints .* derives serial chains only$"
    ) as refused:
        derive.derive_model(chain)
    assert "--tip" in str(refused.value.hint)


def test_every_stage_refuses_a_tree(monkeypatch: pytest.MonkeyPatch) -> None:
    tree = RandomTree(16, TREES["a fork"], "RRR")
    with monkeypatch.context() as context:
        context.setattr(derive, "require_derivable", lambda chain: None)
        model = derived(tree)
    for stage in (lambda: lower(model), lambda: file_bytes(model)):
        with pytest.raises(InputError, match="link 'link0' carries joints 'joint1' and 'joint2'"):
            stage()
