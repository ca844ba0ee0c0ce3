"""The benchmark of robots whose root is free: q is longer than its rates, quaternions have length one, and MuJoCo gets its
own convention."""

from __future__ import annotations

from shutil import which

import numpy as np
import pinocchio as pin
import pytest
from urdf_text import inertial, joint, link, urdf

from psdmc.bench.case import LONGEST_INPUT, Case, generic_chain, robot_as_numbers
from psdmc.bench.cases import LEGGED, TREES, legged_cases, robot_data, standard_chains
from psdmc.bench.contestant import Contestant, Runner, Unavailable
from psdmc.bench.legged import THEIRS
from psdmc.bench.machine import native_flags
from psdmc.bench.measure import instructions
from psdmc.bench.rivals import mujoco_c, psdmc_c
from psdmc.bench.rivals.pinocchio_cpp import SYMBOLS, outputs_of, ways_of
from psdmc.bench.run import Settings, checked, run
from psdmc.bench.states import States
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.robot.joints import FREE
from psdmc.robot.load import load_robot_text

FLAGS = (*native_flags(), "-O0")
"""Which values come from where is asked here, not how fast."""

BIRD = urdf(
    *(link(name, inertial(rpy="0 0 0")) for name in ("trunk", "wing", "tail")),
    joint("left", "trunk", "wing", rpy="0.3 0.1 -0.2", axis="0.6 0 0.8"),
    joint("rudder", "trunk", "tail", kind="prismatic", xyz="-0.3 0 0.1", rpy="0 0 0.7", axis="0 1 0"),
    name="bird",
)
PAIR = BIRD.replace(
    '<joint name="rudder" type="prismatic">', '<joint name="rudder" type="revolute"><mimic joint="left"/>'
)


@pytest.fixture(scope="module")
def bird() -> Case:
    chain = load_robot_text(BIRD, "urdf", floating=True).mechanism
    return Case("bird", derive_model(generic_chain(chain, 1)))


@pytest.fixture(scope="module")
def states(bird: Case) -> States:
    return States.random(bird.chain, 128, seed=1)


def test_states_have_quaternions_of_length_one(states: States) -> None:
    assert (states.q.shape, states.qd.shape) == ((128, 9), (128, 8))
    assert np.allclose(np.linalg.norm(states.q[:, 3:7], axis=1), 1.0, atol=1e-15)
    assert not np.array_equal(states.q[0, 3:7], states.q[1, 3:7])


