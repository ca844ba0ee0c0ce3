"""Robots with a floating base, and branched ones on a fixed base: lowered, and run against Pinocchio."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from bundled import bundled_model
from pinocchio_robots import robot_at_hand
from random_trees import TREES, RandomTree, assert_near
from slow_cases import slow_but_for
from whole_robots import ROBOTS, WHOLE, derived, lowered

from psdmc.derivation.derive import derive_model
from psdmc.errors import DerivationError, InputError
from psdmc.functions import RECIPES
from psdmc.lower.factored import trace_dynamics
from psdmc.lower.kernels import lower
from psdmc.lower.search import Search
from psdmc.program.cost import SINGLE, cost
from psdmc.program.interpret import interpret
from psdmc.program.signature import Sizes
from psdmc.robot.mechanism import PARAMETERS_PER_LINK

COUNT = 20
AT_MOST = {
    ("anymal_b", "inverse_dynamics"): 1310,
    ("anymal_b", "mass_matrix"): 662,
    ("anymal_b", "forward_dynamics"): 2870,
    ("solo12", "inverse_dynamics"): 1110,
    ("solo12", "mass_matrix"): 580,
    ("solo12", "forward_dynamics"): 2450,
    ("allegro", "inverse_dynamics"): 945,
    ("allegro", "mass_matrix"): 422,
    ("allegro", "forward_dynamics"): 1357,
}
"""Multiplications and additions: bars for ANYmal; for the others what this took, rounded up."""

on_whole = pytest.mark.parametrize(("name", "floating"), WHOLE)
on_each = pytest.mark.parametrize(("name", "floating"), slow_but_for(WHOLE, ROBOTS, spread=True))


def run(name: str, floating: bool, function: str, **given: np.ndarray) -> np.ndarray:
    """The first output, flat per state; code for one state and for lanes agree."""
    model = derived(name, floating)[1]
    sizes = Sizes.of(model.mechanism, model.l)
    signature = RECIPES[function].signature
    kernel = lowered(name, floating)[function]
    one, lanes = (
        interpret(program, given, signature.sizes(sizes)) for program in (kernel.single, kernel.batch)
    )
    first = signature.outputs[0].name
    np.testing.assert_allclose(one[first], lanes[first], rtol=1e-9, atol=1e-9)
    for pivots in (one.get("pivot"), lanes.get("pivot")):
        assert pivots is None or np.all(pivots > 0.0)
    return one[first]


@on_each
def test_base_parameters_are_those_that_the_joints_do_not_hide(name: str, floating: bool) -> None:
    """Floating: ten a body less what each joint hides, three of one that turns; fixed: Pinocchio's rank."""
    robot, model = derived(name, floating)
    hidden = sum(joint.hidden for joint in robot.mechanism.types)
    if floating:
        assert model.l == 10 * model.n - hidden == 10 * model.n - 3 * (model.n - 1)
    q, qd, qdd = robot.motion(60)
    rows = robot.each(pin.computeJointTorqueRegressor, q, qd, qdd)
    assert model.l == np.linalg.matrix_rank(rows.reshape(-1, rows.shape[-1]), tol=1e-8)
    assert model.certificate.shape == (robot.mechanism.nv,)
    assert model.certificate.max() < 1e-13


@on_each
def test_torques_are_pinocchios(name: str, floating: bool) -> None:
    robot, model = derived(name, floating)
    q, qd, qdd = robot.motion(COUNT)
    expected = robot.each(pin.rnea, q, qd, qdd)
    assert_near(run(name, floating, "inverse_dynamics", q=q, qd=qd, qdd=qdd), expected)
    assert_near(model.inverse_dynamics(q, qd, qdd), expected)


@on_whole
def test_the_regressor_and_biases_are_pinocchios(name: str, floating: bool) -> None:
    robot, model = derived(name, floating)
    q, qd, qdd = robot.motion(COUNT)
    rows = run(name, floating, "regressor", q=q, qd=qd, qdd=qdd).reshape(COUNT, model.nv, model.l)
    assert_near(rows @ model.theta_b, robot.each(pin.rnea, q, qd, qdd))
    biases = robot.each(pin.nonLinearEffects, q, qd)
    assert_near(run(name, floating, "nonlinear_effects", q=q, qd=qd), biases)
    assert_near(run(name, floating, "gravity", q=q), robot.each(pin.computeGeneralizedGravity, q))


