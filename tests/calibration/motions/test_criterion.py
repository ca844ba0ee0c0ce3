"""The criterion of exciting motions, against closed forms and scipy's integrals for a single joint, and numpy's inverses."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import integrate, optimize

from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.motions.allowed import GivenLimits, bounded
from psdmc.calibration.motions.criterion import scaled, smooth_score
from psdmc.calibration.motions.excite import excite
from psdmc.calibration.motions.excite_options import ExciteOptions, chosen_objective
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.robot.load import load_robot_text

PERIOD = 4.0
OPTIONS = ExciteOptions(duration=PERIOD, harmonics=(1,), samples=64, evaluations=200, random=20)


def one_joint(axis: str) -> str:
    """A body on a joint: a pendulum about y, a wheel without weight about z."""
    return f"""<robot name="one"><link name="base"/><link name="body"><inertial><mass value="2"/><origin xyz="0.3 0 0.1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
    <joint name="hinge" type="revolute"><parent link="base"/><child link="body"/><axis xyz="{axis}"/>
    <limit lower="-1.5" upper="1.5" velocity="1.2" effort="50"/></joint></robot>"""


def robot(axis: str):
    model = derive_model(load_robot_text(one_joint(axis), "urdf").chain)
    return bounded(model.chain, GivenLimits(acceleration=9.0)), ChainRegressor(model), model.l


def test_a_wheel_is_excited_as_fast_as_its_limits_allow():
    """Y = qdd alone: a condition number of one, whatever the motion. Of q = a sin(w t) the column's length is
    a w^2 sqrt(N / 2), largest where the tightest limit is met: here the speed, a = 1.2 / w."""
    chain, regressor, l = robot("0 0 1")
    assert l == 1
    w = 2 * np.pi / PERIOD

    found = excite(chain, regressor, OPTIONS)

    best = 1.0 / (1.2 * w * np.sqrt(64 / 2))
    assert found.condition == pytest.approx(1.0)
    # the margin, the norm in place of the largest value, and samples take up to a tenth of the limits
    assert best < found.deviation < 1.1 * best
    # the condition number asks for nothing: a motion that is a thousand times slower is as good
    still = scaled(1e-3 * regressor.regressor(*(part for part in motion_of(found))))
    assert still.condition == pytest.approx(1.0)
    assert still.deviation == pytest.approx(1000.0 * found.deviation)


def motion_of(found) -> tuple[np.ndarray, ...]:
    return found.motion.at(np.arange(64) * PERIOD / 64)


def test_a_pendulums_information_is_that_of_its_integrals():
    """Y = (qdd, -g cos q, g sin q) up to the columns' order and signs; scipy integrates the products over a period."""
    chain, regressor, l = robot("0 1 0")
    assert l == 3

    found = excite(chain, regressor, OPTIONS)

    w = 2 * np.pi / PERIOD
    sine, cosine, centre = found.motion.sine[0, 0], found.motion.cosine[0, 0], found.motion.centre[0]
    angle = lambda t: centre + sine * np.sin(w * t) + cosine * np.cos(w * t)  # noqa: E731
    columns = [
        lambda t: w * w * (angle(t) - centre),
        lambda t: 9.81 * np.cos(angle(t)),
        lambda t: 9.81 * np.sin(angle(t)),
    ]
    gram = np.array(
        [[integrate.quad(lambda t, a=a, b=b: a(t) * b(t), 0, PERIOD)[0] for a in columns] for b in columns]
    )
    gram *= 64 / PERIOD
    lengths = np.sqrt(np.diag(gram))
    by_scipy = np.sqrt(np.linalg.cond(gram / np.outer(lengths, lengths)))
    assert found.condition == pytest.approx(by_scipy, rel=1e-5)
    assert found.deviation == pytest.approx(by_scipy / np.prod(lengths) ** (1 / 3), rel=1e-5)

    # no worse than what scipy's global search finds among the same sines
    def bound(point: np.ndarray) -> float:
        q = point[2] + point[0] * np.sin(w * times) + point[1] * np.cos(w * times)
        size = np.hypot(point[0], point[1])
        if abs(point[2]) + size > 1.5 or size * w > 1.2 or size * w * w > 9.0:
            return 1e9
        rows = np.column_stack([w * w * (q - point[2]), 9.81 * np.cos(q), 9.81 * np.sin(q)])
        each = np.linalg.norm(rows, axis=0)
        return float(np.linalg.cond(rows / each) / np.prod(each) ** (1 / 3))

    times = np.arange(64) * PERIOD / 64
    best = optimize.differential_evolution(bound, [(0, 1.5), (-1e-9, 1e-9), (-1.5, 1.5)], seed=1, tol=1e-8)
    assert best.fun < found.deviation < 1.25 * best.fun


@pytest.mark.parametrize("seed", range(5))
def test_it_bounds_the_standard_deviations_of_least_squares(seed: int):
    """Geometric mean of the roots of the diagonal of (A'A)^-1, by numpy, of columns of many sizes."""
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((60, 5)) @ rng.standard_normal((5, 5)) * 10.0 ** rng.uniform(-3, 3, 5)

    seen = scaled(rows)

    exact = np.sqrt(np.diag(np.linalg.inv(rows.T @ rows)))
    assert np.exp(np.mean(np.log(exact))) <= seen.deviation
    assert np.all(exact <= seen.condition / seen.lengths)
    # another unit of a parameter changes it by a constant, so that no motion gains by it
    other = scaled(rows * [1e3, 1, 1, 1, 1])
    assert other.deviation == pytest.approx(seen.deviation / 1e3 ** (1 / 5), rel=1e-6)


def test_its_smooth_form_tends_to_it():
    rows = np.random.default_rng(3).standard_normal((60, 4))
    seen = scaled(rows)

    values = [smooth_score(seen, "deviation", power)[0] for power in (1.0, 30.0, 1000.0)]

    assert values[0] > values[1] > values[2]
    assert np.exp(values[2]) == pytest.approx(seen.deviation, rel=2e-3)


def test_two_objectives_are_refused():
    assert chosen_objective(False, False) == "deviation"
    assert chosen_objective(True, False) == "condition"
    with pytest.raises(InputError, match="--condition and --log-det are two objectives"):
        chosen_objective(True, True)