def test_derivatives_of_large_robots_are_left_out_and_said(
    bird: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert bird.functions == psdmc_c.FUNCTIONS
    monkeypatch.setattr("psdmc.bench.case.MOST_DIFFERENTIATED", bird.chain.nv - 1)
    assert bird.functions == tuple(n for n in psdmc_c.FUNCTIONS if not n.endswith(("_derivatives", "_vjp")))
    monkeypatch.setattr(psdmc_c, "contestants", lambda *given: [])
    (answer,) = psdmc_c.factored(bird, ())
    assert isinstance(answer, Unavailable)
    assert "inverse_dynamics_derivatives" in answer.rival
    assert "this has 8" in answer.reason


@pytest.mark.needs("g++")
def test_every_layout_is_right(bird: Case) -> None:
    """Strides of q and of rates differ in the loops."""
    contestants = psdmc_c.factored(bird, FLAGS)
    right, errors, wrong = checked(bird, contestants, seed=2)

    assert (len(right), wrong) == (3 * len(bird.functions), ())
    assert max(errors) < 1e-10


@pytest.mark.needs("g++")
def test_latency_reads_every_position(bird: Case, states: States) -> None:
    """More positions than outputs: the loop must not read behind them."""
    one = next(c for c in psdmc_c.factored(bird, FLAGS) if c.function == "gravity" and c.layout == "state")
    runner = Runner(one, states)
    assert np.isfinite(runner.latency()).all()
    assert runner.contestant.outputs < bird.chain.nq


@pytest.mark.needs("g++")
def test_mujocos_torques_agree_in_its_own_convention(bird: Case) -> None:
    answer, left_out = mujoco_c.contestants(bird, FLAGS)
    assert isinstance(answer, Contestant)
    assert isinstance(left_out, Unavailable)
    right, errors, wrong = checked(bird, [answer], seed=3)

    assert (right, wrong) == ([answer], ())
    assert max(errors) < 1e-12


def test_mujoco_is_refused_a_free_joint_above_another(bird: Case) -> None:
    chain = bird.chain
    text = mujoco_c.mjcf(chain)
    assert text.count('type="free"') == 1
    swapped = (chain.joints[1], chain.joints[0], chain.joints[2])
    object.__setattr__(chain, "joints", swapped)
    try:
        with pytest.raises(InputError, match="free joints are on the world"):
            mujoco_c.mjcf(chain)
    finally:
        object.__setattr__(chain, "joints", (swapped[1], swapped[0], swapped[2]))


def test_rivals_read_the_free_joint(bird: Case) -> None:
    lines = robot_as_numbers(bird.chain).splitlines()
    assert [line.split()[:2] for line in lines[1:]] == [["FreeFlyer", "0"], ["RZ", "1"], ["PZ", "1"]]
    assert outputs_of(bird, "regressor") == 8 * 30


def test_ways_that_differentiate_by_coordinates_are_not_compared(bird: Case, two_link: Case) -> None:
    name = "inverse_dynamics_derivatives"
    both = SYMBOLS | {name: (f"{name}_jacobian", f"{name}_recursion")}
    assert ways_of(bird, both)[name] == (f"{name}_recursion",)
    assert ways_of(two_link, both)[name] == both[name]


def test_a_robot_whose_joints_follow_others_is_refused_to_rivals_with_the_reason() -> None:
    chain = load_robot_text(PAIR, "urdf").mechanism
    assert chain.has_mimic_joints
    with pytest.raises(InputError, match="follows another"):
        robot_as_numbers(chain)


def test_more_positions_than_the_loops_take_are_refused(bird: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("psdmc.bench.case.LONGEST_INPUT", 8)
    with pytest.raises(InputError, match="9 positions, the benchmark takes 8"):
        Case("bird", bird.model)
    source = mujoco_c.source("loops.hpp")
    assert f"LONGEST_INPUT = {LONGEST_INPUT};" in source


def test_standard_robots_have_the_trees() -> None:
    makers = standard_chains()
    found = {name: makers[name]() for name in TREES}
    sizes = {name: (robot.nq, robot.nv) for name, robot in found.items()}
    assert sizes == {
        "solo12": (19, 18), "anymal_b": (19, 18), "talos": (39, 38), "allegro": (16, 16), "baxter": (15, 15),
    }  # fmt: skip
    assert [name for name, robot in found.items() if robot.types[0] == FREE] == [
        "solo12",
        "anymal_b",
        "talos",
    ]


@pytest.mark.skipif(which("valgrind") is None, reason="valgrind is not installed")
def test_instructions_are_counted_over_longer_positions(bird: Case) -> None:
    alone = psdmc_c.contestants(bird, "factored", ("gravity",), ("-O1", "-fPIC"))
    one = next(c for c in alone if c.layout == "state")
    counted = instructions([one], bird.chain)
    assert 20.0 < counted[str(one.library), "gravity"] < 5000.0


@pytest.mark.slow
def test_psdmc_alone_is_measured_where_joints_follow_others() -> None:
    chain = load_robot_text(PAIR, "urdf").mechanism
    case = Case("pair", derive_model(chain))
    wanted = ("inverse_dynamics", "mass_matrix")
    settings = Settings(rounds=1, states=2048, rivals=("psdmc factored", "MuJoCo"), functions=wanted)
    (result,) = run([case], settings).cases

    assert {(m.rival, m.function) for m in result.measurements} == {
        ("psdmc factored", "inverse_dynamics"),
        ("psdmc factored", "mass_matrix"),
    }
    (left_out,) = result.unavailable
    assert left_out.rival == "MuJoCo"
    assert "'rudder' follows another" in left_out.reason
    assert result.wrong == ()


def test_legged_robots_have_their_files_inertias_and_functions_that_pinocchio_has() -> None:
    functions = tuple(THEIRS)
    (case,) = legged_cases(functions, ["solo12"])

    assert set(THEIRS.values()) <= set(SYMBOLS)
    assert case.functions == functions
    oracle = pin.buildModelFromUrdf(str(robot_data() / LEGGED["solo12"]), pin.JointModelFreeFlyer())
    assert case.chain.parameters[:, 0].sum() == pytest.approx(pin.computeTotalMass(oracle), rel=1e-12)
    with pytest.raises(InputError, match="no legged robot 'solo13'"):
        next(legged_cases(functions, ["solo13"]))