@on_each
def test_the_mass_matrix_and_what_follows_from_it_are_pinocchios(name: str, floating: bool) -> None:
    robot, model = derived(name, floating)
    q, qd, qdd = robot.motion(COUNT)
    half = np.triu(robot.each(pin.crba, q))
    expected = half + np.swapaxes(np.triu(half, 1), -1, -2)
    shape = (COUNT, model.nv, model.nv)
    assert_near(run(name, floating, "mass_matrix", q=q).reshape(shape), expected)
    condition = np.linalg.cond(expected).max()
    tau = robot.each(pin.rnea, q, qd, qdd)
    found = run(name, floating, "forward_dynamics", q=q, qd=qd, tau=tau)
    assert_near(found, robot.each(pin.aba, q, qd, tau), 1e-10 if condition < 1e6 else 1e-16 * condition)


@on_whole
def test_the_inverse_mass_matrix_is_numpys(name: str, floating: bool) -> None:
    robot, model = derived(name, floating)
    q, _, _ = robot.motion(COUNT)
    half = np.triu(robot.each(pin.crba, q))
    M = half + np.swapaxes(np.triu(half, 1), -1, -2)
    inverse = run(name, floating, "mass_matrix_inverse", q=q).reshape(M.shape)
    unit = np.broadcast_to(np.eye(model.nv), M.shape)
    np.testing.assert_allclose(inverse @ M, unit, atol=1e-15 * np.linalg.cond(M).max())


@on_whole
def test_energies_momentum_and_jacobians_are_pinocchios(name: str, floating: bool) -> None:
    robot, model = derived(name, floating)
    q, qd, _ = robot.motion(COUNT)

    def about_origin(pinocchio: pin.Model, data: pin.Data, at: np.ndarray, rates: np.ndarray) -> np.ndarray:
        h = pin.computeCentroidalMomentum(pinocchio, data, at, rates)
        return np.concatenate([h.linear, h.angular + np.cross(data.com[0], h.linear)])

    def tip_jacobian(pinocchio: pin.Model, data: pin.Data, at: np.ndarray) -> np.ndarray:
        joint = model.mechanism.tip_body + 1
        pin.computeJointJacobians(pinocchio, data, at)
        return pin.getJointJacobian(pinocchio, data, joint, pin.LOCAL_WORLD_ALIGNED)

    assert_near(run(name, floating, "momentum", q=q, qd=qd), robot.each(about_origin, q, qd), 1e-11)
    com = run(name, floating, "com_jacobian", q=q).reshape(COUNT, 3, model.nv)
    assert_near(com, robot.each(pin.jacobianCenterOfMass, q), 1e-11)
    centre = run(name, floating, "centre_of_mass", q=q)
    assert_near(centre, robot.each(pin.centerOfMass, q), 1e-11)
    found = run(name, floating, "centroidal_momentum_matrix", q=q).reshape(COUNT, 6, model.nv)
    expected = robot.each(pin.computeCentroidalMap, q)
    assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()
    jacobian = run(name, floating, "jacobian", q=q).reshape(COUNT, 6, model.nv)
    assert_near(jacobian, robot.each(tip_jacobian, q))
    kinetic = robot.each(pin.computeKineticEnergy, q, qd)
    assert_near(run(name, floating, "kinetic_energy", q=q, qd=qd), kinetic[:, None])
    neutral = np.array([[x for joint in model.mechanism.types for x in joint.neutral]])
    potential = robot.each(pin.computePotentialEnergy, q) - robot.each(pin.computePotentialEnergy, neutral)
    assert_near(run(name, floating, "potential_energy", q=q), potential[:, None])


@on_each
def test_operations(name: str, floating: bool) -> None:
    made = lowered(name, floating)
    found = {f: cost(made[f].single).total for f in ("inverse_dynamics", "mass_matrix", "forward_dynamics")}
    assert not {f: count for f, count in found.items() if count > AT_MOST[name, f]}


BOTH_WAYS = [*ROBOTS, ("baxter", False), ("talos", True)]


