"""Assembly of closed loops: a four-bar's closed form, Pinocchio's placements of trees, a ball joint, and dead points."""

from __future__ import annotations

import math
import tomllib
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from loop_trees import loop_tree
from slow_cases import slow_but_for
from test_closed_loops import FOUR_BAR, GROUND, PIN, assembled, four_bar
from test_loop_error import TREES

import psdmc
from psdmc.dynamics.frames import frames_of
from psdmc.errors import InputError
from psdmc.functions import RECIPES
from psdmc.model.random_states import near_closed
from psdmc.recipes.closed_loops import closer
from psdmc.robot.reference import reference
from psdmc.toolchain.call import CompiledRobot
from psdmc.verification.check import with_passive_joints

CRANKS = np.linspace(-3.0, 3.0, 25)


@pytest.fixture(scope="module")
def bars(tmp_path_factory: pytest.TempPathFactory) -> tuple[psdmc.DynamicsModel, CompiledRobot]:
    model = four_bar(tmp_path_factory.mktemp("bars"))
    return model, psdmc.compile(model, functions=["assemble"])


def test_a_four_bar_closes_as_its_closed_form_does(
    bars: tuple[psdmc.DynamicsModel, CompiledRobot],
) -> None:
    """From guesses 0.25 rad away, on rows, on one state, and in place."""
    closed = np.array([assembled(crank) for crank in CRANKS])
    guess = closed + np.random.default_rng(1).uniform(-0.25, 0.25, closed.shape) * [0.0, 1.0, 1.0]
    for robot in bars:
        found = robot.assemble(guess)
        np.testing.assert_allclose(found, closed, rtol=0.0, atol=1e-14)
        assert np.array_equal(found[:, 0], guess[:, 0])
        np.testing.assert_allclose(robot.assemble(guess[3]), closed[3], atol=1e-14)
        own = guess.copy()
        assert np.array_equal(robot.assemble(own, out=own), found)


def test_single_precision_closes_to_its_own_digits(tmp_path: Path) -> None:
    robot = psdmc.compile(four_bar(tmp_path), functions=["assemble"], real="float32")
    closed = np.array([assembled(crank) for crank in CRANKS])
    found = robot.assemble((closed + np.array([0.0, 0.2, -0.2])).astype(np.float32))
    np.testing.assert_allclose(found, closed, atol=2e-5)


def test_positions_that_no_passive_joints_close_are_refused(tmp_path: Path) -> None:
    """The crank's end is up to 0.65 m from the rocker's pin. Coupler and rocker together are 0.6 m long."""
    path = tmp_path / "short.urdf"
    path.write_text(FOUR_BAR, encoding="utf-8")
    short = {"second": {"link": "coupler", "xyz": [0.2, 0.0, 0.0]}, "passive": ["coupler_pin", "rocker_pin"]}
    model = psdmc.derive(path, loops=[PIN | short], expand=False)
    q = np.array([[0.3, 1.4, 2.0], [math.pi, 1.4, 2.0]])
    for robot in (model, psdmc.compile(model, functions=["assemble"])):
        with pytest.raises(
            InputError, match="assemble: the loops are not closed after 8 Newton steps in state 1"
        ):
            robot.assemble(q)
        assert np.abs(model.loop_error(robot.assemble(q[0]))).max() < 1e-14
        assert np.isnan(robot.assemble([np.nan, 1.0, 1.0])).all()


def test_a_dead_point_names_the_row(tmp_path: Path) -> None:
    """Crank and coupler, which are passive, are in one line, also where the loop is closed."""
    model = four_bar(tmp_path, passive=["crank_pin", "coupler_pin"])
    crank = math.acos((0.7**2 + GROUND**2 - 0.4**2) / (2 * 0.7 * GROUND))
    q = np.array([crank, 0.0, math.atan2(0.7 * math.sin(crank), 0.7 * math.cos(crank) - GROUND)])
    for robot in (model, psdmc.compile(model, functions=["assemble"])):
        with pytest.raises(InputError, match=r"assemble: pin\.[xz]: the passive joints do not follow"):
            robot.assemble(q)


