"""Trees: base parameters, E and P where they are asked for, the model file, lowering; against Pinocchio."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from random_trees import TREES, RandomTree

from psdmc.derivation import derive
from psdmc.derivation.base_parameters import reduction_link_by_link, sampled_reduction
from psdmc.derivation.scaled import scaled
from psdmc.dynamics.frames import frames_of
from psdmc.dynamics.kinematics import jacobian
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.dynamics.parameters import moved
from psdmc.dynamics.spatial import body_from_parameters
from psdmc.errors import DerivationError
from psdmc.lower.kernels import lower
from psdmc.lower.reframe import reframe
from psdmc.model.chain_json import chain_from_json, chain_to_json
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.load import load
from psdmc.model.store import file_bytes
from psdmc.program.interpret import interpret
from psdmc.robot.mechanism import Placement

SMALL = [("a fork", "RRR"), ("a fork", "PRP"), ("two on the base", "RPR"), ("two on the base", "RRR")]
LARGER = [("a trunk with two arms", "RRRPRR"), ("interleaved", "RPRRPRPR")]


def derived(tree: RandomTree, expand: bool | None = None) -> DynamicsModel:
    return derive.derive_model(tree.mechanism(), expand=expand)


def rank_by_pinocchio(tree: RandomTree) -> int:
    """Of the regressor of Pinocchio's standard parameters at random states, drive inertias beside."""
    rows = []
    for q, qd, qdd in tree.states(40, 3).transpose(1, 0, 2):
        row = pin.computeJointTorqueRegressor(tree.model, tree.data, *map(tree.theirs, (q, qd, qdd)))
        rows.append(np.hstack([row, np.diag(tree.theirs(qdd))]))
    return int(np.linalg.matrix_rank(np.vstack(rows), tol=1e-9))


@pytest.mark.parametrize(("name", "kinds"), SMALL)
def test_e_and_p_of_small_trees_are_pinocchios_torques(name: str, kinds: str) -> None:
    tree = RandomTree(11, TREES[name], kinds)
    model = derived(tree, expand=True)
    q, qd, qdd = tree.states(20, 3)
    expected = tree.each(pin.rnea, q, qd, qdd)
    np.testing.assert_allclose(model.inverse_dynamics(q, qd, qdd), expected, rtol=0, atol=1e-11)
    assert model.certificate.max() < 1e-12
    assert model.l == rank_by_pinocchio(tree)


@pytest.mark.parametrize(("name", "kinds"), LARGER)
def test_base_parameters_of_trees_are_as_many_as_pinocchios_rank(name: str, kinds: str) -> None:
    tree = RandomTree(12, TREES[name], kinds)
    model = derived(tree)
    q, qd, qdd = tree.states(20, 3)
    expected = tree.each(pin.rnea, q, qd, qdd)
    np.testing.assert_allclose(model.inverse_dynamics(q, qd, qdd), expected, rtol=0, atol=1e-10)
    assert model.l == rank_by_pinocchio(tree)


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
    model = derived(tree)
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


ABOUT_X = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
ABOUT_Y = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
STEP = np.array([0.0, 0.2, 0.3])


@pytest.mark.parametrize(
    "children",
    [
        # The body's x is turned along the normal to its first child's axis: here the second child's axis,
        (Placement(ABOUT_X, np.zeros(3)), Placement(ABOUT_Y, np.zeros(3))),
        # and here the normals to its two children's axes are opposite: two arms on a torso.
        (Placement(ABOUT_X, STEP), Placement(ABOUT_X.T, -STEP)),
        (Placement(np.eye(3), STEP), Placement(np.eye(3), -STEP)),
    ],
)
def test_any_two_children_are_reframed(children: tuple[Placement, Placement]) -> None:
    tree = RandomTree(17, TREES["a fork"], "RRR")
    tree.places = [Placement.identity(), *children]
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


def test_a_tree_is_derived_without_e_and_p_unless_they_are_asked_for() -> None:
    tree = RandomTree(15, TREES["a fork"], "RRR")
    assert derived(tree).E is None
    assert derived(tree, expand=True).p == len(derived(tree, expand=True).E[0])


def test_e_and_p_of_limbs_are_refused_by_the_longest_way_to_an_end() -> None:
    """Sixteen joints in two limbs of eight: a grid of 5^7 points, not of 5^15; and too many numbers for its functions."""
    joints = 32
    limbs = (-1, *range(7)), (-1, *range(8, 15))
    parents = tuple(i for limb in limbs for i in limb)
    steps: list[str] = []
    tree = RandomTree(15, parents, "R" * 16)
    with pytest.raises(
        DerivationError, match=r"expanding this 16-joint robot takes .* velocity terms"
    ) as refused:
        derive.derive_model(tree.mechanism(), expand=True, progress=steps.append)
    assert "--no-expand" in str(refused.value.hint)
    many = RandomTree(15, (-1,) * joints, "R" * joints)
    with pytest.raises(DerivationError, match="too many to be numbered"):
        derived(many, expand=True)


@pytest.mark.parametrize("name", TREES)
def test_a_trees_model_file_gives_the_tree_back(name: str, tmp_path: Path) -> None:
    tree = RandomTree(16, TREES[name], "RPRRPRRR")
    model = derived(tree)
    model.save(tmp_path / "tree.npz")
    found = load(tmp_path / "tree.npz")
    assert found.content_hash == model.content_hash
    assert (found.mechanism.parents, found.mechanism.tip_body) == (tree.parents, model.mechanism.tip_body)
    states = tree.states(5, 3)
    np.testing.assert_array_equal(found.inverse_dynamics(*states), model.inverse_dynamics(*states))
    assert file_bytes(found) == (tmp_path / "tree.npz").read_bytes()


def test_a_chains_file_is_what_it_was_before_there_were_trees() -> None:
    def manifest(parents: tuple[int, ...]) -> dict:
        model = derived(RandomTree(16, parents, "RRR"))
        with np.load(io.BytesIO(file_bytes(model))) as arrays:
            return json.loads(str(arrays["manifest"]))

    chain, tree = manifest((-1, 0, 1)), manifest((-1, 0, 0))
    assert (chain["schema"], tree["schema"]) == (1, 2)
    assert not {"parents", "tip_body", "coordinates"} & set(chain["chain"])
    assert tree["chain"]["parents"] == [-1, 0, 0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"parents": [-1, 0, 2]}, "parent 2 of body 2 does not come before it"),
        ({"parents": [-1, 0]}, "2 parents and 3 coordinates for 3 joints"),
        ({"parents": [-1, 0, 0.5]}, "a parent"),
        ({"tip_body": 3}, "the tip's body"),
        ({"coordinates": [[0, 1.0, 0.0], [1, 1.0, 0.0], [5, 1.0, 0.0]]}, "a coordinate's leader"),
        ({"coordinates": [[0, 1.0, 0.0], [2, 2.0, 0.0], [1, 1.0, 0.0]]}, "has no coordinate of its own"),
    ],
)
def test_forged_trees_are_damaged_files(change: dict, message: str) -> None:
    chain = chain_to_json(RandomTree(16, (-1, 0, 0), "RRR").mechanism())
    assert chain_from_json(chain).parents == (-1, 0, 0)
    with pytest.raises(ValueError, match=message):
        chain_from_json(chain | change)