@pytest.mark.parametrize(("name", "floating"), slow_but_for(ROBOTS[1:], BOTH_WAYS, spread=True))
def test_both_ways_to_accelerations_give_the_same_and_the_cheaper_is_taken(name: str, floating: bool) -> None:
    robot, model = derived(name, floating)
    search = Search(robot.mechanism, model.representative, model.theta_b, budget=12)
    start = search.best(RECIPES["inverse_dynamics"], SINGLE)
    found = search.best(RECIPES["forward_dynamics"], SINGLE, start)
    q, qd, tau = robot.motion(COUNT)
    programs = {
        way: trace_dynamics(
            RECIPES["forward_dynamics"],
            replace(start, choices=replace(start.choices, articulated=way)),
            search.robot,
        )
        for way in (False, True)
    }
    sizes = {"qdd": model.nv, "pivot": model.nv}
    by_factors, by_bodies = (
        interpret(program, {"q": q, "qd": qd, "tau": tau}, sizes) for program in programs.values()
    )
    assert_near(by_bodies["qdd"], by_factors["qdd"], 1e-9)
    assert_near(by_bodies["qdd"], robot.each(pin.aba, q, qd, tau), 1e-9)
    torques = trace_dynamics(RECIPES["inverse_dynamics"], start, search.robot)
    found_tau = interpret(torques, {"q": q, "qd": qd, "qdd": tau}, {"tau": model.nv})["tau"]
    assert_near(found_tau, robot.each(pin.rnea, q, qd, tau))
    np.testing.assert_allclose(by_bodies["pivot"], by_factors["pivot"], rtol=1e-9)
    scores = {way: SINGLE.score(program) for way, program in programs.items()}
    assert found.choices.articulated is (scores[True] < scores[False])
    assert found.choices.articulated is (name != "allegro")  # fingers of four joints are too short


def test_a_serial_arm_keeps_its_factors() -> None:
    model = bundled_model("kr6")
    search = Search(model.mechanism, model.representative, model.theta_b, budget=12)
    start = search.best(RECIPES["inverse_dynamics"], SINGLE)
    assert not search.best(RECIPES["forward_dynamics"], SINGLE, start).choices.articulated


def test_e_and_p_of_a_floating_base_are_refused() -> None:
    robot = robot_at_hand("solo12", True)
    with pytest.raises(
        DerivationError, match="joint 'root_joint' moves freely: E and P are of joints of one"
    ):
        derive_model(robot.mechanism, expand=True)


SHAPES = ("a fork", "a trunk with two arms", "interleaved")
KINDS = ("FRPRRRRR", "SRFRPLTR", "RPLSRFRR", "TLRRSRRF")
EVERY_TYPE = [
    (TREES[shape], kinds, parallel) for parallel in (0.0, 0.6) for kinds in KINDS for shape in SHAPES
]
QUICK = [
    (TREES[shape], kinds, parallel)
    for shape, kinds, parallel in zip((*SHAPES, SHAPES[0]), KINDS, (0.0, 0.6, 0.6, 0.6), strict=True)
]
"""Every shape and every order of types once."""


@pytest.mark.parametrize(("parents", "kinds", "parallel"), slow_but_for(QUICK, EVERY_TYPE, spread=True))
def test_lowered_trees_with_joints_of_every_type_are_pinocchios(parents, kinds: str, parallel: float) -> None:
    """Wherever frames sit: those of joints of several coordinates stay, others are turned and moved towards them."""
    tree = RandomTree(41, parents, kinds, parallel)
    model = derive_model(tree.mechanism(), expand=False)
    search = Search(model.mechanism, model.representative, model.theta_b, budget=10)
    q, qd, qdd = tree.motion(COUNT)
    tau = tree.each(pin.rnea, q, qd, qdd)
    given = {"q": q, "qd": qd, "qdd": qdd, "tau": tau}
    sizes = {"tau": tree.nv, "qdd": tree.nv, "pivot": tree.nv}
    for feet in search.geometry.feet:
        for start in search.starts(feet):
            program = trace_dynamics(RECIPES["inverse_dynamics"], start, search.robot)
            assert_near(interpret(program, given, sizes)["tau"], tau, 1e-11)
        for way in (False, True):
            arranged = replace(start, choices=replace(start.choices, articulated=way))
            program = trace_dynamics(RECIPES["forward_dynamics"], arranged, search.robot)
            found = interpret(program, given, sizes)
            np.testing.assert_allclose(found["qdd"], qdd, atol=1e-6)
            assert np.all(found["pivot"] > 0.0)


@pytest.mark.parametrize(("kinds", "massless"), [("FRR", 2), ("FRR", 1), ("RSR", 2), ("RRS", 2)])
def test_the_joint_that_moves_no_inertia_is_named(kinds: str, massless: int) -> None:
    """By its name, although its rate's number is another joint's, or none's: a floating base has six, a ball joint three."""
    robot = RandomTree(34, TREES["a fork"], kinds).mechanism()
    own = slice(PARAMETERS_PER_LINK * massless, PARAMETERS_PER_LINK * (massless + 1))
    parameters = robot.parameters.copy()
    parameters[massless] = 0.0
    span = np.delete(robot.parameter_span, own, axis=1)
    model = derive_model(replace(robot, parameters=parameters, parameter_span=span))
    with pytest.raises(InputError, match=f"forward_dynamics: joint 'joint{massless}' moves no inertia"):
        lower(replace(model, theta_b=None), functions=["forward_dynamics"])
