"""What is found of a joint that slides is in N, N s/m and N/A, in every table; a column of both kinds says both units."""

from __future__ import annotations

import re

import numpy as np
import pytest
from bundled import bundled_model

from psdmc.calibration.calibrate import CalibrateOptions, calibrate_logs
from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.logs.log import Log
from psdmc.calibration.verdict.record import Calibration
from psdmc.cli.show import print_calibration
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.report.calibrate_report import report_html

CONSTANTS = {"J1": 3.0, "J2": 2.0, "J3": 40.0, "J4": 0.5}


@pytest.fixture(scope="module")
def scara() -> DynamicsModel:
    return bundled_model("scara")


@pytest.fixture(scope="module")
def record(scara: DynamicsModel) -> Calibration:
    """Of currents, with viscous friction of a second exponent; one joint slides."""
    rng, time = np.random.default_rng(2), np.arange(0.0, 20.0, 0.01)
    rates, starts = rng.uniform(0.5, 4.0, (3, 4)), rng.uniform(0.0, 6.0, (3, 4))
    turning = time[:, None, None] * rates + starts
    q, qd = 0.05 * np.sin(turning).sum(1), 0.05 * (rates * np.cos(turning)).sum(1)
    torque = scara.inverse_dynamics(q, qd, -0.05 * (rates**2 * np.sin(turning)).sum(1))
    torque = torque + 0.3 * np.tanh(qd / 0.03) + 0.2 * qd + 1e-3 * rng.normal(size=q.shape)
    slides = tuple(j.name for j in scara.mechanism.joints if j.type.position_unit == "m")
    assert len(slides) == 1
    effort = torque / list(CONSTANTS.values())
    log = Log("scara", scara.joint_names, time, q, None, effort, "current", sliding=slides)
    options = CalibrateOptions(physical=False, linear=LinearOptions(exponents=(1.0, 2.0)))
    return calibrate_logs(scara, [log], options, ChainRegressor(scara), CONSTANTS, print)


def test_rows_have_the_units_of_their_joint(scara: DynamicsModel, record: Calibration) -> None:
    for joint in scara.mechanism.joints:
        found = {row.name: row.unit for row in (*record.motors, *record.friction) if row.joint == joint.name}
        turns = joint.type.position_unit == "rad"
        assert found == {
            "torque_constant": "Nm/A" if turns else "N/A",
            "coulomb": "Nm" if turns else "N",
            "viscous": "Nms/rad" if turns else "Ns/m",
            "viscous^2": "Nm (s/rad)^2" if turns else "N (s/m)^2",
            "offset": "Nm" if turns else "N",
        }


def test_tables_say_both_units_and_each_number_once(
    record: Calibration, capsys: pytest.CaptureFixture[str]
) -> None:
    page = report_html(record)
    assert "coulomb [Nm, N]" in page
    assert "torque constant [Nm/A, N/A]" in page
    print_calibration(record)
    heads = " ".join(re.findall(r"^joint .*$", capsys.readouterr().out, flags=re.MULTILINE))
    assert heads.count("coulomb") == 1
    assert "coulomb [Nm, N]" in heads
