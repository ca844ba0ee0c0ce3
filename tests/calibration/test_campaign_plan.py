"""What a plan holds and says: its options, joints that no load reaches, one log, sizes, and what was not looked at."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from quick_campaign import QUICK

from psdmc.calibration.calibrate import calibrate
from psdmc.calibration.campaign import summary, write_campaign
from psdmc.calibration.campaign_file import listed_runs
from psdmc.calibration.campaign_plan import CampaignOptions, plan_campaign
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.identify.steps import Load
from psdmc.calibration.motions.allowed import GivenLimits, bounded
from psdmc.calibration.motions.excite_options import ExciteOptions
from psdmc.calibration.motions.sweeps import SineOptions, SweepOptions
from psdmc.calibration.motions.trajectory import limit_faults, read_trajectory
from psdmc.calibration.simulate_campaign import SimulateOptions, simulate_campaign
from psdmc.compiler import derive
from psdmc.errors import InputError

BODY = (
    '<inertial><origin xyz="0.01 0.02 {z}"/><mass value="2"/>'
    '<inertia ixx="0.05" iyy="0.06" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>'
)


def two_axes(axis: str = "0 0 1", mimic: str = "") -> str:
    """A turntable with a lever: gravity is along -z."""
    limit = '<limit lower="-2" upper="2" velocity="3" effort="80"/>'
    links = "".join(f'<link name="{name}">{BODY.format(z=0.2)}</link>' for name in ("base", "table", "lever"))
    return (
        f'<robot name="turntable">{links}<joint name="table_joint" type="revolute"><parent link="base"/>'
        f'<child link="table"/><axis xyz="{axis}"/>{limit}</joint><joint name="lever_joint" type="revolute">'
        f'<parent link="table"/><child link="lever"/><origin xyz="0.1 0 0.3"/><axis xyz="0 1 0"/>{limit}{mimic}</joint>'
        "</robot>"
    )


SMALL = replace(
    QUICK,
    limits=GivenLimits(acceleration=10.0),
    excite=ExciteOptions(duration=4.0, samples=40, evaluations=20, random=10),
    load=Load(2.0, (0.1, 0.0, 0.3)),
)


def planned(folder: Path, options: CampaignOptions, text: str | None = None):
    file = folder / "turntable.urdf"
    file.write_text(text or two_axes(), encoding="utf-8")
    model = derive(file)
    return plan_campaign(model, ChainRegressor(model), options)


def test_an_axis_along_gravity_is_said_when_planning(tmp_path: Path):
    plan, tilted = planned(tmp_path, SMALL), planned(tmp_path, SMALL, two_axes(axis="0 0.1 1"))

    said = [remark for remark in plan.remarks if "table_joint" in remark]
    assert len(said) == 1
    assert "its axis is along gravity" in said[0]
    assert "--torque-constants 'table_joint'=NM_PER_A" in said[0]
    assert {run.joint for run in plan.runs if run.step == "motor"} == {"lever_joint"}
    assert {run.joint for run in tilted.runs if run.step == "motor"} == {"table_joint", "lever_joint"}
    assert not any("table_joint" in remark for remark in tilted.remarks)


def test_a_load_on_the_axis_of_a_joint_is_said_too(arm):
    """The elbow carries the tip frame on its own axis only where the arm between them has no length: 0.3 m here."""
    on_elbow = replace(QUICK, load=Load(2.0, (-0.3, 0.0, 0.0)))

    plan = plan_campaign(arm.model, arm.regressor, on_elbow)

    assert any("joint 'elbow': the load acts on it in no pose" in remark for remark in plan.remarks)
    assert {run.joint for run in plan.runs if run.step == "motor"} == {"shoulder"}


def test_without_a_load_there_are_no_motor_runs(arm):
    plan = plan_campaign(arm.model, arm.regressor, replace(QUICK, load=None))

    assert {run.step for run in plan.runs} == {"gravity", "friction", "inertial"}
    assert any("has to log torques" in remark for remark in plan.remarks)


def test_rows_have_the_rate_and_runs_the_length_that_was_asked_for(arm, tmp_path: Path):
    options = replace(
        QUICK,
        sweep=replace(QUICK.sweep, period=1 / 200),
        sines=replace(QUICK.sines, period=1 / 200),
        excite=replace(QUICK.excite, duration=7.0, evaluations=20),
        repeats=3,
    )

    plan = plan_campaign(arm.model, arm.regressor, options)
    write_campaign(tmp_path / "campaign", plan.runs, plan.found, "csv")

    for run in listed_runs(tmp_path / "campaign"):
        assert run.trajectory is not None
        motion = read_trajectory(run.trajectory)
        assert motion.period == pytest.approx(1 / 200, rel=1e-9)
        if run.step == "inertial":
            assert motion.duration > 21.0
            # between the ramps the motion repeats itself
            rows = round(7.0 * 200)
            middle = len(motion.q) // 2
            assert np.allclose(motion.q[middle - rows // 2], motion.q[middle + rows // 2], atol=1e-9)


@pytest.mark.parametrize(("one_log", "rate", "message"), [(False, 100.0, "160"), (True, 20.0, "32")])
def test_too_few_rows_for_the_filters_are_refused(one_log: bool, rate: float, message: str):
    with pytest.raises(
        InputError, match=f"--rate is {rate:g} rows a second, expected at least {message} for"
    ):
        CampaignOptions(
            sweep=SweepOptions(period=1 / rate), sines=SineOptions(period=1 / rate), one_log=one_log
        )


def test_joints_that_follow_others_are_refused(tmp_path: Path):
    with pytest.raises(InputError, match="campaigns are for joints that follow no other"):
        planned(tmp_path, SMALL, two_axes(mimic='<mimic joint="table_joint" multiplier="0.5"/>'))


def test_one_log_is_planned_and_calibrated_by_the_folder(arm, tmp_path: Path):
    options = replace(QUICK, one_log=True, repeats=4, excite=replace(QUICK.excite, evaluations=200))
    plan = plan_campaign(arm.model, arm.regressor, options)
    folder = tmp_path / "one"
    write_campaign(folder, plan.runs, plan.found, "npz")
    simulate_campaign(arm.plant, folder, SimulateOptions(ideal_sensors=True))

    record = calibrate(
        arm.model, folder, regressor=arm.regressor, torque_constants={"shoulder": 12.0, "elbow": 5.0}
    )

    assert [run.name for run in plan.runs] == ["exciting"]
    assert [step.step for step in record.steps] != []
    held_out = [both.held_out.r2 for both in record.steps[0].joints.values()]
    assert min(held_out) > 0.99
    assert record.model.theta_b is not None
    size = np.abs(arm.model.theta_b).max()
    assert np.abs(record.model.theta_b - arm.model.theta_b).max() < 0.05 * size


def test_no_value_is_fitted_to_a_validation_run(arm, tmp_path: Path):
    options = replace(QUICK, one_log=True, validation=True, repeats=4)
    plan = plan_campaign(arm.model, arm.regressor, options)
    folder, given = tmp_path / "two", {"shoulder": 12.0, "elbow": 5.0}
    write_campaign(folder, plan.runs, plan.found, "npz")
    simulate_campaign(arm.plant, folder, SimulateOptions(ideal_sensors=True))
    fitted, other = (folder / "logs" / f"{name}.npz" for name in ("exciting", "validation"))

    record = calibrate(arm.model, folder, regressor=arm.regressor, torque_constants=given)
    apart = calibrate(arm.model, fitted, regressor=arm.regressor, torque_constants=given, validation=other)

    assert [(run.step, run.name) for run in plan.runs] == [
        ("inertial", "exciting"),
        ("validation", "validation"),
    ]
    a, b = (read_trajectory(folder / "trajectories" / file.name).q for file in (fitted, other))
    assert np.abs(np.resize(a, b.shape) - b).max() > 0.1
    assert allowed_faults(plan) == []
    assert record.model.theta_b is not None
    assert np.array_equal(record.model.theta_b, apart.model.theta_b)
    held = [both.held_out.r2 for both in record.steps[0].joints.values()]
    assert held == [both.held_out.r2 for both in apart.steps[0].joints.values()]
    assert min(held) > 0.99


def allowed_faults(plan) -> list[str]:
    return [fault for run in plan.runs for fault in limit_faults(run.motion, plan.chain)]


def test_a_search_that_the_clock_ends_says_so(arm):
    late = replace(QUICK, one_log=True, excite=replace(QUICK.excite, seconds=0.0))

    plan = plan_campaign(arm.model, arm.regressor, late)

    assert any("the search stopped at the limit of --seconds: " in remark for remark in plan.remarks)
    assert plan_campaign(arm.model, arm.regressor, replace(QUICK, one_log=True)).remarks == ()


def test_the_summary_counts_what_was_written(arm, tmp_path: Path):
    plan = plan_campaign(arm.model, arm.regressor, QUICK)
    write_campaign(tmp_path / "campaign", plan.runs, plan.found, "npz")

    lines = summary(plan, tmp_path / "campaign")

    size = sum(path.stat().st_size for path in (tmp_path / "campaign" / "trajectories").iterdir()) / 2**20
    minutes = sum(run.motion.duration for run in plan.runs) / 60
    assert lines[0].startswith(
        f"{len(plan.runs)} runs, {minutes:.1f} min of motion; trajectories {size:.1f} MiB"
    )
    assert lines[1].split() == ["motor", "4", "runs", f"{sum_of(plan, 'motor'):.1f}", "min"]
    mounted = next(line for line in lines if line.startswith("mount: "))
    assert "3 kg with its centre of mass at (0.1, 0.05, 0) m" in mounted
    assert "_loaded (2), nothing for the others (6)" in mounted
    assert any(line.startswith("exciting motion: condition number ") for line in lines)
    assert sum(line.startswith("not checked") for line in lines) == 3


def sum_of(plan, step: str) -> float:
    return sum(run.motion.duration for run in plan.runs if run.step == step) / 60


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            GivenLimits(ranges={"wrist": (0.0, 1.0)}),
            "limits for joint(s) 'wrist', which the model does not have",
        ),
        (GivenLimits(ranges={"elbow": (1.0, 0.0)}), "joint 'elbow': range 1 to 0 is none"),
        (GivenLimits(ranges={"elbow": (-200.0, 1.0)}), "exceeds the file's"),
        (GivenLimits(speeds={"elbow": 50.0}), "joint 'elbow': speed 50, the file's limit is 5"),
    ],
)
def test_limits_that_are_given_are_checked(arm, given: GivenLimits, message: str):
    with pytest.raises(InputError) as raised:
        bounded(arm.model.chain, given)
    assert message in raised.value.message


def test_given_limits_are_kept_by_every_run(arm):
    given = GivenLimits(
        ranges={"elbow": (-0.4, 0.9)}, speeds={"shoulder": 1.5}, accelerations={"shoulder": 4.0, "elbow": 9.0}
    )

    plan = plan_campaign(arm.model, arm.regressor, replace(QUICK, limits=given))

    for run in plan.runs:
        assert -0.4 <= run.motion.q[:, 1].min() <= run.motion.q[:, 1].max() <= 0.9
        assert np.abs(run.motion.qd[:, 0]).max() <= 1.5
        assert np.abs(run.motion.qdd).max(axis=0)[0] <= 4.0
        assert np.abs(run.motion.qdd).max(axis=0)[1] <= 9.0
