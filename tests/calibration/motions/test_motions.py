"""Motions: what they promise of limits, speeds and symmetry, and that files keep them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from psdmc.calibration.motions.sweeps import (
    SineOptions,
    SweepOptions,
    gravity_sweep,
    sine_plan,
    sine_series,
    single_joint_sweep,
)
from psdmc.calibration.motions.trajectory import Trajectory, limit_faults, read_trajectory, write_trajectory
from psdmc.errors import InputError

SWEEP = SweepOptions(speed=0.2, seconds=20.0)


def motions(arm) -> list[Trajectory]:
    chain = arm.model.chain
    return [
        single_joint_sweep(chain, 1, np.zeros(2), SWEEP),
        gravity_sweep(chain, 4, SWEEP),
        sine_series(chain, 0, np.array([0.1, -0.2]), SineOptions(smallest=1e-3, largest=1.0)),
    ]


def test_limits_are_kept_and_derivatives_belong_together(arm):
    for motion in motions(arm):
        h = motion.period
        assert limit_faults(motion, arm.model.chain) == []
        slope = (motion.q[2:] - motion.q[:-2]) / (2 * h)
        bend = (motion.qd[2:] - motion.qd[:-2]) / (2 * h)
        assert np.abs(slope - motion.qd[1:-1]).max() < 2e-4 * np.abs(motion.qd).max() + 1e-9
        assert np.abs(bend - motion.qdd[1:-1]).max() < 2e-3 * np.abs(motion.qdd).max() + 1e-9


def test_all_start_and_end_at_rest(arm):
    for motion in motions(arm):
        assert np.abs(motion.qd[[0, -1]]).max() < 1e-6


def test_a_gravity_sweep_comes_back_the_way_it_went(arm):
    motion = gravity_sweep(arm.model.chain, 4, SWEEP)

    assert np.array_equal(motion.q, motion.q[::-1])
    assert np.array_equal(motion.qd, -motion.qd[::-1])
    assert np.ptp(motion.q, axis=0).min() > 3.0


def test_a_single_joint_sweep_moves_one_joint_at_one_speed(arm):
    motion = single_joint_sweep(arm.model.chain, 1, np.array([0.3, 0.0]), SWEEP)

    assert np.all(motion.q[:, 0] == 0.3)
    share = np.mean(np.isclose(np.abs(motion.qd[:, 1]), 0.2 * 5.0, rtol=1e-12))
    assert share > 0.7


def test_a_sine_plan_reaches_from_presliding_to_the_speed_limit(arm):
    joint = arm.model.chain.joints[0]

    plan = sine_plan(joint, 0.0, SineOptions())

    speeds = [2 * np.pi * frequency * amplitude for amplitude, frequency in plan]
    accelerations = [(2 * np.pi * frequency) ** 2 * amplitude for amplitude, frequency in plan]
    assert plan[0][0] == 1e-5
    assert max(speeds) <= 0.9 * joint.limits.speed + 1e-9
    assert max(accelerations) <= 0.9 * joint.limits.acceleration + 1e-9
    assert max(max(speeds) / joint.limits.speed, max(accelerations) / joint.limits.acceleration) > 0.85


def test_a_sweep_without_room_is_refused(arm):
    with pytest.raises(InputError, match="too little range"):
        single_joint_sweep(arm.model.chain, 0, np.zeros(2), replace(SWEEP, range=1e-3))


def test_a_trajectory_is_kept_by_its_file(arm, tmp_path: Path):
    motion = motions(arm)[0]
    write_trajectory(motion, tmp_path / "motion.csv")

    again = read_trajectory(tmp_path / "motion.csv")

    assert again.joint_names == motion.joint_names
    assert np.array_equal(again.q, motion.q)
    assert np.array_equal(again.qdd, motion.qdd)


def test_sliding_joints_are_written_in_metres(arm, tmp_path: Path):
    motion = replace(motions(arm)[0], sliding=("elbow",))
    write_trajectory(motion, tmp_path / "motion.npz")

    with np.load(tmp_path / "motion.npz") as stored:
        assert "velocity_m_s.elbow" in stored.files
    assert read_trajectory(tmp_path / "motion.npz").sliding == ("elbow",)


def test_a_trajectory_file_without_accelerations_is_refused(tmp_path: Path):
    (tmp_path / "motion.csv").write_text(
        "time_s,position_rad.a,velocity_rad_s.a\n0,0,0\n1,0,0\n2,0,0\n", encoding="utf-8"
    )

    with pytest.raises(InputError, match=r"no column.* acceleration_rad_s2\.a"):
        read_trajectory(tmp_path / "motion.csv")


def test_exceeded_limits_are_named(arm):
    motion = motions(arm)[0]
    fast = Trajectory(motion.joint_names, motion.time, motion.q, 10 * motion.qd, motion.qdd)

    assert limit_faults(fast, arm.model.chain) == ["elbow: speed 10 beyond 5"]
