"""`psdmc validate` on logs of a virtual arm whose changes are known, and on a real robot's log."""

from __future__ import annotations

import json
import re
import shlex
from dataclasses import replace
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest
from command_line import typed
from shared_data import UR10_LOG
from test_ur10 import model as ur10_model  # noqa: F401  a fixture
from worn_arm import CONSTANTS, VISCOUS, Worn, changed, recorded

import psdmc
from psdmc.calibration.logs.log_files import read_log, write_log
from psdmc.calibration.plant.virtual_robot import Payload
from psdmc.calibration.validation import Validation, validate
from psdmc.calibration.verdict import changes
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.report.validate_report import validation_page

LOAD = Payload(0.5, (0.05, -0.02, 0.0))


@pytest.fixture(scope="module")
def table(arm) -> Path:
    return arm.folder / "two_link.toml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("worn")


@pytest.fixture(scope="module")
def file(arm, table: Path, folder: Path) -> Path:
    """A model that a log of torques calibrated."""
    found = psdmc.calibrate(arm.model, recorded(folder, "first", Worn(seed=100), table))
    psdmc.save(found.model, folder / "calibrated.npz")
    return folder / "calibrated.npz"


def test_an_unchanged_arm_is_still_valid_and_figures_are_the_log_s(file: Path, folder: Path, table: Path):
    found = psdmc.validate(file, [recorded(folder, name, Worn(seed=k), table) for k, name in enumerate("ab")])

    assert (found.word, found.exit_status) == ("still valid", 0)
    assert found.doubts == found.named == ()
    assert found.load is None
    assert set(found.r2_by_log) == {"a.csv", "b.csv"}
    noise = (
        CONSTANTS * np.hypot(0.01, 1e-3 / np.sqrt(12.0)) * np.sqrt(8.0 / 50.0)
    )  # below the cut-off of 8 Hz at 100 Hz
    for joint, level in zip(found.joints, noise, strict=True):
        assert joint.rms == pytest.approx(level, rel=0.2)
        assert joint.rms < joint.largest < 5.0 * joint.rms
        assert joint.r2 > 0.999
        assert len(joint.by_speed) == len(joint.by_time) == 10


@pytest.fixture(scope="module")
def ideal(arm, table: Path, folder: Path) -> DynamicsModel:
    """A model that a log without noise calibrated, so that its standard deviations are tiny."""
    return psdmc.calibrate(arm.model, recorded(folder, "ideal", Worn(seed=100, noise=0.0), table)).model


WORN = (VISCOUS[0], 1.1 * VISCOUS[1])


@pytest.mark.parametrize(
    ("how", "word", "named"),
    [
        pytest.param(Worn(seed=5), "still valid", [], id="same"),
        pytest.param(Worn(seed=10), "still valid", [], id="other motion"),
        pytest.param(Worn(seed=11), "still valid", [], id="third motion"),
        pytest.param(Worn(seed=1, load=Payload(0.0003, LOAD.com)), "still valid", [], id="0.3 g"),
        pytest.param(Worn(seed=1, load=Payload(0.002, LOAD.com)), "still valid", [], id="2 g"),
        pytest.param(Worn(seed=1, load=Payload(0.1, LOAD.com)), "changed load", [], id="100 g"),
        pytest.param(Worn(seed=2, viscous=WORN), "drifted", ["viscous of elbow"], id="friction"),
        pytest.param(
            Worn(seed=3, viscous=WORN, load=Payload(0.0003, LOAD.com)),
            "drifted",
            ["viscous of elbow"],
            id="friction and 0.3 g",
        ),
        pytest.param(
            Worn(seed=2, viscous=(1.1 * VISCOUS[0], 1.004 * VISCOUS[1])),
            "drifted",
            ["viscous of shoulder"],
            id="friction, and 0.4 % of another",
        ),
    ],
)
def test_without_noise_only_what_changes_a_torque_counts(ideal, folder: Path, table: Path, how, word, named):
    found = validate(ideal, recorded(folder, "of_ideal", replace(how, noise=0.0), table))

    assert found.word == word
    assert [change.name for change in found.named] == named
    if how.load is not None and word == "changed load":
        assert found.load is not None
        assert found.load.mass == pytest.approx(how.load.mass, rel=0.02)
    if named:
        assert found.named[0].change == pytest.approx(0.1 * found.named[0].value, rel=0.02)


