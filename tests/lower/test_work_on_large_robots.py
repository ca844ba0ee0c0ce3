"""What lowering of a large robot tries: counted in traces, exchanges and bodies, not in time."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from random_trees import RandomTree

from psdmc.derivation.derive import derive_model
from psdmc.dynamics import motion
from psdmc.dynamics.choices import ByChoices, Choices
from psdmc.functions import RECIPES
from psdmc.lower import carriers, kernels, limb_search, search
from psdmc.lower.branches import limbs_in
from psdmc.lower.carriers import Tableau
from psdmc.lower.factored import Arrangement, Recording, RobotConstants, trace_dynamics
from psdmc.lower.limb_frames import possible_groups
from psdmc.lower.limb_search import LimbSearch
from psdmc.lower.link_parameters import STATES, _sampled_columns
from psdmc.lower.search import ALL_CHOICES, Search
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program import pipeline
from psdmc.program.cost import cost
from psdmc.program.program import Program
from psdmc.program.text import parse
from psdmc.recipes.recipe import Recipe
from psdmc.robot.coordinates import Coordinate
from psdmc.robot.mechanism import PARAMETERS_PER_LINK
from psdmc.target.presets import COSTS

ARM, FINGERS, FINGER = 2, 2, 2
HAND = FINGERS * FINGER
"""Joints of an arm, its fingers, and joints of each."""


def humanoid() -> tuple[int, ...]:
    """Parents of a free trunk with two arms, which have fingers."""
    parents = [-1]
    for _ in range(2):
        parents += [0, *range(len(parents), len(parents) + ARM - 1)]
        wrist = len(parents) - 1
        for _ in range(FINGERS):
            parents += [wrist, *range(len(parents), len(parents) + FINGER - 1)]
    return tuple(parents)


def drop_last(program: Program) -> Program:
    """One operation fewer, if there are two."""
    if len(program) < 4:
        return program
    return Program(program.body[:-1], tuple((slot, len(program) - 2) for slot, _ in program.outputs))


PARENTS = humanoid()
COUNT = len(PARENTS)
ENDS = [i for i in range(COUNT) if i not in PARENTS]
MIMIC = tuple(Coordinate(i - 1 if i in ENDS else i, 0.5 if i in ENDS else 1.0) for i in range(COUNT))
"""Each finger's last joint follows the one before."""


@cache
def derived(mimic: bool = False) -> DynamicsModel:
    robot = RandomTree(11, PARENTS, "F" + "R" * (COUNT - 1), 0.5).mechanism()
    if mimic:
        robot = replace(robot, coordinates=MIMIC)
    return derive_model(robot, expand=False)


@cache
def searched(mimic: bool = False) -> tuple[Search, Arrangement]:
    model = derived(mimic)
    found = Search(model.mechanism, model.representative, model.theta_b)
    return found, next(found.starts(found.geometry.feet[0]))


def test_a_finger_that_no_exchange_makes_accurate_is_given_up_after_the_search_s_budget() -> None:
    """example-robot-data's Romeo: thousands of exchanges were traced and run for each of its functions."""
    found, start = searched()
    few = Search(
        found.robot.chain, found.robot.representative, found.robot.theta_b, 60, geometry=found.geometry
    )
    measured: list[Arrangement] = []

    def error_of(arrangement: Arrangement) -> float:
        """Each a little better than the last, and none good enough."""
        measured.append(arrangement)
        assert len(measured) <= few.budget + 5
        return 1.0 - 1e-6 * len(measured)

    taken = few._accurate([start], error_of)

    assert few.budget < len(list(found._exchanges(start)))
    assert taken in measured