@pytest.mark.parametrize(
    ("seed", "floating"), slow_but_for([(0, True)], [each.values for each in TREES], spread=True)
)
def test_trees_close_by_pinocchios_placements(seed: int, floating: bool) -> None:
    """The closed configuration of each tree, and random ones, with all layouts of C and NumPy."""
    own = loop_tree(seed, floating)
    robot = own.model.mechanism
    if not robot.passive_rates:
        with pytest.raises(InputError, match="passive"):
            _ = own.robot.assemble
        return
    guess = near_closed(robot, np.random.default_rng(3), 15)
    away = np.zeros(robot.nv)
    away[list(robot.passive_rates)] = 0.02
    guess = np.vstack([guess, own.model.integrate(own.closed, away)])
    theirs = reference(with_passive_joints(own.model, own.loaded), snapped=False)
    assert np.abs(RECIPES["loop_error"].pinocchio(theirs, {"q": guess})["error"]).max() > 1e-3
    expected = RECIPES["assemble"].pinocchio(theirs, {"q_guess": guess})["q_closed"]
    for found in (
        own.robot.assemble(guess),
        np.array([own.robot.assemble(each) for each in guess]),
        own.model.assemble(guess),
    ):
        assert np.abs(RECIPES["loop_error"].pinocchio(theirs, {"q": found})["error"]).max() < 1e-13
        np.testing.assert_allclose(found, expected, atol=1e-10)
        np.testing.assert_allclose(found[-1], own.closed, atol=1e-10)
    if floating:  # even a quaternion whose length is not quite one
        guess[:, 3:7] *= 1.0 + 1e-12
        assert np.array_equal(own.robot.assemble(guess)[:, :7], guess[:, :7])


def test_steps_are_of_second_order(tmp_path: Path) -> None:
    """After each step, the distance to the closed form is below the square of the one before, for bars of this length."""
    loops, frames = (model := four_bar(tmp_path)).mechanism.loops, frames_of(model.mechanism)
    q, distances = list(assembled(1.0) + np.array([0.0, 0.1, -0.1])), []
    for _ in range(4):
        q, signs = closer(frames, loops, q)
        distances.append(float(np.abs(np.array(q) - assembled(1.0)).max()))
    assert all(after < 2.0 * before**2 + 1e-15 for before, after in pairwise(distances))
    assert distances[0] > 1e-3
    assert distances[-1] < 1e-14
    assert [float(sign) for sign in signs] == [1.0, 1.0, -1.0]
    assert float(closer(frames, loops, q)[1][-1]) == 1.0


ROD = """
<mujoco model="rod"><worldbody><body name="crank"><joint name="turn" axis="0 0 1"/>
  <inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/>
  <body name="rod" pos="0.3 0 0"><joint name="ball" type="ball"/>
    <inertial pos="0.1 0 0.05" mass="1" diaginertia="0.1 0.2 0.2"/></body>
</body></worldbody></mujoco>
"""


def test_a_passive_ball_joint_turns_against_its_crank(tmp_path: Path) -> None:
    """A rod that keeps its axes along those of the base: the ball joint has minus the crank's angle."""
    path = tmp_path / "rod.xml"
    path.write_text(ROD, encoding="utf-8")
    loop = {
        "name": "parallel",
        "rows": ["rx", "ry", "rz"],
        "first": "world",
        "second": "rod",
        "passive": ["ball"],
    }
    model = psdmc.derive(path, loops=[loop], expand=False)
    crank = np.linspace(-2.5, 2.5, 9)
    closed = np.stack([crank, 0 * crank, 0 * crank, -np.sin(crank / 2), np.cos(crank / 2)], axis=1)
    away = np.random.default_rng(1).uniform(-0.3, 0.3, (9, 4)) * [0.0, 1.0, 1.0, 1.0]
    for robot in (model, psdmc.compile(model, functions=["assemble"])):
        found = robot.assemble(model.integrate(closed, away))
        np.testing.assert_allclose(found, closed, atol=1e-14)


def test_a_palletiser_closes_as_its_parallelograms_do() -> None:
    """Opposite bars of a parallelogram are parallel: each passive joint has the sum of motors' angles that keeps them so."""
    folder = Path("examples/palletiser")
    sums = {
        "elbow": (-1, 1),
        "wrist_joint": (0, -1),
        "triangle_joint": (-1, 0),
        "upper_link_joint": (0, 1),
        "rod_joint": (1, -1),
        "lower_link_joint": (1, 0),
    }
    tables = tomllib.loads((folder / "palletiser_loops.toml").read_text(encoding="utf-8"))["loop"]
    loops = [table | {"follows": [], "passive": list(sums)} for table in tables]
    model = psdmc.derive(folder / "palletiser.urdf", loops=loops, expand=False)
    names = list(model.mechanism.q_names)
    closed = np.zeros((9, len(names)))
    motors = np.random.default_rng(2).uniform(-0.5, 0.5, (9, 2))
    closed[:, [names.index("axis_2"), names.index("axis_3")]] = motors
    for name, shares in sums.items():
        closed[:, names.index(name)] = motors @ shares
    passive = np.isin(names, list(sums))
    guess = closed + 0.2 * passive * np.random.default_rng(3).uniform(-1.0, 1.0, closed.shape)
    np.testing.assert_allclose(model.assemble(guess), closed, rtol=0.0, atol=1e-12)
