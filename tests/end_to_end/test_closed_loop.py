"""examples/closed_loop: the controller in C over MuJoCo, held against what control theory and MuJoCo say."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bundled import bundled_model
from installed import need

from psdmc.compiler import emit_c

pytest.importorskip("mujoco")

ROOT = Path(__file__).parent.parent.parent
ROBOT = "rounded_arm"
POSES = 3
"""Of the example's trajectory: 3 s and the pause."""


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The example's own closed loop, a shorter trajectory."""
    need("make")
    package = tmp_path_factory.mktemp("closed_loop") / "arm"
    model = bundled_model(ROBOT)
    emit_c(model, package, functions=["inverse_dynamics", "mass_matrix"], name="robot")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "examples" / "closed_loop"))
        from run import ClosedLoop

        whole = ClosedLoop.of(model, package)
        yield replace(whole, wanted=replace(whole.wanted, poses=whole.wanted.poses[:POSES]))


@pytest.fixture(scope="module")
def feed_forward(example: Any) -> Any:
    return example.with_model()


def _largest(run: Any) -> float:
    return float(np.abs(run.error).max())


def _rest(example: Any, run: Any) -> np.ndarray:
    """Where the robot stands at the end."""
    return np.asarray(example.wanted(run.time[-1]).q - run.error[-1])


def test_without_the_model_gravity_pulls_each_joint_off_its_reference(example: Any) -> None:
    """At rest inertia_i kp e_i holds joint i's weight, which MuJoCo knows."""
    run = example.without_model()
    inertia = example.library.joint_inertias(example.wanted(0.0).q)
    sag = example.unloaded.gravity(_rest(example, run)) / (inertia * example.library.kp)
    np.testing.assert_allclose(run.error[-1], sag, atol=1e-3 * np.abs(sag).max())
    assert np.abs(sag).max() > 0.05


def test_with_the_model_what_is_left_comes_from_holding_the_torque(example: Any, feed_forward: Any) -> None:
    """A torque held for T is late by T/2 in the mean: the error is of first order in T, and far below the other's."""
    faster = example.with_model(period=5e-4)
    assert 0.45 < _largest(faster) / _largest(feed_forward) < 0.55
    assert _largest(feed_forward) < 0.01 * _largest(example.without_model())


def test_the_torque_held_explains_the_error_in_size(example: Any, feed_forward: Any) -> None:
    """e'' + kd e' + kp e = d with d the acceleration that half a period is late by: |e| <= max |d| / kp.

    d is read off the torques that were held: M(q)^-1 (change of tau in T/2), at standstill's M, hence a factor of two."""
    half_steps = np.diff(feed_forward.tau, axis=0)[5:] / 2
    M = [example.unloaded.mass_matrix(example.wanted(time).q) for time in feed_forward.time[6::50]]
    late = [np.abs(np.linalg.solve(m, step)).max() for m, step in zip(M, half_steps[::50], strict=False)]
    assert _largest(feed_forward) < 2 * max(late) / example.library.kp


def test_a_load_that_the_model_does_not_know_pulls_the_arm_off(example: Any) -> None:
    """At rest M kp e equals the load's weight alone: both from MuJoCo, loaded and unloaded."""
    run = example.with_wrong_payload()
    q = _rest(example, run)
    weight = example.loaded.gravity(q) - example.unloaded.gravity(q)
    expected = np.linalg.solve(example.unloaded.mass_matrix(q), weight) / example.library.kp
    np.testing.assert_allclose(run.error[-1], expected, atol=2e-3 * np.abs(expected).max())
    assert np.abs(expected).max() > 0.05


def test_theta_b_of_the_load_brings_the_error_back(example: Any, feed_forward: Any) -> None:
    run, wrong = example.with_right_payload(), example.with_wrong_payload()
    assert _largest(run) < 3 * _largest(feed_forward)
    assert _largest(run) < 0.02 * _largest(wrong)
    assert np.abs(run.error[-1]).max() < 1e-4 * np.abs(wrong.error[-1]).max()


def test_torques_stay_within_the_efforts_of_the_file(example: Any) -> None:
    """Asked for far more, the controller gives exactly what the joints can."""
    effort = np.array([joint.limits.effort for joint in example.model.chain.joints])
    here = example.wanted(0.0)
    far = replace(here, q=here.q + 100.0)
    for controller in (
        example.library.computed_torque(),
        example.library.independent_joints(np.ones_like(here.q)),
    ):
        tau = controller(far, here.q, here.qd)
        assert np.all(np.abs(tau) <= effort)
        assert np.any(np.abs(tau) == effort)


@pytest.mark.slow
def test_three_commands_take_a_urdf_to_the_running_loop(tmp_path: Path) -> None:
    """As examples/README.md prints them, but into another folder."""
    text = (ROOT / "examples" / "README.md").read_text(encoding="utf-8")
    block = re.search(r"```sh\n(.*?)```", text, re.DOTALL)
    assert block
    commands = block[1].strip().splitlines()
    assert len(commands) == 3
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for command in commands:
        words = command.replace("generated/", f"{tmp_path}/").split()
        environment = {**os.environ, "PATH": path, "CFLAGS": "-O0"}
        done = subprocess.run(words, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{command}\n{done.stdout[-1000:]}\n{done.stderr[-1000:]}"
    assert len(re.findall(r"\d\.\d\de[-+]\d\d", done.stdout)) == 12
    assert (tmp_path / "closed_loop.png").stat().st_size > 10_000


def test_a_controller_finds_what_the_arm_picks_up(tmp_path: Path) -> None:
    """1 kg in MuJoCo: noticed within 2 s and within three standard deviations a second later, and tracked as before."""
    need("make")
    model = bundled_model(ROBOT)
    emit_c(
        model, tmp_path / "arm", functions=["inverse_dynamics"], name="robot", payload=True, estimator="mass"
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "examples" / "closed_loop"))
        from pick_up import LOAD, PICKED_UP, simulated

        run = simulated(model, tmp_path / "arm", end=PICKED_UP + 1.5)
    assert run.noticed() < 2.0
    before, behind = run.time < PICKED_UP, run.time > PICKED_UP + 1.0
    assert (np.abs(run.mass - LOAD.mass) < 3 * run.mass_sd)[behind].all()
    assert (run.mass < 3 * run.mass_sd)[before].mean() > 0.99
    assert run.mass_sd[-1] < 0.1 * LOAD.mass
    error = np.abs(run.error).max(axis=1)
    assert error[behind].max() < 3 * error[before].max()
