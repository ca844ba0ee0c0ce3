"""examples/trotting: a quadruped in MuJoCo under the whole-body controller in C, by its two methods, held against Pinocchio
and MuJoCo.

PSDMC_TREES=whole (make test-trees): ten seconds with a push; else (make test-slow) two without one."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from installed import need

pytest.importorskip("mujoco")
pytest.importorskip("osqp")
pytestmark = pytest.mark.slow

EXAMPLE = Path(__file__).parents[2] / "examples" / "trotting"
WHOLE = os.environ.get("PSDMC_TREES") == "whole"
SECONDS, PUSH = (10.0, 60.0) if WHOLE else (2.0, 0.0)
WITHIN = 0.05
"""m of the base from where it began: the issue's bound."""
FROM = 0.75
"""s; all feet have begun to step, and whole periods of half a second follow."""
GRAVITY = 9.81
METHODS = ("quadratic programme", "inverse dynamics")


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The example's modules, its folder, model, world, controller, and one run of each method."""
    need("make")
    folder = tmp_path_factory.mktemp("trotting")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(EXAMPLE))
        patch.setenv("CFLAGS", "-O1")
        import trot

        urdf = trot.anymal()
        model, package = trot.prepared(folder, urdf)
        world = trot.World(urdf.read_text(), trot.BASE, model.joint_names[1:], trot.FEET)
        controller = trot.Controller(package)
        start = trot.standing(model)
        runs = {name: trot.trot(world, controller, start, SECONDS, PUSH, name) for name in METHODS}
        yield {"trot": trot, "folder": folder, "world": world, "controller": controller, "runs": runs}


@pytest.fixture(scope="module", params=METHODS)
def run(example: Any, request: pytest.FixtureRequest) -> Any:
    return example["runs"][request.param]


@pytest.fixture(scope="module")
def oracle(example: Any) -> Any:
    """Pinocchio's reading of the file, with the ids of the feet."""
    model = pin.buildModelFromUrdf(str(example["trot"].anymal()), pin.JointModelFreeFlyer())
    return model, model.createData(), [model.getFrameId(foot) for foot in example["trot"].FEET]


def test_the_base_stays_where_it_is(run: Any) -> None:
    assert len(run.time) == round(SECONDS / 1e-3)
    assert all(np.isfinite(getattr(run, field)).all() for field in ("q", "v", "tau", "force", "floor"))
    assert run.way.max() <= WITHIN
    assert run.tilt.max() < 0.1
    assert run.solved.all()


def test_torques_stay_within_the_files_efforts(run: Any, oracle: Any) -> None:
    assert np.all(np.abs(run.tau) <= oracle[0].effortLimit[6:])
    assert np.abs(run.tau).max() > 1.0


def test_every_foot_leaves_the_floor_and_returns(run: Any, oracle: Any) -> None:
    """By MuJoCo's contacts and Pinocchio's heights: diagonal pairs in turn, at least 5 cm up in each step."""
    model, data, feet = oracle
    heights = []
    for q in run.q:
        pin.framesForwardKinematics(model, data, q)
        heights.append([data.oMf[foot].translation[2] for foot in feet])
    heights = np.array(heights) - heights[0]
    swings = (run.time >= 0.5) & (run.time < SECONDS - 0.25)
    for k in range(4):
        landed = run.floor[:, k, 2] > 0.0
        flights = np.flatnonzero(np.diff(landed[swings].astype(int)) < 0)
        assert len(flights) >= int(2 * (SECONDS - 1.0))
        assert heights[:, k].max() > 0.05
        assert 0.3 < (~landed[swings]).mean() < 0.5
    pairs = run.floor[:, :, 2] > 0.0
    both = ~pairs[:, 0] & ~pairs[:, 1]
    assert not both[run.time > 0.1].any(), "both fore feet in the air"


def test_the_floor_carries_the_robot(run: Any, oracle: Any) -> None:
    """Over whole periods of the gait the vertical forces' mean is the weight: nothing else holds the robot up."""
    periods = int((SECONDS - FROM) / 0.5) * 500
    late = slice(round(FROM / 1e-3), round(FROM / 1e-3) + periods)
    mean = run.floor[late, :, 2].sum(axis=1).mean()

    assert mean == pytest.approx(pin.computeTotalMass(oracle[0]) * GRAVITY, rel=0.01)