@pytest.mark.parametrize(("seed", "pace", "doubts"), [(31, 0.5, []), (41, 0.7, ["none_sure"])])
def test_a_motion_that_the_model_predicts_badly_shows_no_change(
    arm, folder: Path, table: Path, seed: int, pace: float, doubts: list[str]
):
    """Friction that grows with speed^0.6, of which a fast motion needs other values than a slow one. The test of the
    calibration shows this."""
    fast = Worn(seed=seed + 1, viscosity="viscous^0.6")
    slow = recorded(folder, "slow", replace(fast, seed=seed, pace=pace), table)
    log = recorded(folder, "fast", fast, table)
    model = psdmc.calibrate(arm.model, slow, validation=log).model

    found = validate(model, log)
    worn = validate(model, recorded(folder, "fast_worn", replace(fast, viscous=(4.0, 2.4)), table))

    assert (found.word, found.as_json()["codes"]["doubts"]) == ("still valid", doubts)
    assert worn.word == "drifted"
    assert all(change.name.endswith("of elbow") for change in worn.named)


def test_viscous_friction_that_grew_by_half_is_named_with_its_change(file: Path, folder: Path, table: Path):
    log = recorded(folder, "viscous", Worn(seed=5, viscous=(VISCOUS[0], 1.5 * VISCOUS[1])), table)

    found = validate(file, log)

    assert (found.word, found.exit_status) == ("drifted", 5)
    (change,) = found.named
    assert change.name == "viscous of elbow"
    assert change.value + change.change == pytest.approx(1.5 * VISCOUS[1], abs=3.0 * change.std)
    assert change.sigmas > 10.0
    elbow = found.joints[1]
    assert elbow.forward > 0.0 > elbow.backward
    assert elbow.by_speed[0].mean < 0.0 < elbow.by_speed[-1].mean


@pytest.mark.parametrize("viscous", [VISCOUS, (VISCOUS[0], 1.5 * VISCOUS[1])])
def test_a_load_is_found_with_its_mass_and_place(file: Path, folder: Path, table: Path, viscous):
    log = recorded(folder, "loaded", Worn(seed=6, load=LOAD, viscous=viscous), table)

    found = validate(file, log)

    assert (found.word, found.exit_status) == ("changed load", 5)
    assert found.load is not None
    assert found.load.mass == pytest.approx(LOAD.mass, abs=3.0 * found.load.mass_std)
    assert found.load.mass_std < 0.05 * LOAD.mass
    assert found.load.com[:2] == pytest.approx(LOAD.com[:2], abs=0.01)
    assert np.isnan(found.load.com[2])  # along the axes of a planar arm
    assert [change.name for change in found.named] == ["viscous of elbow"] * (viscous != VISCOUS)


def test_a_load_that_makes_torques_look_like_another_unit_s_is_a_load(file: Path, folder: Path, table: Path):
    log = recorded(folder, "three", Worn(seed=16, load=Payload(3.0, LOAD.com)), table)

    found = validate(file, log)

    assert found.word == "changed load"
    assert found.load is not None
    assert found.load.mass == pytest.approx(3.0, abs=3.0 * found.load.mass_std)
    assert validate(file, changed(log, "milli", 1000.0 * read_log(log).effort)).word == "log not usable"


def test_a_load_that_was_taken_off_has_a_negative_mass(arm, folder: Path, table: Path):
    carried = psdmc.calibrate(arm.model, recorded(folder, "with", Worn(seed=8, load=LOAD), table)).model

    found = validate(carried, recorded(folder, "without", Worn(seed=9), table))

    assert found.word == "changed load"
    assert found.load is not None
    assert found.load.mass == pytest.approx(-LOAD.mass, abs=3.0 * found.load.mass_std)


def test_errors_are_also_said_in_amperes_where_the_constants_are_known(arm, folder: Path, table: Path):
    constants = dict(zip(arm.model.joint_names, CONSTANTS.tolist(), strict=True))
    log = recorded(folder, "amperes", Worn(seed=11, quantity="current"), table)
    model = psdmc.calibrate(arm.model, log, torque_constants=constants).model

    found = validate(model, recorded(folder, "later", Worn(seed=12, quantity="current"), table))

    assert found.word == "still valid"
    for joint, constant in zip(found.joints, CONSTANTS, strict=True):
        assert joint.rms_current == pytest.approx(joint.rms / constant)
        assert joint.largest_current == pytest.approx(joint.largest / constant)


def printed_next(done: CompletedProcess[str]) -> list[str]:
    """The words of the command that the last line suggests, without `psdmc`."""
    said, program, *words = shlex.split(done.stderr.splitlines()[-1])
    assert (said, program) == ("next:", "psdmc")
    return words


