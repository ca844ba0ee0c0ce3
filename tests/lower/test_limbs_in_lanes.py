"""Limbs in lanes: the same function as the straight line, chosen where it costs less."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from limbed import DERIVATIVES, FUNCTIONS, SHAPES, kernels, limbed, shape
from mimic_trees import as_urdf
from random_trees import RandomTree
from slow_cases import slow_but_for
from whole_robots import ROBOTS, WHOLE, derived, lowered

from psdmc.derivation.derive import derive_model
from psdmc.dynamics.frames import BASE, Mimic
from psdmc.functions import RECIPES
from psdmc.lower.factored import Arrangement, trace_dynamics
from psdmc.lower.kernels import lower
from psdmc.lower.limb_frames import possible_groups
from psdmc.lower.limb_search import usable_groups, weight
from psdmc.lower.limbs import cost_of_limbs, trace_limbs
from psdmc.lower.search import Search
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import states_of
from psdmc.program.cost import Cost, for_one_state
from psdmc.program.interpret import interpret
from psdmc.program.kernel import Kernel
from psdmc.program.limb_program import LimbProgram, unpacked
from psdmc.program.limb_stages import StageCost, stage_costs, staged
from psdmc.program.products import written_out
from psdmc.program.program import Program
from psdmc.program.signature import Sizes
from psdmc.recipes.recipe import Recipe
from psdmc.robot.coordinates import Coordinate, leaders
from psdmc.robot.limbs import Limbs
from psdmc.target.presets import COSTS, SCALAR

COUNT = 12
SAME = 1e-13
"""Of each entry's largest value: rounding of the same sums in another order."""
SOLVED = 1e-10
"""The same of accelerations, which a mass matrix's condition magnifies."""
QUICK = [name for name in SHAPES if name != "arms on a trunk, legs on its root"]
"""The largest is searched longest."""


def given_states(model: DynamicsModel, count: int = COUNT) -> dict[str, np.ndarray]:
    vectors = states_of(model.mechanism, np.random.default_rng(4), count)
    along = np.random.default_rng(5).uniform(-1.0, 1.0, (5, *vectors[1].shape))
    return (
        dict(zip(("q", "qd", "qdd"), vectors, strict=True))
        | {"tau": 3.0 * vectors[2]}
        | dict(zip(("cotangent", "dq", "dqd", "dqdd", "dtau"), along, strict=True))
    )


def values(program: Program, function: str, model: DynamicsModel) -> dict[str, np.ndarray]:
    return interpret(
        program, given_states(model), RECIPES[function].signature.sizes(Sizes.of(model.mechanism, model.l))
    )


def assert_same(found: dict[str, np.ndarray], wanted: dict[str, np.ndarray], exact: float) -> None:
    assert found.keys() == wanted.keys()
    for name, expected in wanted.items():
        largest = np.abs(expected).max(axis=0)
        allowed = exact * np.maximum(largest, 1e-3 * largest.max())
        error = np.abs(found[name] - expected)
        assert np.all(error <= allowed), (error / allowed).max() * exact


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize("name", slow_but_for(QUICK, SHAPES))
def test_written_out_it_is_the_straight_line(name: str, function: str) -> None:
    model, kernel = shape(name)[1], kernels(name)[function]
    if kernel.limbs is None:
        pytest.skip("does not pay")

    found = values(unpacked(kernel.limbs), function, model)

    assert_same(
        found, values(kernel.single, function, model), SOLVED if function == "forward_dynamics" else SAME
    )


def worth_something(stages: Iterable[StageCost]) -> list[StageCost]:
    """Stages that cost anything: those that only keep or load values are in no count."""
    return [
        each for each in stages if replace(each, group=None) != StageCost(None, Cost(0, 0, 0, 0, 0, 0), 0, 0)
    ]


def counted_without_cutting(
    recipe: Recipe, arrangement: Arrangement, search: Search, groups: Sequence[Limbs]
) -> list[StageCost]:
    """What the search compares arrangements by."""
    return worth_something(cost_of_limbs(recipe, arrangement, search.robot, groups)[1])


