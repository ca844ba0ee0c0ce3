"""Campaigns: every wrong entry is named, another robot's campaign is refused, and none is overwritten unasked."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from psdmc.calibration.calibrate import calibrate
from psdmc.calibration.campaign import (
    PlannedRun,
    require_free,
    write_campaign,
)
from psdmc.calibration.campaign_file import listed_runs, read_campaign
from psdmc.calibration.identify.four_steps import Runs, calibrate_four_steps
from psdmc.calibration.identify.steps import GravityRun, InertialRun, Load
from psdmc.calibration.motions.allowed import GivenLimits
from psdmc.calibration.motions.excite import Excitation
from psdmc.calibration.motions.excite_options import ExciteOptions
from psdmc.calibration.motions.limited_sines import SineSum
from psdmc.calibration.motions.sweeps import (
    SineOptions,
    SweepOptions,
    gravity_sweep,
    sine_series,
    single_joint_sweep,
)
from psdmc.calibration.motions.trajectory import Trajectory, read_trajectory, write_trajectory
from psdmc.calibration.simulate_campaign import SimulateOptions, simulate_campaign
from psdmc.errors import InputError
from psdmc.report.calibrate_commands import excite_command

RUN = '[[run]]\nstep = "gravity"\nlog = "a.csv"\n'


def refused(folder: Path, text: str) -> str:
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as raised:
        listed_runs(folder)
    assert "\n" not in raised.value.message
    return raised.value.message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("run = 3", "campaign: run: found 3, expected a list"),
        ("run = [3]", "run 1: found 3, expected a table"),
        (RUN + "log2 = 1", "run 1: unknown key(s) 'log2'"),
        (RUN.replace('"a.csv"', "7"), "run 1: log: found 7, expected a text"),
        (RUN.replace('"a.csv"', '"a\\u0000.csv"'), "run 1: log: found 'a\\x00.csv'"),
        (RUN + "trajectory = 3", "run 1: trajectory: found 3"),
        (RUN + "load = { mass = 1 }", "run 1: load: com: missing"),
        (RUN + "load = { mass = nan, com = [0, 0, 0] }", "load: mass: found nan"),
        (RUN + "load = { mass = -1, com = [0, 0, 0] }", "load: mass: found -1"),
        (RUN + "load = { mass = 1e300, com = [0, 0, 0] }", "load: mass: found 1e+300"),
        (RUN + "load = { mass = 1, com = [0, 0] }", "load: com: found a list of 2"),
        (RUN + "load = { mass = 1, com = [0, 0, inf] }", "load: com: found a list of 3"),
        (RUN.replace("gravity", "motor"), "run 1: joint: missing"),
        (RUN * 1001, "1001 runs, expected at most 1000"),
        ("'" * 100, "not TOML"),
    ],
)
def test_each_wrong_entry_is_named(tmp_path: Path, text: str, message: str):
    assert message in refused(tmp_path, text)


@pytest.mark.parametrize(
    ("runs", "message"),
    [
        ([("a", True)], "joint a: a loaded motor run without an unloaded one"),
        ([("a", False)], "joint a: an unloaded motor run without a loaded one"),
        ([("a", False), ("a", False), ("a", True)], "joint a: two unloaded motor runs"),
        ([("c", False), ("c", True)], "runs of joint(s) c, which the model does not have"),
    ],
)
def test_motor_runs_come_in_pairs_of_known_joints(tmp_path: Path, runs: list[tuple[str, bool]], message: str):
    load = "load = { mass = 1, com = [0, 0, 0] }\n"
    text = "".join(
        f'[[run]]\nstep = "motor"\njoint = "{joint}"\nlog = "a.csv"\n{load if loaded else ""}'
        for joint, loaded in runs
    )
    (tmp_path / "campaign.toml").write_text(text, encoding="utf-8")

    with pytest.raises(InputError, match=re.escape(message)):
        read_campaign(tmp_path, ("a", "b"))


@pytest.mark.parametrize("left", ["gravity", "friction", "inertial"])
def test_a_campaign_without_a_step_says_which(arm, log, left: str):
    runs = Runs(
        motor=[],
        gravity=[] if left == "gravity" else [GravityRun(log)],
        friction=[],
        inertial=[] if left == "inertial" else [InertialRun(log)],
    )

    with pytest.raises(InputError, match=f"the campaign has no .*{left}.* run"):
        calibrate_four_steps(arm.model.chain, arm.regressor, arm.model.l, runs)


def test_a_campaign_is_not_mixed_with_logs(arm, campaign: Path):
    with pytest.raises(InputError, match="a campaign, given with 1 other"):
        calibrate(arm.unknown, [campaign.parent, "run.csv"])


def small_campaign(folder: Path, names: tuple[str, ...] = ("shoulder", "elbow")) -> Path:
    time = np.arange(2001) * 1e-3
    still = np.zeros((len(time), len(names)))
    motion = Trajectory(names, time, still, still, still)
    runs = (PlannedRun("gravity", "one", motion), PlannedRun("inertial", "two", replace(motion)))
    zero = np.zeros((len(names), 1))
    found = Excitation(SineSum(1.0, (1,), zero[:, 0], zero, zero), 1.0, np.ones(1), zero, 1, 0.0)
    return write_campaign(folder, runs, found, "csv")


def test_a_campaign_is_overwritten_only_when_told_to(tmp_path: Path):
    folder = tmp_path / "campaign"
    small_campaign(folder)
    (folder / "logs").mkdir()
    (folder / "logs" / "one.csv").write_text("kept", encoding="utf-8")
    before = (folder / "campaign.toml").read_bytes()

    with pytest.raises(InputError) as raised:
        small_campaign(folder, ("other",))

    found = "campaign.toml, 2 file(s) in trajectories, 1 file(s) in logs"
    assert raised.value.message == f"{folder}: holds a campaign already: {found}"
    assert "--force" in (raised.value.hint or "")
    assert (folder / "campaign.toml").read_bytes() == before
    path = tmp_path / "again"
    require_free(path)


def test_a_campaign_is_not_written_among_files_of_others(tmp_path: Path):
    folder = tmp_path / "thesis"
    folder.mkdir()
    (folder / "chapter.tex").write_text("mine", encoding="utf-8")

    for refused in (lambda: small_campaign(folder), lambda: excite_command(tmp_path / "no.npz", folder)):
        with pytest.raises(InputError) as raised:
            refused()
        assert raised.value.message == f"{folder}: psdmc did not write the files in this folder: chapter.tex"
        assert "--force" in (raised.value.hint or "")

    assert [path.name for path in folder.iterdir()] == ["chapter.tex"]
    (folder / "chapter.tex").rename(folder / ".chapter.tex")
    assert small_campaign(folder).is_file()


def test_force_replaces_the_plan_and_keeps_the_logs(tmp_path: Path):
    folder = tmp_path / "campaign"
    small_campaign(folder)
    (folder / "logs").mkdir()
    (folder / "logs" / "one.csv").write_text("kept", encoding="utf-8")
    first = listed_runs(folder)[0]
    assert first.trajectory is not None
    time = np.arange(5) * 1e-3
    other = Trajectory(("a",), time, *(np.zeros((5, 1)),) * 3)
    zero = np.zeros((1, 1))
    found = Excitation(SineSum(1.0, (1,), zero[:, 0], zero, zero), 1.0, np.ones(1), zero, 1, 0.0)

    write_campaign(folder, (PlannedRun("gravity", "one", other),), found, "csv", force=True)

    assert len(listed_runs(folder)) == 1
    assert read_trajectory(first.trajectory).joint_names == ("a",)
    assert (folder / "logs" / "one.csv").read_text(encoding="utf-8") == "kept"


def test_excite_refuses_before_it_searches(arm, tmp_path: Path):
    small_campaign(tmp_path / "campaign")

    with pytest.raises(InputError, match="holds a campaign already"):
        excite_command(tmp_path / "there is no model.npz", tmp_path / "campaign")


def test_joints_may_be_called_anything(tmp_path: Path):
    names = ("../../escape", "плечо\N{ROBOT FACE}", 'a"b', "a\x7fb")
    time = np.arange(5) * 1e-3
    still = np.zeros((5, len(names)))
    zero = np.zeros((len(names), 1))
    found = Excitation(SineSum(1.0, (1,), zero[:, 0], zero, zero), 1.0, np.ones(1), zero, 1, 0.0)
    runs = [
        PlannedRun("friction", f"friction_{name}", Trajectory(names[:3], time, *(still[:, :3],) * 3), name)
        for name in names[:3]
    ]

    write_campaign(tmp_path / "campaign", runs, found, "csv")

    assert [run.joint for run in listed_runs(tmp_path / "campaign")] == list(names[:3])
    written = sorted(path.name for path in (tmp_path / "campaign" / "trajectories").iterdir())
    assert written == ["friction_1.csv", "friction_2.csv", "friction_3.csv"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["campaign"]


def test_another_robots_campaign_is_not_simulated(arm, tmp_path: Path):
    folder = tmp_path / "campaign"
    small_campaign(folder, ("shoulder", "wrist"))

    with pytest.raises(
        InputError, match=r"moves joints shoulder, wrist, plant.toml has shoulder, elbow"
    ) as raised:
        simulate_campaign(arm.plant, folder, SimulateOptions())

    assert "another robot's" in (raised.value.hint or "")
    assert not (folder / "logs").exists()


def test_simulated_logs_stay_in_the_campaign_and_apart(arm, tmp_path: Path):
    path = small_campaign(tmp_path / "campaign")
    text = path.read_text(encoding="utf-8")

    path.write_text(text.replace("logs/one.csv", "../one.csv"), encoding="utf-8")
    with pytest.raises(InputError, match="outside the campaign's folder"):
        simulate_campaign(arm.plant, path, SimulateOptions())
    path.write_text(text.replace("logs/one.csv", "logs/two.csv"), encoding="utf-8")
    with pytest.raises(InputError, match=r"several runs write log\(s\) two.csv"):
        simulate_campaign(arm.plant, path, SimulateOptions())


@pytest.mark.parametrize("index", ["", "[1]", "{", "null", "\0"])
def test_a_damaged_index_of_simulated_logs_is_written_again(arm, tmp_path: Path, index: str):
    folder = tmp_path / "campaign"
    small_campaign(folder)
    (folder / "logs").mkdir()
    (folder / "logs" / "simulated.json").write_text(index, encoding="utf-8")

    assert simulate_campaign(arm.plant, folder, SimulateOptions(ideal_sensors=True)) == 2
    assert simulate_campaign(arm.plant, folder, SimulateOptions(ideal_sensors=True)) == 0
    assert set(json.loads((folder / "logs" / "simulated.json").read_bytes())) == {"one.csv", "two.csv"}


@pytest.mark.parametrize("index", [None, "{", '{"two.csv": ""}'])
def test_measured_logs_are_not_simulated_over(arm, tmp_path: Path, index: str | None):
    """A log that the index does not name was recorded, or psdmc cannot know."""
    folder = tmp_path / "campaign"
    small_campaign(folder)
    (folder / "logs").mkdir()
    (folder / "logs" / "one.csv").write_text("a day's work", encoding="utf-8")
    if index is not None:
        (folder / "logs" / "simulated.json").write_text(index, encoding="utf-8")

    with pytest.raises(InputError, match=r"not overwriting log\(s\) one.csv: psdmc did not simulate them"):
        simulate_campaign(arm.plant, folder, SimulateOptions(ideal_sensors=True))

    assert (folder / "logs" / "one.csv").read_text(encoding="utf-8") == "a day's work"
    assert not (folder / "logs" / "two.csv").exists()


def test_a_simulation_that_was_killed_is_done_again(
    arm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its logs are known as psdmc's, and not as done."""
    folder = tmp_path / "campaign"
    small_campaign(folder)

    def killed(work: object, jobs: list[object], workers: int) -> Iterator[str]:
        log = next(iter(listed_runs(folder))).log
        log.write_text("half", encoding="utf-8")
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("psdmc.calibration.simulate_campaign.in_processes", killed)
        with pytest.raises(KeyboardInterrupt):
            simulate_campaign(arm.plant, folder, SimulateOptions(ideal_sensors=True))

    assert simulate_campaign(arm.plant, folder, SimulateOptions(ideal_sensors=True)) == 2


