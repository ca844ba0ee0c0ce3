"""Exciting motions: better than random, within limits everywhere, the same for the same seed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from psdmc.calibration.motions.allowed import GivenLimits, bounded
from psdmc.calibration.motions.excite import MEASURES, excite
from psdmc.calibration.motions.excite_options import ExciteOptions
from psdmc.calibration.motions.limited_sines import LimitedSines, SineSum
from psdmc.calibration.motions.trajectory import limit_faults
from psdmc.errors import InputError
from psdmc.robot.mechanism import Limits

OPTIONS = ExciteOptions(duration=5.0, harmonics=(1, 2, 3), samples=50, evaluations=400, random=200)


def test_it_beats_random_motions_and_keeps_limits_between_samples(arm):
    found = excite(arm.model.chain, arm.regressor, OPTIONS)

    fine = found.motion.sampled(arm.model.joint_names, OPTIONS.duration / (10 * OPTIONS.samples))
    assert found.times > 1.2
    assert limit_faults(fine, arm.model.chain) == []
    # and the limits are used: some joint reaches at least 90 % of one of its own
    reach = [
        np.abs(fine.qd).max(axis=0) / [joint.limits.speed for joint in arm.model.chain.joints],
        np.abs(fine.qdd).max(axis=0) / [joint.limits.acceleration for joint in arm.model.chain.joints],
        np.abs(fine.q).max(axis=0) / [joint.limits.upper for joint in arm.model.chain.joints],
    ]
    assert np.max(reach) > 0.9


def test_the_reported_condition_is_that_of_the_stacked_regressor(arm):
    found = excite(arm.model.chain, arm.regressor, replace(OPTIONS, evaluations=100))

    motion = found.motion.sampled(arm.model.joint_names, OPTIONS.duration / OPTIONS.samples)
    stack = arm.regressor.regressor(motion.q[:-1], motion.qd[:-1], motion.qdd[:-1]).reshape(-1, arm.model.l)
    assert found.condition == pytest.approx(np.linalg.cond(stack / np.linalg.norm(stack, axis=0)), rel=1e-9)


@pytest.mark.parametrize("objective", ["deviation", "condition", "log_det"])
def test_the_comparison_is_by_what_is_minimised(arm, objective: str):
    """With the best random motion by that measure, computed by NumPy; a search that gains nothing returns that motion."""
    options = replace(OPTIONS, evaluations=1, seconds=0.0, random=30, objective=objective)
    space = LimitedSines(arm.model.chain, options)
    drawn = [space.motion(each) for each in space.drawn(options.random, np.random.default_rng(options.seed))]
    measures, conditions = zip(*(measured(arm, motion, objective) for motion in drawn), strict=True)
    best = int(np.argmin(measures))

    found = excite(arm.model.chain, arm.regressor, options)
    searched = excite(arm.model.chain, arm.regressor, replace(options, evaluations=200, seconds=60.0))

    for each in (found, searched):
        own, condition = measured(arm, each.motion, objective)
        assert each.condition == pytest.approx(condition, rel=1e-9)
        assert each.random_condition == pytest.approx(conditions[best], rel=1e-6)
        np.testing.assert_allclose(each.random_times, np.sort(measures) / own, rtol=1e-6)
        assert f"the {MEASURES[objective]} is {each.times:.2f} times smaller" in each.comparison
    assert found.times >= 1.0
    assert searched.times > 1.05


def measured(arm, motion: SineSum, objective: str) -> tuple[float, float]:
    """What an objective minimises, and the condition number of unit columns."""
    rows = arm.regressor.regressor(
        *motion.at(np.arange(OPTIONS.samples) * OPTIONS.duration / OPTIONS.samples)
    )
    stack = rows.reshape(-1, arm.model.l)
    lengths = np.linalg.norm(stack, axis=0)
    condition = float(np.linalg.cond(stack / lengths))
    semi_axes = 1.0 / np.linalg.svd(stack, compute_uv=False)
    by_objective = {
        "deviation": condition / np.exp(np.log(lengths).mean()),
        "condition": condition,
        "log_det": np.exp(np.log(semi_axes).mean()),
    }
    return float(by_objective[objective]), condition


def test_the_same_seed_gives_the_same_motion(arm):
    short = replace(OPTIONS, evaluations=200)

    first, second = (excite(arm.model.chain, arm.regressor, short) for _ in range(2))

    assert np.array_equal(first.motion.sine, second.motion.sine)
    assert first.condition == second.condition


def test_log_det_is_an_objective_too(arm):
    by_condition = excite(arm.model.chain, arm.regressor, OPTIONS)
    by_volume = excite(arm.model.chain, arm.regressor, replace(OPTIONS, objective="log_det"))

    assert volume(arm, by_volume) > volume(arm, by_condition)


def volume(arm, found) -> float:
    motion = found.motion.sampled(arm.model.joint_names, OPTIONS.duration / OPTIONS.samples)
    stack = arm.regressor.regressor(motion.q[:-1], motion.qd[:-1], motion.qdd[:-1]).reshape(-1, arm.model.l)
    return float(np.linalg.slogdet(stack.T @ stack)[1])


def test_a_joint_without_limits_is_named(arm):
    chain = arm.model.chain
    free = replace(chain, joints=(replace(chain.joints[0], limits=Limits()), chain.joints[1]))

    with pytest.raises(
        InputError, match=r"limits to move within: shoulder \(position, speed, acceleration\)"
    ):
        excite(free, arm.regressor, OPTIONS)


def test_an_acceleration_can_be_given_for_robots_whose_file_has_none(arm):
    chain = arm.model.chain
    free = Limits(speed=2.0)
    turning = replace(chain, joints=(replace(chain.joints[0], limits=free), chain.joints[1]))

    found = bounded(turning, GivenLimits(acceleration=9.0)).joints

    assert found[0].limits == Limits(-np.pi, np.pi, 2.0, 9.0)
    assert found[1].limits == chain.joints[1].limits
    with pytest.raises(InputError, match=r"shoulder \(acceleration\)") as raised:
        bounded(turning, GivenLimits())
    assert "--acceleration" in str(raised.value.hint)