@settings(max_examples=12, deadline=None)
@given(
    seed=some.integers(0, 10_000),
    trunk=some.sampled_from(["", "F", "R", "FR", "SR"]),
    chain=some.text("RP", min_size=1, max_size=3),
    count=some.integers(2, 5),
    parallel=some.sampled_from([0.0, 0.3, 0.8, 1.0]),
    function=some.sampled_from([*FUNCTIONS, *DERIVATIVES]),
)
def test_any_equal_limbs(
    seed: int, trunk: str, chain: str, count: int, parallel: float, function: str
) -> None:
    """Whether it pays or not, by every way to see limbs: frames turned by any angle, or alike but for signs."""
    tree = limbed(seed, trunk, [(len(trunk) - 1, chain, count)], parallel)
    model = derive_model(tree.mechanism(), expand=False)
    search = Search(model.mechanism, model.representative, model.theta_b)
    start = next(search.starts(search.geometry.feet[0]))
    start = replace(
        start,
        choices=replace(start.choices, articulated=bool(trunk), fold=seed % 2 == 0, compound=seed % 3 == 0),
    )
    recipe = RECIPES[function]
    whole = written_out(trace_dynamics(recipe, start, search.robot), recipe.signature.products)
    wanted = values(whole, function, model)
    assert [len(limbs) for limbs in possible_groups(start.reframed.frames)[0]] == [count]
    ways = usable_groups(recipe, start, search.robot)
    assert ways or (
        function == "regressor" and not trunk
    )  # on the base, gravity hides parameters of some limbs alone

    for groups in ways:
        traced = trace_limbs(recipe, start, search.robot, groups)
        cut = LimbProgram(traced.groups, staged(traced.program, traced.groups), products=traced.products)
        assert counted_without_cutting(recipe, start, search, groups) == worth_something(stage_costs(cut))
        found = unpacked(cut)
        assert_same(values(found, function, model), wanted, SOLVED if recipe.signature.factorises else 1e-12)


@pytest.mark.parametrize(("name", "floating"), slow_but_for(WHOLE, ROBOTS, spread=True))
def test_real_robots_limbs_run_in_lanes_and_agree_with_pinocchio(name: str, floating: bool) -> None:
    theirs, model = derived(name, floating)
    made = lowered(name, floating)
    q, qd, qdd = theirs.motion(COUNT)
    tau = theirs.each(pin.rnea, q, qd, qdd)
    states, sizes = {"q": q, "qd": qd, "qdd": qdd, "tau": tau}, Sizes.of(model.mechanism, model.l)

    def found(function: str) -> dict[str, np.ndarray]:
        limbs = made[function].limbs
        assert limbs is not None
        return interpret(unpacked(limbs), states, RECIPES[function].signature.sizes(sizes))

    upper = np.triu(theirs.each(pin.crba, q))
    mass = upper + np.triu(upper, 1).transpose(0, 2, 1)
    assert_same({"tau": found("inverse_dynamics")["tau"]}, {"tau": tau}, 1e-12)
    assert_same({"M": found("mass_matrix")["M"]}, {"M": mass.reshape(COUNT, -1)}, 1e-12)
    accelerated = found("forward_dynamics")
    assert np.all(accelerated["pivot"] > 0.0)
    assert_same({"qdd": accelerated["qdd"]}, {"qdd": qdd}, 1e-10)
    if "regressor" in made and floating:
        whole = found("regressor")["Y"].reshape(COUNT, model.nv, model.l)
        assert_same({"tau": whole @ model.known_theta_b()}, {"tau": tau}, 1e-12)
    if "nonlinear_effects" in made:
        h = theirs.each(pin.nonLinearEffects, q, qd)
        assert_same(found("nonlinear_effects"), {"h": h}, 1e-12)


@pytest.mark.parametrize("name", slow_but_for(QUICK, SHAPES))
def test_it_is_taken_only_where_it_costs_less(name: str) -> None:
    taken = {function: kernel for function, kernel in kernels(name).items() if kernel.limbs}
    for kernel in taken.values():
        assert kernel.limbs is not None
        straight = for_one_state(COSTS).score(kernel.single)
        for lanes in (2, 4, 8):
            if lanes >= kernel.limbs.least:
                assert weight(kernel.limbs, lanes, COSTS) * COSTS.worth_limbs < straight


def test_a_function_that_shares_an_arrangement_has_its_limbs_in_it() -> None:
    """Alone or beside the function whose arrangement it shares: the same."""
    model, together = shape("four legs of a floating body")[1], kernels("four legs of a floating body")
    alone = lower(model, "factored", ["nonlinear_effects"], theta_variants=False)["nonlinear_effects"]
    assert alone.limbs is not None
    assert alone.limbs == together["nonlinear_effects"].limbs
    shared = together["inverse_dynamics"].limbs
    assert shared is not None
    assert weight(alone.limbs, 4, COSTS) < weight(shared, 4, COSTS)