RENAMED = ("--joint-map", "m1=shoulder,m2=elbow")


@pytest.fixture(scope="module")
def electric(arm, folder: Path, table: Path) -> Path:
    """A model that a campaign of one motion and one for the test calibrated, from logs of currents; their folder."""
    campaign, run = folder / "campaign", '[[run]]\nstep = "{}"\nlog = "{}.csv"\n'
    campaign.mkdir()
    for seed, step in ((11, "inertial"), (12, "validation")):
        recorded(campaign, step, Worn(seed=seed, quantity="current"), table)
    text = "".join(run.format(step, step) for step in ("inertial", "validation"))
    (campaign / "campaign.toml").write_text(text, encoding="utf-8")
    constants = dict(zip(arm.model.joint_names, CONSTANTS.tolist(), strict=True))
    psdmc.save(psdmc.calibrate(arm.model, campaign, torque_constants=constants).model, campaign / "model.npz")
    return campaign


def test_the_motion_that_tested_a_campaign_was_not_fitted(electric: Path):
    found, again = (
        validate(electric / "model.npz", electric),
        validate(electric / "model.npz", electric / "inertial.csv"),
    )

    assert (found.word, found.doubts) == ("still valid", ())
    assert set(found.r2_by_log) == {"validation.csv"}
    assert again.as_json()["codes"]["doubts"] == ["used_before"]


def test_the_next_line_calibrates_from_currents_again(electric: Path, folder: Path, table: Path):
    how = Worn(seed=13, quantity="current", viscous=WORN)
    text = recorded(folder, "worn_amperes", how, table).read_text(encoding="utf-8")
    (folder / "other names.csv").write_text(
        text.replace(".shoulder", ".m1").replace(".elbow", ".m2"), encoding="utf-8"
    )

    done = typed("validate", electric / "model.npz", folder / "other names.csv", *RENAMED)
    again = typed(*printed_next(done), cwd=folder)

    assert done.returncode == 5
    assert again.returncode == 0, again.stderr
    assert (
        "note: torque constants are those of the calibrated input model: shoulder=12, elbow=5 N m/A"
        in again.stdout
    )
    now = psdmc.load(folder / "model_new.npz").calibrated
    assert now is not None
    assert [row.value for row in now.motors] == pytest.approx(CONSTANTS)
    (viscous,) = [row for row in now.friction if (row.joint, row.name) == ("elbow", "viscous")]
    assert viscous.value == pytest.approx(WORN[1], abs=4.0 * viscous.std)


def test_the_next_line_finds_the_load_of_a_campaign_s_log(
    electric: Path, folder: Path, table: Path, tmp_path: Path
):
    for name in ("campaign.toml", "inertial.csv"):
        (tmp_path / name).write_bytes((electric / name).read_bytes())
    log = recorded(tmp_path, "validation", Worn(seed=14, quantity="current", load=LOAD), table)
    given = ",".join(f"{name}={value}" for name, value in zip(("shoulder", "elbow"), CONSTANTS, strict=True))

    done = typed("validate", electric / "model.npz", tmp_path, "--torque-constants", given)
    again = typed(*printed_next(done), cwd=tmp_path)

    assert done.returncode == 5
    assert printed_next(done)[:3] == ["payload", str(electric / "model.npz"), str(log)]
    assert again.returncode == 0, again.stderr
    assert (tmp_path / "load.toml").exists()


@pytest.mark.parametrize(
    ("load", "word"), [(Payload(0.5, (0.05, 0, 0)), "drifted"), (LOAD, "log not usable")]
)
def test_a_load_on_a_link_that_admits_none_is_said(arm, folder: Path, table: Path, load: Payload, word: str):
    model = psdmc.derive(table, assume_zero=["link2:my"])
    model = psdmc.calibrate(model, recorded(folder, "zeros", Worn(seed=41), table)).model

    found = validate(model, recorded(folder, "zeros_loaded", Worn(seed=42, load=load), table))

    assert found.word == word
    assert found.as_json()["codes"]["doubts"][-1] == "refuses_load"
    assert (
        "if the robot carries a load, this model cannot show it: link 'link2' cannot carry"
        in found.doubts[-1]
    )


def spoiled(path: Path, how: str) -> Path:
    effort = read_log(path).effort
    if how == "clipped":
        return changed(path, how, np.clip(effort, -0.4 * np.abs(effort).max(0), 0.4 * np.abs(effort).max(0)))
    if how == "short":
        write_log(read_log(path).between(0.0, 1.0), path.with_name("short.csv"))
        return path.with_name("short.csv")
    if how == "renamed":
        text = path.read_text(encoding="utf-8").replace(".elbow", ".wrist")
        path.with_name("renamed.csv").write_text(text, encoding="utf-8")
        return path.with_name("renamed.csv")
    return changed(path, how, swap=True)