def test_a_seed_that_is_none_is_refused(arm, tmp_path: Path):
    small_campaign(tmp_path / "campaign")

    with pytest.raises(InputError, match="seed is -1, expected 0 to"):
        simulate_campaign(arm.plant, tmp_path / "campaign", SimulateOptions(seed=-1))


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        ("time_s", [0.0, 0.0, 0.0, 0.0], "evenly spaced, growing times"),
        ("time_s", [3.0, 2.0, 1.0, 0.0], "evenly spaced, growing times"),
        ("time_s", [0.0, np.nan, 2.0, 3.0], "column 'time_s', row 2: nan is no motion"),
        ("position_rad.a", [0.0, 1.0, np.inf, 0.0], "column 'position_rad.a', row 3: inf is no motion"),
    ],
)
def test_a_trajectory_of_no_motion_is_refused(tmp_path: Path, column: str, value: list[float], message: str):
    from psdmc.calibration.logs.log_files import read_columns, write_columns

    motion = Trajectory(("a",), np.arange(4.0), *(np.zeros((4, 1)),) * 3)
    write_trajectory(motion, tmp_path / "motion.csv")
    columns = read_columns(tmp_path / "motion.csv") | {column: np.array(value)}
    write_columns(columns, tmp_path / "motion.csv")

    with pytest.raises(InputError, match=re.escape(message)):
        read_trajectory(tmp_path / "motion.csv")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"duration": 1e9}, "duration is 1e+09, expected 0.1 to 120"),
        ({"duration": np.nan}, "duration is nan"),
        ({"seconds": np.inf}, "seconds is inf"),
        ({"seed": 2**32}, "seed is 4.29497e+09, expected 0 to"),
        ({"margin": 1.0}, "margin is 1, expected 0.05 to 0.99"),
        ({"torque_margin": 0.0}, "torque margin is 0, expected"),
        ({"seed": -1}, "seed is -1"),
        ({"harmonics": ()}, "harmonics is 0"),
        ({"harmonics": (1, 10**6)}, "highest harmonic is 1e+06"),
    ],
)
def test_an_exciting_motion_has_bounds(options: dict[str, object], message: str):
    with pytest.raises(InputError, match=re.escape(message)):
        ExciteOptions(**options)  # type: ignore[arg-type]