def test_four_legs_pay_and_two_stubs_on_an_arm_do_not() -> None:
    legs = kernels("four legs of a floating body")
    assert legs["inverse_dynamics"].limbs is not None
    assert legs["mass_matrix"].limbs is not None
    assert legs["forward_dynamics"].limbs is not None
    arm = limbed(3, "RRRRRR", [(5, "P", 2)])
    made = lower(
        derive_model(arm.mechanism(), expand=False), "factored", ["inverse_dynamics"], theta_variants=False
    )
    assert made["inverse_dynamics"].limbs is None


def test_no_lanes_for_theta_for_batches_and_for_machines_without_vectors() -> None:
    model = shape("three fingers on a wrist")[1]
    plain = lower(model, "factored", ["inverse_dynamics"], costs=SCALAR.costs)
    made: dict[str, Kernel] = lower(model, "factored", ["inverse_dynamics"])
    assert plain["inverse_dynamics"].limbs is None
    assert made["inverse_dynamics_theta"].limbs is None
    assert made["inverse_dynamics"].limbs is not None


FOLLOWING = (
    *(Coordinate(0), Coordinate(1)),
    *(Coordinate(2), Coordinate(3), Coordinate(3, -0.7, 0.2)),
    *(Coordinate(5), Coordinate(6), Coordinate(6, 1.3, -0.4)),
    *(Coordinate(8), Coordinate(9), Coordinate(9, 0.5)),
)
"""A wrist of two joints with three fingers, whose last joints follow the ones before, by other ratios on each."""


@pytest.mark.parametrize("kinds", ["RRRRRRRRRRR", "RPRPPRPPRPP"])
@pytest.mark.parametrize("function", ["inverse_dynamics", "mass_matrix"])
def test_fingers_that_bend_by_themselves_are_limbs(function: str, kinds: str) -> None:
    """Written out, against Pinocchio's mimic joints."""
    tree = RandomTree(5, (BASE, 0, 1, 2, 3, 1, 5, 6, 1, 8, 9), kinds)
    robot = replace(tree.mechanism(), coordinates=FOLLOWING)
    model = derive_model(replace(robot, parameters=robot.parameters * ([1.0] * 10 + [0.0])), expand=False)
    search = Search(model.mechanism, model.representative, model.theta_b)
    start = next(search.starts(search.geometry.feet[0]))
    (groups, *_) = possible_groups(start.reframed.frames)
    assert groups == (((2, 3, 4), (5, 6, 7), (8, 9, 10)),)

    traced = trace_limbs(RECIPES[function], start, search.robot, groups)
    program = unpacked(LimbProgram(traced.groups, staged(traced.program, traced.groups)))

    oracle = pin.buildModelFromXML(as_urdf(tree, FOLLOWING), mimic=True)
    oracle.gravity.linear = tree.gravity.copy()
    data, given = oracle.createData(), given_states(model)
    order = [oracle.joints[oracle.getJointId(f"joint{i}")].idx_v for i in leaders(FOLLOWING)]

    def theirs(k: int) -> np.ndarray:
        states = np.zeros((3, model.nv))
        states[:, order] = [given[name][k] for name in ("q", "qd", "qdd")]
        if function == "inverse_dynamics":
            return pin.rnea(oracle, data, *states)[order]
        upper = np.triu(pin.crba(oracle, data, states[0]))
        return (upper + np.triu(upper, 1).T)[np.ix_(order, order)].ravel()

    (name,) = values(program, function, model)
    assert_same(values(program, function, model), {name: np.array([theirs(k) for k in range(COUNT)])}, 1e-12)


def test_limbs_whose_joints_follow_beyond_them_are_none() -> None:
    frames = list(
        Search(model := shape("two arms on the base")[1].mechanism, np.eye(11 * len(model)), None)
        .geometry.reframed(("previous",) * 6)
        .frames
    )
    assert possible_groups(frames)
    one = frames.copy()
    one[5] = replace(one[5], mimic=Mimic(((4, 1.0),), 0.0))
    assert possible_groups(one) == ()
    across = frames.copy()
    across[2], across[5] = (
        replace(frames[i], mimic=Mimic(((leader, 1.0),), 0.0)) for i, leader in ((2, 4), (5, 1))
    )
    assert possible_groups(across) == ()
    unlike = frames.copy()
    unlike[2], unlike[5] = (
        replace(frames[i], mimic=Mimic(((leader, 1.0),), 0.0)) for i, leader in ((2, 0), (5, 4))
    )
    assert possible_groups(unlike) == ()
    assert frames[0].parent == BASE
