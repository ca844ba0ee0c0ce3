"""The short form of `make campaign`: some random robots of each style; and the campaign finds what is wrong."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from campaign_contacts import contact_errors, random_contact_robot
from campaign_draw import FIRST_CONTACTS, FIRST_TREE, described, robot_of
from campaign_journal import append, read, report, summary
from campaign_lowered import FUNCTIONS, _answered
from campaign_measure import EXPANDED_JOINTS, Found, failures, measured
from campaign_oracles import Pinocchio, Textbook
from campaign_reference import Reference, random_states
from campaign_robots import LARGEST, STYLES, TILTS, random_robot
from campaign_run import is_lowered, outcome, seed_range
from campaign_trees import FEWEST, MOST, random_tree
from slow_cases import slow_but_for
from unoptimised import without_optimisation

from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.functions import RECIPES
from psdmc.lower.kernels import Lowering, lower
from psdmc.lower.search import BUDGET, Search
from psdmc.program.interpret import interpret
from psdmc.robot.load import LoadedRobot, load_robot_text

Array = np.ndarray

SEEDS = range(40)
TREES = range(FIRST_TREE, FIRST_TREE + 16)
STATES = 40


def failing(seed: int, *, lowered: bool = False) -> dict[str, float]:
    return failures(measured(seed, STATES, lowered=lowered).errors)


SMALL = [seed for seed in SEEDS if len(random_robot(seed).joints) < EXPANDED_JOINTS]


@pytest.mark.parametrize("seed", slow_but_for(SMALL[:12], SMALL))
def test_a_random_robot(seed: int) -> None:
    assert failing(seed) == {}


@pytest.mark.parametrize("seed", slow_but_for(TREES[:6], TREES))
def test_a_random_tree(seed: int) -> None:
    found = measured(seed, STATES, lowered=False)
    assert failures(found.errors) == {}
    assert "snap 0, base parameters inverse_dynamics" in found.errors or found.refused


@pytest.mark.parametrize("seed", [453, 989, 4495, 577, 2057, 1927, 7157, 2327])
def test_robots_that_the_campaign_found(seed: int) -> None:
    """989: a column of size 1e-9 as a pivot, E and P off by 5e-11. 4495: a micrometre's square taken for rounding in B, mass
    matrix 2e-11. Of many scales: 577, base parameters by double precision, 3e-11; 2057, a heavy link's inertia in a light
    one's base parameter, 7e-10; 1927, the same as 4495, 7e-11; 7157, all lengths below a millimetre and metres to slide,
    4e-9 in E and P; 2327, coefficients of 1e-15 left out of E and P, 1.5e-11."""
    found = measured(seed, STATES, lowered=False)
    assert found.refused == {}
    assert failures(found.errors) == {}


@pytest.mark.parametrize("seed", [FIRST_TREE + 160, FIRST_TREE + 180, FIRST_TREE + 303])
def test_trees_that_the_campaign_found(seed: int) -> None:
    """160: two base parameters of joints that follow others, of an effect of 1e-10, were left out: torques off by 7e-11.
    180: a trunk without a body, whose branches share its torque: the tiny effect of one was a pivot for all of the other's,
    coefficients of 2e10, an InternalError. 303: among joints that follow others, an effect of 7e-15 was a pivot before
    larger ones."""
    found = measured(seed, STATES, lowered=False)
    assert found.refused == {}
    assert failures(found.errors) == {}


@pytest.mark.parametrize(("seed", "joint"), [(2127, "joint3"), (317, "joint4")])
def test_robots_whose_last_digits_decide_are_refused(seed: int, joint: str) -> None:
    """2127: psdmc reads 1.5707963267948966 as a right angle, Pinocchio as 6e-17 less: 2.5e-9 of a torque. 317: 4e-10 once;
    another last digit of its numbers moves the torque by 5e-11."""
    found = measured(seed, STATES, lowered=False)
    assert found.errors == {}
    assert f"joint '{joint}'" in found.refused["snap 0"]
    assert "the last digit of the robot's numbers" in found.refused["snap 0"]


def test_a_robot_beyond_the_declared_limits_is_refused_by_them() -> None:
    """1687: no length above 9.8e-7 m."""
    found = measured(1687, STATES, lowered=False)
    assert "the longest of all its lengths" in found.refused["file"]
    assert found.errors == {}


WRONG = [2035, 2057, 2207, 4387, 287, 57]


@pytest.mark.parametrize("seed", slow_but_for([2057], WRONG))
def test_robots_whose_programs_the_campaign_found_wrong(
    seed: int, tmp_path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """2035: 25 carriers by singular values where there are 24, and a PROGRAM off by 2.5e-10. Of many scales: 2207, a mass
    matrix without what a large joint's torque hides, 3e-6; 2057, 3e-10 where the other joint's torque is asked; 4387, frames
    on feet where a light body's inertia is lost, 2e-11; 287, a joint of 1e-10 N m beside one of 1e4: wherever frames sit,
    carriers lose what it feels, 2e-10; 57, so do all frames but the file's own, 4e-11."""
    monkeypatch.setenv("PSDMC_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr("campaign_lowered._compiled", lambda *_: iter(()))
    assert failing(seed, lowered=True) == {}


@pytest.mark.parametrize("budget", slow_but_for([6], [6, BUDGET]))
def test_no_search_takes_an_arrangement_that_loses_digits(budget: int) -> None:
    """5867, of many scales: the cheapest arrangement is off by 1e-10, the lightest carriers by 1.3e-11."""
    robot = random_robot(5867)
    chain = load_robot_text(robot.text, "urdf").chain
    model = derive_model(chain, expand=False)
    search, recipe = Search(chain, model.representative, model.theta_b, budget), RECIPES["inverse_dynamics"]
    states = random_states(robot.seed, model.n, 1000)
    given = dict(zip(("q", "qd", "qdd"), states, strict=True))
    expected = Textbook(Pinocchio.of_chain(chain)).torques(*states)
    for program in search.rearrangements(recipe, search.best(recipe, search.single)):
        found = interpret(program, given, {"tau": model.n})["tau"]
        assert np.all(np.abs(found - expected).max(axis=0) <= 1e-11 * np.abs(expected).max(axis=0))


@pytest.mark.parametrize(("seed", "lowering"), [(637, "expanded"), (897, "factored")])
def test_no_mass_matrix_loses_the_digits_of_a_small_row(seed: int, lowering: Lowering) -> None:
    """637, of many scales: coefficients of theta_b left out that a small joint feels, 9e-11 of the row's largest entry; 897:
    an arrangement that is right to 2e-13 of each torque, most of which is gravity's, and to 2e-11 of a row."""
    robot = random_robot(seed)
    chain = load_robot_text(robot.text, "urdf", snap=0.0).mechanism
    model = derive_model(chain, expand=lowering == "expanded")
    states = random_states(robot.seed, model.n, STATES)
    reference = Reference.of(Textbook(Pinocchio.of_robot(robot)), states)
    for kernel in lower(model, lowering, ["mass_matrix"]).values():
        assert kernel.lowering == lowering
        given = {"q": states[0], "theta_b": model.theta_b}
        found = interpret(kernel.single, given, {"M": model.n**2})["M"]
        assert reference.mass_error(found.reshape(-1, model.n, model.n)) < 2e-12


def test_no_accelerations_are_accepted_only_where_the_precision_leaves_none() -> None:
    for seed, real, is_accepted in ((0, "float32", False), (9897, "float32", True), (9897, "float64", False)):
        robot = random_robot(seed)
        states = random_states(seed, len(robot.joints), STATES)
        reference = Reference.of(Textbook(Pinocchio.of_robot(robot)), states)
        none = np.full_like(reference.few[2], np.nan)
        assert (reference.acceleration_error(_answered(none, reference, real)) <= 1e-11) is is_accepted


def assert_right_when_lowered(seed: int) -> None:
    with without_optimisation():
        errors = measured(seed, STATES, lowered=True).errors
    assert failures(errors) == {}
    for function in FUNCTIONS:
        assert any(what.endswith(f"C auto float64 inline {function}") for what in errors)
        assert any(f"PROGRAM factored {function} batch" in what for what in errors)


@pytest.mark.parametrize("mixed", slow_but_for([True], [False, True]))
def test_a_random_robot_lowered_and_compiled(mixed: bool, tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PSDMC_CACHE_DIR", str(tmp_path))
    robots = map(random_robot, range(400))
    seed = next(robot.seed for robot in robots if len(robot.joints) == 2 and robot.is_mixed is mixed)
    assert_right_when_lowered(seed)


@pytest.mark.slow
def test_a_random_tree_lowered_and_compiled(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A floating base, and joints that follow others."""
    monkeypatch.setenv("PSDMC_CACHE_DIR", str(tmp_path))
    robots = map(random_tree, range(FIRST_TREE, FIRST_TREE + 1000))
    seed = next(
        r.seed for r in robots if len(r.joints) == 4 and r.is_floating and r.mimics and not r.is_light
    )
    assert_right_when_lowered(seed)


def test_trees_are_of_all_kinds() -> None:
    robots = [random_tree(seed) for seed in range(FIRST_TREE, FIRST_TREE + 300)]
    assert {robot.style for robot in robots} == set(STYLES)
    assert {len(robot.joints) for robot in robots} == set(range(FEWEST, MOST + 1))
    assert {name for robot in robots for name in robot.options} == {"lock", "floating", "base", "tip"}
    assert any(robot.is_light for robot in robots)
    assert any(robot.is_mixed for robot in robots)
    mimics = [(robot, one) for robot in robots for one in robot.mimics.values()]
    assert any(one.leader in robot.mimics for robot, one in mimics)
    assert any(one.ratio == 0.0 for _, one in mimics)
    assert any(robot.joints.index(one.leader) > 0 and one.leader in robot.held for robot, one in mimics)
    text = "".join(robot.text for robot in robots)
    assert all(f"type='{kind}'" in text for kind in ("revolute", "continuous", "prismatic", "fixed"))


@pytest.mark.parametrize("forgotten", [("lock",), ("floating",), ("base", "tip")])
def test_an_option_that_psdmc_forgets_is_seen(
    forgotten: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    def read(text: str, kind: str, **options: object) -> LoadedRobot:
        left = {name: value for name, value in options.items() if name not in forgotten}
        return load_robot_text(text, kind, **left)

    robots = map(random_tree, range(FIRST_TREE, FIRST_TREE + 300))
    robot = next(r for r in robots if forgotten[-1] in r.options and not r.mimics)
    monkeypatch.setattr("campaign_measure.load_robot_text", read)
    with pytest.raises((AssertionError, InputError), match=r"coordinates|shape"):
        measured(robot.seed, STATES, lowered=False)


def test_a_ratio_that_is_a_little_off_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    robots = map(random_tree, range(FIRST_TREE, FIRST_TREE + 300))
    robot = next(r for r in robots if any(one.ratio for one in r.mimics.values()) and not r.options)
    mimics = {name: replace(one, ratio=one.ratio * (1.0 + 1e-9)) for name, one in robot.mimics.items()}
    monkeypatch.setattr("campaign_measure.robot_of", lambda seed: replace(robot, mimics=mimics))
    assert failures(measured(robot.seed, STATES, lowered=False).errors)


def test_robots_are_of_all_kinds() -> None:
    robots = [random_robot(seed) for seed in range(300)]
    assert {robot.style for robot in robots} == set(STYLES)
    assert {len(robot.joints) for robot in robots} == set(range(1, LARGEST + 1))
    tilts = [tilt for robot in robots for tilt in robot.tilts]
    assert min(tilts) < 10 * TILTS[0]
    assert max(tilts) > TILTS[1] / 10
    text = "".join(robot.text for robot in robots)
    assert all(f"type='{kind}'" in text for kind in ("revolute", "continuous", "prismatic", "fixed"))


def test_a_seed_is_a_robot() -> None:
    assert random_robot(7).text == random_robot(7).text != random_robot(8).text
    assert robot_of(7) == random_robot(7)
    tree = robot_of(FIRST_TREE + 5)
    assert tree == random_tree(FIRST_TREE + 5) != random_tree(FIRST_TREE + 6)
    assert (
        described(tree) == "5 joints, 1 of them mimic joints, tilted, tilts 8e-09 to 0.04 rad, floating True"
    )


def test_robots_with_contacts_and_loops_are_of_all_kinds() -> None:
    robots = [random_contact_robot(FIRST_CONTACTS + k) for k in (3, 4, 6, 7)]
    assert {*"".join(robot.kinds for robot in robots)} == {*"RPS"}
    mechanisms = [robot.loaded.mechanism for robot in robots]
    assert {robot.has_floating_base for robot in mechanisms} == {True, False}
    assert {len(robot.loops) for robot in mechanisms} == {0, 1, 2}
    assert {len(robot.contacts) for robot in mechanisms} == {1, 2, 3}
    assert {rows for robot in mechanisms for rows in robot.rows_of_contacts} == {3, 6}
    words = "joints RRP, 3 rates, parents (-1, 0, 1), contacts of (6,) rows, loops of [3] rows"
    assert described(robot_of(FIRST_CONTACTS + 7)) == words


CONTACTS_QUICK = FIRST_CONTACTS + 7
CONTACTS = slow_but_for([CONTACTS_QUICK], [FIRST_CONTACTS + k for k in (2, 5, 6, 7, 10, 14, 15)])


@pytest.mark.parametrize("seed", CONTACTS)
def test_robots_with_contacts_and_loops(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """All layouts have the values of the dense systems, and a digit beyond their bound is found."""
    name = "constrained_forward_dynamics"
    if seed == CONTACTS_QUICK:
        monkeypatch.setattr("campaign_contacts.ALWAYS", (name,))
        monkeypatch.setattr("campaign_contacts.IN_TURN", ((),))
    errors = contact_errors(random_contact_robot(seed))
    assert {what.split(", ")[1] for what in errors} == {"one state", "rows", "lanes", "batch"}
    assert not failures(errors)
    if seed == CONTACTS_QUICK:
        right = RECIPES[name]

        def wrong(*given: object) -> dict[str, Array]:
            return {name: values * (1.0 + 1e-8) for name, values in right.pinocchio(*given).items()}

        monkeypatch.setitem(RECIPES, name, replace(right, pinocchio=wrong))
        assert len(failures(contact_errors(random_contact_robot(seed)))) == 4


def test_what_does_not_pass_is_named() -> None:
    errors = {"snap 0, E and P": 2e-11, "snap 0, C auto float32 inline": 1e-5, "snapped, E and P": math.nan}
    assert list(failures(errors)) == ["snap 0, E and P", "snapped, E and P"]


def test_what_psdmc_raises_is_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(seed: int, states: int, *, lowered: bool) -> Found:
        raise ValueError("broken")

    good = outcome(3, 5, 0, "here")
    monkeypatch.setattr("campaign_run.measured", broken)
    result = summary([good, outcome(4, 5, 0, "there")])
    assert result["raised"] == {4: "ValueError: broken"}
    assert result["commits"] == {"here": 1, "there": 1}
    assert result["states"] == 5
    assert "seed 4 raised ValueError: broken" in report(result)
    assert result["worst"]["snap 0, base parameters inverse_dynamics"]["worst"][0][1] == 3


def test_pieces_add_up_and_an_unfinished_line_does_not_count(tmp_path) -> None:
    journal = tmp_path / "journal"
    append(journal, outcome(3, 5, 0, "first"))
    with journal.open("a") as file:
        file.write('{"seed": 4, "err')
    append(journal, outcome(5, 5, 0, "second"))
    assert sorted(read(journal)) == [3, 5]
    assert summary(read(journal).values())["states"] == 10


def test_seeds_and_which_are_lowered() -> None:
    assert seed_range("40") == range(40)
    assert seed_range("20:40") == range(20, 40)
    lowered = [seed for seed in range(10_000) if is_lowered(seed, 50)]
    assert len(lowered) == 200
    assert sum(random_robot(seed).is_mixed for seed in lowered) == 20


def test_the_textbook_agrees_with_pinocchio() -> None:
    for seed in (0, 1, 3, 4):
        robot = random_robot(seed)
        oracle = Pinocchio.of_robot(robot)
        states = random_states(seed, len(robot.joints), STATES)
        reference = Reference.of(Textbook(oracle), states)
        q, qd, _ = reference.few
        assert reference.torque_error(oracle.torques(*states), reference.tau) < 1e-13
        assert reference.mass_error(oracle.mass_matrix(q)) < 1e-13
        assert reference.torque_error(oracle.nonlinear_effects(q, qd), reference.nonlinear) < 1e-13
        assert reference.torque_error(oracle.gravity(q), reference.gravity) < 1e-13