@pytest.mark.parametrize("acceleration", [0.0, -1.0, np.nan, np.inf])
def test_an_acceleration_is_a_positive_number(acceleration: float):
    with pytest.raises(InputError, match="acceleration is"):
        GivenLimits(acceleration=acceleration)


@pytest.mark.parametrize("speed", [1e-9, 0.0])
def test_limits_that_make_motions_endless_are_refused(arm, speed: float):
    first, *others = arm.model.chain.joints
    slow = replace(
        arm.model.chain, joints=(replace(first, limits=replace(first.limits, speed=speed)), *others)
    )
    sines = replace(SineOptions(), largest=0.5)

    with pytest.raises(InputError, match="joint shoulder: its s"):
        single_joint_sweep(slow, 0, np.zeros(2), SweepOptions())
    with pytest.raises(InputError, match="joint shoulder: "):
        sine_series(slow, 0, np.zeros(2), sines)
    if speed == 0.0:
        with pytest.raises(InputError, match="joint shoulder: its speed limit is 0"):
            gravity_sweep(slow, 1, SweepOptions(seconds=4.0))


def test_a_joint_without_room_has_no_sines(arm):
    first, *others = arm.model.chain.joints
    stuck = replace(first, limits=replace(first.limits, lower=0.3, upper=0.3))
    chain = replace(arm.model.chain, joints=(stuck, *others))

    with pytest.raises(InputError, match="joint shoulder: no room for sines"):
        sine_series(chain, 0, np.array([0.3, 0.0]), SineOptions())


def test_a_load_is_what_it_was(tmp_path: Path):
    run = RUN + "load = { mass = 3.5, com = [0.08, 0, -0.06] }\n"
    (tmp_path / "campaign.toml").write_text(run, encoding="utf-8")

    assert listed_runs(tmp_path)[0].load == Load(3.5, (0.08, 0.0, -0.06))
