"""The walk along what is in the way: to a known optimum on a boundary, and better motions of an arm in a narrow place."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from arms import urdf

from psdmc.calibration.campaign_plan import allowed_of
from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.motions import search
from psdmc.calibration.motions.allowed import GivenLimits, bounded
from psdmc.calibration.motions.criterion import all_columns
from psdmc.calibration.motions.excite import excite
from psdmc.calibration.motions.excite_options import ExciteOptions
from psdmc.calibration.motions.search import walked
from psdmc.compiler import derive


def test_it_goes_along_a_wall_to_the_nearest_point_of_it():
    """The distance from (3, 2, 0, 0) outside the unit ball, of points inside: least at that point over its length. A
    descent by slopes ends where it meets the sphere."""
    target = np.array([3.0, 2.0, 0.0, 0.0])
    asked = []

    def is_free(point: np.ndarray) -> bool:
        asked.append(point)
        return bool(np.linalg.norm(point) <= 1.0)

    found = walked(
        lambda point: float(np.linalg.norm(point - target)),
        np.array([0.0, 0.0, 0.9, 0.0]),
        is_free,
        range(2000),
        np.random.default_rng(1),
    )

    assert found == pytest.approx(target / np.sqrt(13.0), abs=0.05)
    assert np.linalg.norm(found) <= 1.0
    assert len(asked) < 1500, "what is worse is not asked for"


class Bowl:
    """The square of the distance from the origin; `cost`, without derivatives, takes a second of a clock."""

    options = ExciteOptions(evaluations=400, seconds=20.0)

    def __init__(self) -> None:
        self.now, self.told = 0.0, []

    def score(self, point: np.ndarray) -> float:
        return float(point @ point)

    def smooth(self, point: np.ndarray, power: float) -> tuple[float, np.ndarray, float]:
        return self.score(point), 2.0 * point, self.score(point)

    def cost(self, point: np.ndarray) -> float:
        self.now += 1.0
        return self.score(point)

    def progress(self, share: float, seconds: float, best: float) -> None:
        self.told.append((share, seconds))


def test_it_ends_by_the_clock_and_tells_how_far_it_is(monkeypatch):
    """The search, the walk included, has four fifths of `--seconds`, which began two seconds before."""
    bowl = Bowl()
    monkeypatch.setattr(search, "cpu_seconds", lambda: bowl.now)

    found = search.search(bowl, np.ones((1, 3)), -2.0, lambda point: True, bowl.progress)

    assert found.ended_by_clock
    assert 14.0 < bowl.now < 17.0
    assert bowl.told[-1][1] == pytest.approx(16.0, abs=1.5)
    assert all(earlier <= later for (earlier, _), (later, _) in pairwise(bowl.told))


def test_a_motion_between_shapes_gets_better_by_it(tmp_path: Path, monkeypatch):
    """A crane above a floor: its descents end after a few evaluations, as slopes lead into the foot."""
    file = tmp_path / "crane.urdf"
    file.write_text(urdf(), encoding="utf-8")
    model = derive(file)
    regressor = ChainRegressor(model)
    chain = bounded(model.mechanism, GivenLimits(acceleration=12.0))
    allowed = allowed_of(model, chain, regressor, 0.8, (), 0.2)
    columns = all_columns(regressor, model.l, LinearOptions())
    options = ExciteOptions(duration=5.0, samples=50, evaluations=120, random=50)

    first, again = (excite(chain, columns, options, None, allowed) for _ in range(2))
    monkeypatch.setattr(search, "STEPS_PER_EVALUATION", 0)
    without = excite(chain, columns, options, None, allowed)

    assert first.deviation < 0.95 * without.deviation
    assert np.array_equal(first.motion.sine, again.motion.sine)
    assert allowed.faults(first.motion.sampled(model.joint_names, 0.01)) == []
