"""The factored lowering against Pinocchio, on chains of every kind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_chains import Oracle, random_chain, relative_error, states
from scipy.spatial.transform import Rotation
from slow_cases import slow_but_for

from psdmc.dynamics.solve import SingularMatrix, factorize
from psdmc.functions import RECIPES
from psdmc.lower.carriers import Tableau
from psdmc.lower.factored import trace_dynamics, trace_geometry
from psdmc.lower.link_parameters import carrier_space, link_map
from psdmc.lower.reframe import reframe
from psdmc.lower.search import ALL_CHOICES, Search, all_feet
from psdmc.program.cost import BATCH, SINGLE, cost
from psdmc.program.interpret import interpret
from psdmc.robot.mechanism import Mechanism, Placement

INVERSE = RECIPES["inverse_dynamics"]


def known(chain: Mechanism) -> tuple[np.ndarray, np.ndarray]:
    """A model whose base parameters are simply all standard parameters: representative and theta_b."""
    return chain.parameter_span, chain.parameter_span.T @ chain.parameters.ravel()


def run(program, n: int, rows: int, vector: str, **inputs: np.ndarray) -> np.ndarray:
    return interpret(program, inputs, {vector: rows, "pivot": n})[vector]


@given(seed=st.integers(0, 10**6), kinds=st.text("RP", min_size=1, max_size=5), tidy=st.booleans())
@settings(max_examples=25, deadline=None)
def test_inverse_dynamics_of_any_chain_in_any_arrangement(seed, kinds, tidy):
    chain = random_chain(seed, kinds, tidy=tidy, gravity=(1.0, -2.0, -9.0))
    n, oracle = len(chain), Oracle(chain)
    representative, theta_b = known(chain)
    q, qd, qdd = states(n, 20)
    expected = oracle.rnea(q, qd, qdd)
    search = Search(chain, representative, theta_b)
    for feet in all_feet(chain):
        for arrangement in search.starts(feet):
            program = trace_dynamics(INVERSE, arrangement, search.robot)
            found = run(program, n, n, "tau", q=q, qd=qd, qdd=qdd)
            assert relative_error(found, expected) < 1e-11


CHAINS = [
    (kinds, tidy, baked)
    for baked in (False, True)
    for tidy in (False, True)
    for kinds in ("RRRRRR", "RRPRRR", "RRRRRRR", "RPRRRPRRRR")
]
QUICK = [("RRPRRR", False, True), ("RRRRRR", True, False), ("RRRRRRR", True, True)]


@pytest.mark.parametrize(("kinds", "tidy", "baked"), slow_but_for(QUICK, CHAINS, spread=True))
def test_every_function_against_pinocchio(kinds, tidy, baked):
    chain = random_chain(7, kinds, tidy=tidy)
    n, oracle = len(chain), Oracle(chain)
    representative, theta_b = known(chain)
    search = Search(chain, representative, theta_b if baked else None, budget=30)
    q, qd, qdd = states(n, 200)
    given_theta = {} if baked else {"theta_b": theta_b}
    arrangement = search.best(INVERSE, SINGLE)

    def program(name):
        return search.rearranged(RECIPES[name], arrangement, SINGLE)

    tau = run(program("inverse_dynamics"), n, n, "tau", q=q, qd=qd, qdd=qdd, **given_theta)
    assert relative_error(tau, oracle.rnea(q, qd, qdd)) < 1e-12
    h = run(program("nonlinear_effects"), n, n, "h", q=q, qd=qd, **given_theta)
    assert relative_error(h, oracle.nonlinear_effects(q, qd), tau) < 1e-12
    g = run(program("gravity"), n, n, "g", q=q, **given_theta)
    assert relative_error(g, oracle.gravity(q), tau) < 1e-12
    mass = run(program("mass_matrix"), n, n * n, "M", q=q, **given_theta)
    assert relative_error(mass.reshape(-1, n, n), oracle.mass_matrix(q)) < 1e-12
    coriolis = run(program("coriolis_matrix"), n, n * n, "C", q=q, qd=qd, **given_theta)
    assert relative_error(coriolis.reshape(-1, n, n), oracle.coriolis_matrix(q, qd)) < 1e-12
    well = np.linalg.cond(oracle.mass_matrix(q)) < 1e5
    qdd_found = run(program("forward_dynamics"), n, n, "qdd", q=q, qd=qd, tau=tau, **given_theta)
    assert np.any(well)
    assert relative_error(qdd_found[well], oracle.aba(q, qd, tau)[well]) < 1e-9


@pytest.mark.parametrize("kinds", ["RRRRRR", "RPRRP"])
@pytest.mark.parametrize("tidy", [False, True])
def test_regressors_and_jacobian(kinds, tidy):
    chain = random_chain(3, kinds, tidy=tidy)
    n, oracle = len(chain), Oracle(chain)
    representative, theta_b = known(chain)
    l = len(theta_b)
    q, qd, qdd = states(n, 100)
    qd_r = states(n, 100, seed=9)[1]
    robot = Search(chain, representative, theta_b).robot
    for feet in all_feet(chain):
        reframed = reframe(chain, feet)
        y = run(trace_geometry(RECIPES["regressor"], reframed, robot), n, n * l, "Y", q=q, qd=qd, qdd=qdd)
        torque = y.reshape(-1, n, l) @ theta_b
        assert relative_error(torque, oracle.rnea(q, qd, qdd)) < 1e-12
        program = trace_geometry(RECIPES["regressor_slotine_li"], reframed, robot)
        y = run(program, n, n * l, "Y", q=q, qd=qd, qd_r=qd_r, qdd_r=qdd)
        expected = (
            np.einsum("sij,sj->si", oracle.mass_matrix(q), qdd)
            + np.einsum("sij,sj->si", oracle.coriolis_matrix(q, qd), qd_r)
            + oracle.gravity(q)
        )
        assert relative_error(y.reshape(-1, n, l) @ theta_b, expected) < 1e-12
        j = run(trace_geometry(RECIPES["jacobian"], reframed, robot), n, 6 * n, "J", q=q)
        assert relative_error(j.reshape(-1, 6, n), oracle.jacobian(q)) < 1e-12


def test_coriolis_matrix_leaves_the_rate_of_the_mass_matrix_skew():
    chain = random_chain(5, "RRPR")
    n = len(chain)
    representative, theta_b = known(chain)
    search = Search(chain, representative, theta_b, budget=30)
    arrangement = search.best(INVERSE, SINGLE)
    q, qd, _ = states(n, 20)
    mass = search.rearranged(RECIPES["mass_matrix"], arrangement, SINGLE)
    step = 1e-6
    ahead = run(mass, n, n * n, "M", q=q + step * qd).reshape(-1, n, n)
    behind = run(mass, n, n * n, "M", q=q - step * qd).reshape(-1, n, n)
    program = search.rearranged(RECIPES["coriolis_matrix"], arrangement, SINGLE)
    coriolis = run(program, n, n * n, "C", q=q, qd=qd).reshape(-1, n, n)
    skew = (ahead - behind) / (2 * step) - 2 * coriolis
    assert np.max(np.abs(skew + skew.transpose(0, 2, 1))) < 1e-7


def test_carriers_are_as_many_as_the_base_parameters_and_reproduce_any_model():
    chain = random_chain(11, "RRRRRR", tidy=True)
    representative, _ = known(chain)
    reframed = reframe(chain, ["previous"] * 6)
    space = carrier_space(reframed, representative)
    carriers = space.lightest([1.0] * space.count)
    assert len(carriers) == space.columns.shape[0] == np.linalg.matrix_rank(space.columns)
    transfer = space.transfer(carriers)
    plain = Tableau.of(space.columns.astype(np.longdouble), carriers).entries
    lift = np.zeros((space.count, representative.shape[1]))
    for k, place in enumerate(reframed.link_frames):
        lift[11 * k : 11 * k + 11] = link_map(place) @ representative[11 * k : 11 * k + 11]
    np.testing.assert_allclose(space.columns[:, list(carriers)] @ plain, space.columns, atol=1e-9)
    np.testing.assert_allclose(space.columns[:, list(carriers)] @ transfer, space.columns @ lift, atol=1e-9)


def test_search_never_ends_dearer_than_it_starts():
    chain = random_chain(13, "RRRRRR", tidy=True)
    representative, theta_b = known(chain)
    search = Search(chain, representative, theta_b)
    first = next(search.starts(next(iter(all_feet(chain)))))
    start = SINGLE.score(trace_dynamics(INVERSE, first, search.robot))
    best = search.best(INVERSE, SINGLE)
    assert SINGLE.score(trace_dynamics(INVERSE, best, search.robot)) < start


def test_lanes_of_states_pay_for_every_angle_and_one_state_does_not():
    chain = random_chain(17, "RRRR", tidy=True)
    representative, theta_b = known(chain)
    search = Search(chain, representative, theta_b, budget=60)
    arrangement = search.best(INVERSE, SINGLE)
    one = cost(search.rearranged(INVERSE, arrangement, SINGLE))
    lanes = cost(search.rearranged(INVERSE, arrangement, BATCH))
    assert lanes.sincos <= one.sincos
    assert one.total <= lanes.total


def test_every_choice_gives_pinocchios_torques():
    """Three parallel axes, so that compound turns and added sines have something to do."""
    chain = random_chain(7, "RRRRR", tidy=False)
    joints = list(chain.joints)
    for k in (2, 3):
        joints[k] = replace(joints[k], placement=Placement(np.eye(3), joints[k].placement.translation))
    chain = replace(chain, joints=tuple(joints))
    representative, theta_b = known(chain)
    search = Search(chain, representative, theta_b, budget=20)
    found = search.best(INVERSE, SINGLE)
    q, qd, qdd = states(5, 50)
    expected = Oracle(chain).rnea(q, qd, qdd)
    sincos = {}
    for choices in ALL_CHOICES:
        program = trace_dynamics(INVERSE, replace(found, choices=choices), search.robot)
        torque = run(program, 5, 5, "tau", q=q, qd=qd, qdd=qdd)
        assert relative_error(torque, expected) < 1e-12
        sincos[choices] = cost(program).sincos
    of_sums = [sincos[replace(choices, add_sines=False)] for choices in ALL_CHOICES if choices.add_sines]
    assert [sincos[choices] for choices in ALL_CHOICES if choices.add_sines] == [
        count - 2 for count in of_sums
    ]


def test_a_mass_matrix_without_inertia_is_named_singular():
    with pytest.raises(SingularMatrix) as caught:
        factorize([[1.0, 0.0], [0.0, 0.0]])
    assert caught.value.row == 1


def tilted(chain: Mechanism, angle: float) -> Mechanism:
    """The chain with every joint turned a little more, about a random axis: no two axes stay parallel."""
    rng = np.random.default_rng(1)
    joints = []
    for joint in chain.joints:
        turn = Rotation.from_rotvec(angle * rng.uniform(-1.0, 1.0, 3)).as_matrix()
        place = Placement(turn @ joint.placement.rotation, joint.placement.translation)
        joints.append(replace(joint, placement=place))
    return replace(chain, joints=tuple(joints))


@pytest.mark.parametrize("angle", slow_but_for([3e-2, 1e-3], [3e-2, 1e-2, 3e-3, 1e-3]))
def test_axes_that_are_nearly_parallel_cost_no_digits(angle: float):
    chain = tilted(random_chain(3, "RRRRRR", tidy=True), angle)
    representative, theta_b = known(chain)
    search = Search(chain, representative, theta_b, budget=40)
    program = search.rearranged(INVERSE, search.best(INVERSE, SINGLE), SINGLE)
    q, qd, qdd = states(6, 200)
    found = run(program, 6, 6, "tau", q=q, qd=qd, qdd=qdd)
    assert relative_error(found, Oracle(chain).rnea(q, qd, qdd)) < 1e-12