def test_each_solution_obeys_pinocchios_dynamics(run: Any, oracle: Any) -> None:
    """rnea(q, v, the controller's accelerations) less its forces on the feet is zero on the base and the torques on the
    joints; feet in the air do not push."""
    model, data, feet = oracle
    weight = pin.computeTotalMass(model) * GRAVITY
    for i in range(0, len(run.time), 37):
        needed = pin.rnea(model, data, run.q[i], run.v[i], run.acceleration[i])
        pin.computeJointJacobians(model, data, run.q[i])
        for k, foot in enumerate(feet):
            aligned = pin.getFrameJacobian(model, data, foot, pin.LOCAL_WORLD_ALIGNED)
            needed -= aligned[:3].T @ run.force[i, k]
        np.testing.assert_allclose(needed[:6], 0.0, atol=1e-3 * weight)
        np.testing.assert_allclose(needed[6:], run.tau[i], atol=1e-3 * weight)
    assert np.abs(run.force[run.stance == 0]).max() < 1e-3 * weight


def test_the_programme_keeps_forces_within_friction(example: Any, oracle: Any) -> None:
    x, y, z = np.moveaxis(example["runs"]["quadratic programme"].force, -1, 0)
    assert np.all(
        np.maximum(np.abs(x), np.abs(y)) <= 0.5 * z + 1e-3 * pin.computeTotalMass(oracle[0]) * GRAVITY
    )


def test_methods_agree_where_no_limit_is_reached(example: Any) -> None:
    """At the states of an undisturbed second, OSQP's solution is that of inverse dynamics, but for its small weights of
    joints and forces."""
    run, controller = example["runs"]["quadratic programme"], example["controller"]
    controller.begin(run.q[0], "BY_CONTACTS")
    for i in range(1000):
        command = controller.step(run.time[i], run.q[i], run.v[i])
        assert command.solved
        np.testing.assert_allclose(
            controller.array(command.acceleration)[:6], run.acceleration[i, :6], atol=0.01
        )
        np.testing.assert_allclose(controller.array(command.tau), run.tau[i], atol=0.5)


def test_its_states_are_pinocchios(example: Any, oracle: Any) -> None:
    """However the base is turned: where MuJoCo's rates lead from a state is where Pinocchio says that v leads."""
    import mujoco

    world, rng, dt = example["world"], np.random.default_rng(1), 1e-6
    for _ in range(20):
        world.data.qpos[:] = rng.uniform(-1.0, 1.0, world.model.nq)
        world.data.qpos[3:7] /= np.linalg.norm(world.data.qpos[3:7])
        world.data.qvel[:] = rng.uniform(-1.0, 1.0, world.model.nv)
        before = world.state()
        mujoco.mj_integratePos(world.model, world.data.qpos, world.data.qvel, dt)
        way = pin.difference(oracle[0], before.q, world.state().q) / dt
        np.testing.assert_allclose(way, before.v, atol=1e-5)


def test_the_command_says_how_it_went(
    example: Any, monkeypatch: pytest.MonkeyPatch, capsys: Any, tmp_path: Path
) -> None:
    picture, moving = tmp_path / "trot.png", tmp_path / "trot.gif"
    words = ["trot.py", "--seconds", "0.6", "--folder", str(example["folder"])]
    monkeypatch.setattr(sys, "argv", [*words, "--plot", str(picture), "--animation", str(moving)])
    example["trot"].main()
    said = capsys.readouterr().out.splitlines()

    assert said[0] == "600 calls, 0.6 s, 2 steps"
    assert said[1].split("  ")[-1].strip() == METHODS[1]
    rows = {line[:34].strip(): line[34:].split() for line in said[2:-2]}
    assert all(float(entry) < 1.0 for entry in rows["base from its start, at most (cm)"])
    assert rows["calls without a solution"] == ["0", "0"]
    assert rows["QP iterations, at most"][1] == "0"
    assert picture.stat().st_size > 10_000
    assert moving.read_bytes().startswith(b"GIF89a")


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        ("include/robot/robot.h", "robot_NQ 19", "robot_NQ 26", "not of a quadruped on a floating base"),
        ("src/tables.c", "LF_FOOT", "RH_FOOT", "not feet named LF, RF, LH, RH, in this order"),
    ],
)
def test_a_package_of_another_robot_is_refused(
    example: Any, tmp_path: Path, capfd: Any, file: str, old: str, new: str, said: str
) -> None:
    """By the package's own numbers and names, before anything moves."""
    built = shutil.ignore_patterns("libtrot.so", "librobot.a", "tables.o")
    shutil.copytree(example["folder"] / "anymal", tmp_path / "other", ignore=built)
    changed = tmp_path / "other" / file
    assert old in changed.read_text()
    changed.write_text(changed.read_text().replace(old, new))
    with pytest.raises((SystemExit, subprocess.CalledProcessError)) as refused:
        example["trot"].Controller(tmp_path / "other").begin(np.zeros(19))
    assert said in str(refused.value) + capfd.readouterr().err