@pytest.mark.parametrize(
    ("name", "many"), [("OPERATIONS", COUNT), ("OPERATIONS_OF_LARGE", COUNT - 1)], ids=["usual", "large"]
)
def test_choices_are_compared_on_so_many_operations_and_the_found_ones_first(
    monkeypatch: pytest.MonkeyPatch, name: str, many: int
) -> None:
    monkeypatch.setattr(search, "MANY_JOINTS", many)
    found, start = searched()
    recipe = RECIPES["coriolis_matrix"]
    start = replace(start, choices=replace(start.choices, fold=True))
    traced: list[Choices] = []
    record = Recording.of

    def counted(recipe: Recipe, arrangement: Arrangement, robot: RobotConstants) -> Recording:
        traced.append(arrangement.choices.choices)
        return record(recipe, arrangement, robot)

    monkeypatch.setattr(Recording, "of", staticmethod(counted))
    monkeypatch.setattr(found, "_costs", ByChoices())
    (*programs,) = found.rearrangements(recipe, start)
    assert many == COUNT or len(programs) == 1
    every = len(traced)
    assert every == len(set(traced))  # what is taken is not traced again
    longest = max(cost(program).total for program in programs)
    for limit, least in ((0, 1), (2.5 * longest, 2)):
        traced.clear()
        monkeypatch.setattr(found, "_costs", ByChoices())
        monkeypatch.setattr(search, name, limit)

        assert list(found.rearrangements(recipe, start))
        assert traced[0] == start.choices
        assert least <= len(traced) <= max(1, limit / (0.8 * longest)) < every


@pytest.mark.parametrize("function", ["inverse_dynamics", "mass_matrix"])
def test_choices_that_a_trace_does_not_tell_apart_are_traced_once(
    monkeypatch: pytest.MonkeyPatch, function: str
) -> None:
    """And have the cost of their own traces."""
    found, start = searched()
    monkeypatch.setattr(found, "_costs", ByChoices())
    recipe, traced, record = RECIPES[function], [], Recording.of
    monkeypatch.setattr(Recording, "of", staticmethod(lambda *given: traced.append(given) or record(*given)))
    arranged = [replace(start, choices=choices) for choices in ALL_CHOICES]

    counted = [found.cost(recipe, each) for each in arranged]

    assert len(traced) < len(arranged)
    assert counted == [cost(trace_dynamics(recipe, each, found.robot)) for each in arranged]
    assert len(set(counted)) > 1


@pytest.mark.parametrize(("many", "rounds"), [(COUNT, 2), (COUNT - 1, 1)], ids=["usual", "large"])
def test_rounds_of_passes_end_from_so_many_joints_on_when_one_saves_little(
    monkeypatch: pytest.MonkeyPatch, many: int, rounds: int
) -> None:
    """A second round would find that there is nothing left to do."""
    monkeypatch.setattr(search, "MANY_JOINTS", many)
    monkeypatch.setattr(pipeline, "LITTLE", 1.0)
    monkeypatch.setattr(pipeline, "LONG_OF_LARGE", 4)
    applied: list[object] = []
    monkeypatch.setattr(pipeline, "ROUND", (lambda program: applied.append(program) or drop_last(program),))
    lowered = kernels._Lowered(derived(), "factored", COSTS)

    lowered._shortened(parse("a = load q[0]\nb = add a a\nc = add b b\nd = add c c\nout tau[0] = d"))

    assert len(applied) == rounds


def test_carriers_of_equal_weights_are_chosen_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """All functions' searches start from the same ones."""
    found, _ = searched()
    space = replace(found.geometry.space(found.geometry.reframed(found.geometry.feet[0])))
    calls: list[object] = []
    choose = carriers.lightest
    monkeypatch.setattr(carriers, "lightest", lambda *given: calls.append(given) or choose(*given))

    chosen = [space.lightest([weight] * space.count) for weight in (1.0, 2.0, 1.0, 2.0)]

    assert len(calls) == 2
    assert chosen[0] == chosen[2]
    assert chosen[1] == chosen[3]


@pytest.mark.parametrize("many", [COUNT, COUNT - 1], ids=["usual", "large"])
def test_exchanges_in_lanes_are_fewer_from_so_many_joints_on(
    monkeypatch: pytest.MonkeyPatch, many: int
) -> None:
    monkeypatch.setattr(limb_search, "MANY_JOINTS", many)
    monkeypatch.setattr(limb_search, "BUDGET", 7)
    monkeypatch.setattr(limb_search, "BUDGET_OF_LARGE", 3)
    found, start = searched()
    one = LimbSearch(found, RECIPES["inverse_dynamics"], COSTS)
    tried: list[Arrangement] = []
    monkeypatch.setattr(one, "_expected", lambda best, candidate: tried.append(candidate) or np.inf)

    one._descended(one._weighed(start, possible_groups(start.reframed.frames)[0]))

    assert len(tried) == (7 if many == COUNT else 3)