CODES = {"clipped": "saturated", "short": "refused", "renamed": "refused", "swapped": "low_r2"}


@pytest.mark.parametrize("how", CODES)
def test_a_log_that_shows_nothing_is_not_usable_and_says_why(file: Path, folder: Path, table: Path, how: str):
    found = validate(file, spoiled(recorded(folder, "good", Worn(seed=13), table), how))

    assert (found.word, found.exit_status) == ("log not usable", 6)
    assert CODES[how] in found.as_json()["codes"]["reasons"]
    assert found.load is None
    assert not found.named


def test_a_log_of_an_arm_of_another_length_is_not_usable(file: Path, folder: Path, table: Path):
    text = table.read_text(encoding="utf-8").replace("a = 0.4", "a = 1.1").replace("mass = 1.5", "mass = 9.0")
    (folder / "long.toml").write_text(text.replace("com = [-0.1,", "com = [-0.9,"), encoding="utf-8")

    found = validate(file, recorded(folder, "of_long", Worn(seed=14), folder / "long.toml"))

    assert found.word == "log not usable"
    assert "wrong_gains" in found.as_json()["codes"]["reasons"]


def test_links_that_seem_to_wear_are_doubted(file: Path, folder: Path, table: Path):
    text = table.read_text(encoding="utf-8").replace("com = [-0.15, 0.02,", "com = [-0.2, 0.1,")
    text = text.replace("drive_inertia = 0.3", "drive_inertia = 0.6").replace(
        "drive_inertia = 0.1", "drive_inertia = 0.3"
    )
    (folder / "rebuilt.toml").write_text(text, encoding="utf-8")

    found = validate(file, recorded(folder, "of_rebuilt", Worn(seed=17), folder / "rebuilt.toml"))

    assert found.exit_status == 5
    assert found.as_json()["codes"]["doubts"] == ["other_links"]
    assert "is the log another robot's, or has the robot been rebuilt?" in found.doubts[0]


def test_more_changes_than_a_worn_robot_has_are_another_robot_s(
    file: Path, folder: Path, table: Path, monkeypatch: pytest.MonkeyPatch
):
    """Eight values explain any arm of two links, so that fewer are allowed here."""
    log = recorded(folder, "heavy", Worn(seed=15, load=Payload(1.5, LOAD.com)), table)
    monkeypatch.setattr(changes, "MOST_NAMED", 0)

    found = validate(file, log)

    assert found.word == "log not usable"
    assert found.as_json()["codes"]["reasons"] == ["another_robot"]


def test_the_log_of_the_calibration_itself_is_doubted_first(file: Path, folder: Path):
    done = typed("validate", file, folder / "first.csv", "--report", folder / "page.html")

    assert done.returncode == 0
    first, second, *_ = done.stdout.splitlines()
    assert first.startswith("doubt: first.csv: looks like a log that the model was calibrated with")
    assert second == "verdict: still valid"
    page = (folder / "page.html").read_text(encoding="utf-8")
    said = json.loads((folder / "page.json").read_text(encoding="utf-8"))
    assert (said["kind"], said["word"], said["exit_status"]) == ("validation", "still valid", 0)
    assert "used_before" in said["codes"]["doubts"]
    assert page.count("<svg") == 6
    test = f"chi-square {said['chi2']:.4g}, {said['freedom']} degrees of freedom, probability {said['chance']:.2g}"
    line = f"all changes: {test}"
    assert f"{line} if the robot is unchanged" in done.stdout
    assert f"<p>{line} if the robot is unchanged</p>" in page
    assert f"{said['joints'][0]['r2']:.4f}" in page


def test_the_command_ends_with_the_verdict_s_status_and_the_next_step(file: Path, folder: Path, table: Path):
    log = recorded(folder, "carried", Worn(seed=6, load=LOAD), table)

    done = typed("validate", file, log)
    clipped = typed(
        "validate", file, spoiled(recorded(folder, "good", Worn(seed=13), table), "clipped"), "--json"
    )

    assert done.returncode == 5
    assert re.search(r"^verdict: changed load\n  load: a load of \+0\.5", done.stdout, re.MULTILINE)
    assert done.stderr.splitlines()[-1] == f"next: psdmc payload {file} {log} -o load.toml"
    assert clipped.returncode == 6
    assert json.loads(clipped.stdout)["word"] == "log not usable"


