"""A periodic motion is run from rest to rest, whatever it starts with: within its limits, and on its own path."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from slow_cases import slow_but_for

from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.motions.allowed import Allowed, GivenLimits, bounded
from psdmc.calibration.motions.criterion import inertial_columns
from psdmc.calibration.motions.excite import excite
from psdmc.calibration.motions.excite_options import ExciteOptions
from psdmc.calibration.motions.limited_sines import SineSum, from_rest_to_rest
from psdmc.calibration.motions.trajectory import Trajectory, limit_faults
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.robot.load import load_robot

ROBOTS = Path(__file__).resolve().parents[3] / "examples" / "robots"


def require_whole(whole: Trajectory, chain) -> None:
    h = whole.period
    assert np.abs(whole.qd[[0, -1]]).max() < 1e-9
    assert limit_faults(whole, chain) == []
    slope = (whole.q[2:] - whole.q[:-2]) / (2 * h)
    bend = (whole.qd[2:] - whole.qd[:-2]) / (2 * h)
    assert np.abs(slope - whole.qd[1:-1]).max() < 1e-3
    assert np.abs(bend - whole.qdd[1:-1]).max() < 0.2


def test_an_exciting_motion_is_reached_from_rest_within_the_limits(arm):
    chain = arm.model.chain
    sines = SineSum(
        4.0, (1, 2), np.zeros(2), np.array([[0.9, 0.3], [-0.5, 0.4]]), np.array([[0.2, 0.1], [0.6, 0.0]])
    )
    assert np.abs(sines.at(np.zeros(1))[1]).min() > 0.4

    whole = from_rest_to_rest(sines, chain, 1e-3, 2, Allowed(chain).faults)

    require_whole(whole, chain)
    assert whole.duration > 8.0


@pytest.mark.parametrize("side", [-1, 0, 1])
@pytest.mark.parametrize("harmonic", [1, 2, 3, 5])
def test_so_is_one_that_starts_next_to_a_limit_at_any_phase(arm, harmonic: int, side: int):
    """A quintic from rest to the motion's start does not exist for some: it would come from beyond the limit."""
    chain = arm.model.chain
    limits = [joint.limits for joint in chain.joints]
    half = np.array([each.upper for each in limits])
    w = 2 * np.pi * harmonic / 5.0
    largest = [half, [each.speed / w for each in limits], [each.acceleration / w**2 for each in limits]]
    amplitude = 0.98 * np.min(largest, axis=0)
    centre = side * (0.98 * half - amplitude)
    for phase in np.linspace(0.0, 2 * np.pi, 24, endpoint=False):
        sine, cosine = np.zeros((2, 2, harmonic))
        sine[:, -1], cosine[:, -1] = amplitude * np.cos(phase), amplitude * np.sin(phase)
        motion = SineSum(5.0, tuple(range(1, harmonic + 1)), centre, sine, cosine)

        whole = from_rest_to_rest(motion, chain, 1e-2, 1, Allowed(chain).faults)

        assert limit_faults(whole, chain) == []


def test_no_place_is_visited_that_the_motion_does_not_visit(arm):
    motion = SineSum(5.0, (1,), np.zeros(2), np.array([[0.9], [0.4]]), np.array([[0.1], [0.7]]))

    whole = from_rest_to_rest(motion, arm.model.chain, 1e-2, 1, Allowed(arm.model.chain).faults)

    path = motion.at(np.linspace(0.0, 5.0, 5001))[0]
    away = np.array([np.abs(path - pose).max(axis=1).min() for pose in whole.q])
    assert away.max() < 1e-3


def test_what_cannot_begin_at_rest_says_why(arm):
    motion = SineSum(5.0, (1,), np.zeros(2), np.array([[0.9], [0.4]]), np.array([[0.1], [0.7]]))

    with pytest.raises(InputError, match="cannot begin at rest within the limits: too cold"):
        from_rest_to_rest(motion, arm.model.chain, 1e-1, 1, lambda whole: ["too cold"])


SEARCHES = [(name, duration) for name in ("denso_wall", "kr6", "lbr7") for duration in (2.0, 5.0, 10.0)]
QUICK = [("denso_wall", 10.0), ("kr6", 5.0), ("lbr7", 2.0)]


@pytest.mark.parametrize(("name", "duration"), slow_but_for(QUICK, SEARCHES, spread=True))
def test_every_one_of_nine_searches_for_the_condition_ends_in_a_run(name: str, duration: float):
    """Motions of LBR7 in 2 s had no lead-in: they start near a limit of position, moving away from it."""
    model = derive_model(load_robot(ROBOTS / f"{name}.toml", drive_inertia=True).chain, expand=False)
    chain = bounded(model.chain, GivenLimits(acceleration=10.0))
    columns = inertial_columns(chain, ChainRegressor(model), model.l)
    options = ExciteOptions(duration=duration, harmonics=(1, 2, 3), samples=48, evaluations=30, random=20)

    found = excite(chain, columns, options)
    whole = from_rest_to_rest(found.motion, chain, 4e-3, 1, Allowed(chain).faults)

    assert found.times > 1.0
    assert limit_faults(whole, chain) == []
    assert np.abs(whole.qd[[0, -1]]).max() < 1e-9