def test_samples_of_a_large_robot_have_twice_as_many_rows_as_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    found, start = searched(mimic=True)
    frames = start.reframed.frames
    columns, rates = PARAMETERS_PER_LINK * COUNT, found.robot.sizes.nv

    rows = len(_sampled_columns(start.reframed))

    assert 2 * columns <= rows < 2 * columns + rates < STATES * rates
    assert (
        len(
            _sampled_columns(
                replace(start.reframed, frames=frames[:1], link_frames=start.reframed.link_frames[:1])
            )
        )
        == STATES * 6
    )


def test_an_exchange_in_one_finger_is_weighed_on_that_finger_of_each_hand() -> None:
    """Not on whole arms with their hands."""
    found, start = searched()
    groups = possible_groups(start.reframed.frames)[0]
    (arms,) = groups
    assert [len(limb) for limb in arms] == [ARM + HAND] * 2
    one = LimbSearch(found, RECIPES["inverse_dynamics"], COSTS)
    kept = Counter(
        len(found.branches.changed(RECIPES["inverse_dynamics"], start, each, groups) or PARENTS)
        for each in one._exchanged(start, groups)
    )

    assert kept[1 + 2 * (ARM + FINGER)] >= kept.total() / 2
    one_finger = (0, *(joint for limb in arms for joint in limb[: ARM + FINGER]))
    assert [len(limb) for limb in limbs_in(groups, tuple(sorted(one_finger)))[0]] == [ARM + FINGER] * 2


@pytest.mark.parametrize("function", ["inverse_dynamics", "mass_matrix"])
def test_exchanges_of_robots_with_mimic_joints_are_told_from_branches(function: str) -> None:
    found, start = searched(mimic=True)
    recipe = RECIPES[function]
    expected = found._expected(recipe, found.single, start)
    told = [
        (expected(each), found.single.weight(found.cost(recipe, each)))
        for each in list(found._exchanges(start))[::9]
        if found.branches.changed(recipe, start, each) is not None
    ]

    assert len(told) >= 10
    missed = np.abs(np.diff(np.array(told), axis=1))
    assert np.quantile(missed, 0.75) <= 1.0
    assert missed.max() <= 6.0  # tests/lower/test_branches.py


def test_a_column_of_the_coriolis_matrix_sweeps_what_its_joint_moves_and_what_carries_that(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The whole robot for the first rates, then each joint's column a path and a branch: far fewer than n^2 bodies."""
    found, start = searched()
    swept = Counter[str]()
    for name in ("_swept", "_swept_freely"):
        original = getattr(motion, name)

        def counted(*arguments: object, name: str = name, original=original) -> object:
            swept[name] += 1
            return original(*arguments)

        monkeypatch.setattr(motion, name, counted)

    trace_dynamics(RECIPES["coriolis_matrix"], start, found.robot)

    ancestors = {i: {i} for i in range(COUNT)}
    for i, parent in enumerate(PARENTS):
        ancestors[i] |= ancestors.get(parent, set())
    pairs = sum(len(each) for each in ancestors.values())
    own = {j: sum(j in each or i in ancestors[j] for i, each in ancestors.items()) for j in range(COUNT)}
    assert pairs < COUNT**2 / 2
    assert swept.total() == 6 * COUNT + sum(own[j] for j in range(1, COUNT))


@pytest.mark.parametrize("share", [0.02, 0.2, 1.0])
def test_zeros_of_other_branches_are_left_out_of_elimination(share: float) -> None:
    """The same numbers, whether they are or not."""
    rng = np.random.default_rng(5)
    columns = np.where(rng.random((60, 140)) < share, rng.normal(size=(60, 140)), 0.0).astype(np.longdouble)
    basis = tuple(range(0, 120, 2))
    columns[range(60), list(basis)] += 3.0

    entries = Tableau.of(columns, basis).entries

    assert np.abs(columns[:, list(basis)].astype(float) @ entries.astype(float) - columns).max() < 1e-10