def test_the_page_has_the_verdict_s_change_and_says_why_the_other_table_differs(
    file: Path, folder: Path, table: Path
):
    found = validate(
        file, recorded(folder, "viscous", Worn(seed=5, viscous=(VISCOUS[0], 1.5 * VISCOUS[1])), table)
    )

    tables = {each.title: each for each in validation_page(found).tables}
    (named,) = tables["Named changes"].rows
    (alike,) = [row for row in tables["Changes of all values"].rows if row[0] == named[0]]
    assert named[0] == "viscous of elbow"
    assert float(named[2]) == pytest.approx(found.named[0].change, rel=0.01)
    assert float(alike[3]) > float(named[3])
    assert "a named value has another change" in tables["Changes of all values"].caption


def test_a_model_that_was_not_calibrated_and_a_missing_log_are_refused(arm, file: Path, folder: Path):
    with pytest.raises(InputError, match="holds no calibration"):
        validate(arm.model, folder / "first.csv")
    with pytest.raises(InputError, match=r"none\.csv"):
        validate(file, folder / "none.csv")
    with pytest.raises(InputError, match="torque constants"):
        validate(file, folder / "first.csv", {"shoulder": 3.0})


def test_a_campaign_s_model_predicts_a_plain_log_with_its_friction(noisy, plant_log, tmp_path: Path):
    """PLANT's LuGre friction, in another motion than the campaign's, and the campaign itself."""
    campaign, record = noisy
    write_log(plant_log, tmp_path / "plant.csv")

    found, again = validate(record.model, tmp_path / "plant.csv"), validate(record.model, campaign)

    assert all(joint.r2 > 0.99 for joint in found.joints)
    assert found.word == "still valid"
    assert again.word == "still valid"
    assert all(joint.r2 > 0.98 for joint in again.joints)


@pytest.mark.slow
def test_unchanged_arms_raise_no_false_alarm(arm, folder: Path, table: Path):
    """Forty pairs of logs: at one false alarm in a thousand, two or more have a probability below 1e-3."""
    words: list[Validation] = []
    for seed in range(40):
        log = recorded(folder, f"of{seed}", Worn(seed=200 + seed, noise=0.1), table)
        model = psdmc.calibrate(arm.model, log).model
        words.append(validate(model, recorded(folder, f"new{seed}", Worn(seed=300 + seed, noise=0.1), table)))

    assert sum(found.word != "still valid" for found in words) <= 1
    freedom = sum(found.freedom for found in words)
    assert sum(found.chi2 for found in words) < freedom + 4.0 * np.sqrt(2.0 * freedom)


@pytest.mark.slow
def test_loads_are_within_three_standard_deviations(file: Path, folder: Path, table: Path):
    errors = []
    for seed in range(20):
        log = recorded(folder, f"load{seed}", Worn(seed=400 + seed, load=LOAD, noise=0.1), table)
        found = validate(file, log)
        assert found.load is not None
        errors.append((found.load.mass - LOAD.mass) / found.load.mass_std)
    assert np.abs(errors).max() < 3.5
    assert sum(np.abs(errors) > 3.0) <= 1


@pytest.mark.slow
@pytest.mark.skipif(not UR10_LOG.exists(), reason="the UR10 log is not part of the project")
def test_a_real_arm_s_own_log_is_valid_and_more_viscous_friction_is_found(
    ur10_model: DynamicsModel,  # noqa: F811
    tmp_path: Path,
):
    log = read_log(UR10_LOG / "exciting_trajectory.csv").ordered(ur10_model.joint_names)
    last = log.time[0] + 0.6 * log.duration
    write_log(log.between(log.time[0], last), tmp_path / "first.csv")
    write_log(log.between(last, np.inf), tmp_path / "last.csv")
    model = psdmc.calibrate(ur10_model, tmp_path / "first.csv").model
    whole = psdmc.calibrate(ur10_model, UR10_LOG / "exciting_trajectory.csv").model
    speed = np.gradient(log.position, log.time, axis=0)
    write_log(log, tmp_path / "worn.csv")
    rubbed = changed(tmp_path / "worn.csv", "rubbed", log.effort + speed * np.array([0, 10.0, 0, 0, 0, 0]))

    assert validate(model, tmp_path / "last.csv").word == "still valid"
    found = validate(whole, rubbed)
    assert found.word == "drifted"
    assert found.named[0].name == "viscous of shoulder_lift_joint"
    assert found.named[0].change == pytest.approx(10.0, abs=3.0 * found.named[0].std)
