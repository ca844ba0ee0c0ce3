"""Motors that drive two joints although log.toml does not say so: Pinocchio's torques, mixed by the test itself. psdmc's
lines are typed into log.toml as they stand, and the torque of both joints is then predicted."""

from __future__ import annotations

import html
import json
import tomllib
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from bundled import robot_path
from command_line import status
from scipy import signal
from shared_data import UR10_LOG
from slow_cases import slow_but_for

from psdmc.calibration.calibrate import CalibrateOptions, calibrate_logs
from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_files import read_log, write_columns
from psdmc.calibration.logs.low_pass import FilterOptions
from psdmc.calibration.plant.spoiled import geared
from psdmc.calibration.verdict import judge
from psdmc.calibration.verdict.couplings import ProposedCoupling, proposed_coupling
from psdmc.calibration.verdict.evidence import Motion, evidence_of
from psdmc.compiler import derive
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.load import load_robot
from psdmc.robot.reference import reference

N = 6
COULOMB = np.array([6.0, 8.0, 5.0, 1.5, 0.4, 0.3])
VISCOUS = np.array([8.0, 10.0, 6.0, 1.8, 0.4, 0.3])
OFFSET = np.array([0.5, -0.8, 0.3, 0.1, -0.1, 0.05])
NOISE = np.array([0.4, 0.4, 0.3, 0.05, 0.03, 0.03])
"""N m, of the motors after their gears."""
HARMONICS = 6
TOOL = """mass = 2.0
com = [0.12, 0.02, 0.05]
inertia_com = { xx = 0.003, yy = 0.006, zz = 0.005, xy = 0.0, xz = 0.0, yz = 0.0 }
"""


def mixed(**entries: float) -> np.ndarray:
    """C of q_joint = C q_motor: c54 = 0.9 says that the motor of J5 also moves J6."""
    matrix = np.eye(N)
    for name, value in entries.items():
        matrix[int(name[1]), int(name[2])] = value
    return matrix


def with_tool() -> str:
    """The bundled arm, carrying a tool beside the axis of its last joint."""
    first, last = robot_path("denso_wall").read_text(encoding="utf-8").rsplit("[joint.link]\n", 1)
    assert "mass = 0.0" in last
    return f"{first}[joint.link]\n{TOOL}"


@cache
def moved(robot: Path, seed: int, seconds: float) -> tuple[tuple[str, ...], list[np.ndarray]]:
    """Names of the joints; times, positions, speeds and Pinocchio's torques of a motion."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 0.01)
    rates, starts = rng.uniform(0.5, 5.0, (HARMONICS, N)), rng.uniform(0.0, 6.0, (HARMONICS, N))
    size = np.array([0.14, 0.1, 0.12, 0.25, 0.3, 0.4])
    turning = np.einsum("t,kj->tkj", time, rates) + starts
    q, qd = size * np.sin(turning).sum(axis=1), size * (rates * np.cos(turning)).sum(axis=1)
    qdd = -size * (rates**2 * np.sin(turning)).sum(axis=1)
    chosen = load_robot(robot)
    model = reference(chosen).model
    data = model.createData()
    rigid = np.array([pin.rnea(model, data, *state) for state in zip(q, qd, qdd, strict=True)])
    return tuple(joint.name for joint in chosen.chain.joints), [time, q, qd, rigid]


def recorded(
    folder: Path, C: np.ndarray, of_motors: bool, seed: int = 1, seconds: float = 60.0, friction: float = 1.0
) -> Path:
    """The log of a robot: torques of motors, and positions of motors or of joints; and its log.toml."""
    names, (time, q, qd, rigid) = moved(folder / "arm.toml", seed, seconds)
    rng = np.random.default_rng(seed)
    onto_motors = np.linalg.inv(C).T
    speed = qd @ onto_motors
    torque = rigid @ C + friction * (np.tanh(speed / 0.03) * COULOMB + VISCOUS * speed) + OFFSET
    torque += NOISE * rng.standard_normal(torque.shape)
    logged = q @ onto_motors if of_motors else q
    logged = logged + 2e-6 * rng.standard_normal(q.shape)
    columns = {"time_s": time}
    for k, name in enumerate(names):
        columns |= {f"position_rad.{name}": logged[:, k], f"motor_torque_nm.{name}": torque[:, k]}
    write_columns(columns, folder / "run.csv")
    (folder / "log.toml").write_text('[[log]]\nfile = "run.csv"\n', encoding="utf-8")
    return folder / "log.toml"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """With the model of the arm."""
    (tmp_path / "arm.toml").write_text(with_tool(), encoding="utf-8")
    status("derive", tmp_path / "arm.toml", "-o", tmp_path / "arm.npz")
    return tmp_path


def calibrated(folder: Path, capsys: pytest.CaptureFixture[str]) -> tuple[object, list[str], dict]:
    """Exit status, console lines and JSON of a calibration."""
    capsys.readouterr()
    words = ("calibrate", folder / "arm.npz", folder / "log.toml", "-o", folder / "out.npz", "--keep")
    code = status(*words, "--report", folder / "out.html")
    lines = capsys.readouterr().out.splitlines()
    return code, lines, json.loads((folder / "out.json").read_text(encoding="utf-8"))


def r2(numbers: dict, joint: str) -> float:
    return numbers["quality"]["All"][joint]["held_out"]["r2"]


@pytest.mark.parametrize(
    ("ratio", "of_motors"), slow_but_for([(-1.0, True)], [(-1.0, True), (0.8, False)], spread=True)
)
def test_the_proposed_lines_describe_the_wrist(
    folder: Path, capsys: pytest.CaptureFixture[str], ratio: float, of_motors: bool
):
    table = recorded(folder, mixed(c54=ratio), of_motors)

    _, lines, before = calibrated(folder, capsys)

    assert sum("motors seem to drive several joints together" in line for line in lines) == 1
    start = lines.index("# proposed for log.toml, not applied:")
    proposed = "\n".join(lines[start : start + (4 if of_motors else 5)]) + "\n"
    assert tomllib.loads(proposed)["coupling"][0].get("quantities") == (None if of_motors else ["effort"])
    found = before["facts"]["proposed_coupling"]
    assert found["toml"] in proposed
    page = html.unescape((folder / "out.html").read_text(encoding="utf-8"))
    assert f"<pre>{found['toml']}</pre>" in page
    (item,) = found["items"]
    assert (item["motor"], item["joint"]) == ("J5", "J6")
    assert abs(item["ratio"] - ratio) < 3.0 * item["std"]
    assert item["std"] < 0.01
    table.write_text(table.read_text(encoding="utf-8") + proposed, encoding="utf-8")
    status, lines, after = calibrated(folder, capsys)
    for joint in ("J5", "J6"):
        assert r2(before, joint) < 0.9
        assert r2(after, joint) > 0.96
    assert (status, lines[0]) == (0, "verdict: usable")
    assert "proposed_coupling" not in after["facts"]


def test_a_good_log_gets_no_proposal(folder: Path, capsys: pytest.CaptureFixture[str]):
    recorded(folder, np.eye(N), of_motors=True)

    status, lines, numbers = calibrated(folder, capsys)

    assert (status, lines[0]) == (0, "verdict: usable")
    assert "proposed_coupling" not in numbers["facts"]
    assert not any("coupling" in line for line in lines)
    assert "Proposed for" not in (folder / "out.html").read_text(encoding="utf-8")


def seen(log: Log, model: DynamicsModel) -> ProposedCoupling | None:
    """The proposal from a log."""
    motions, filtered = [Motion(log)], FilterOptions(cutoff=8.0)
    evidence = evidence_of(model, ChainRegressor(model), motions, Motors.torques(model.nv), filtered)
    return proposed_coupling(evidence)


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, DynamicsModel]:
    path = tmp_path_factory.mktemp("arm")
    (path / "arm.toml").write_text(with_tool(), encoding="utf-8")
    return path, derive(path / "arm.toml", expand=False)


def mixture(
    arm: tuple[Path, DynamicsModel], C: np.ndarray, of_motors: bool, seed: int, friction: float = 1.0
) -> Log:
    recorded(arm[0], C, of_motors, seed, 30.0, friction)
    return read_log(arm[0] / "run.csv")


@pytest.mark.slow
def test_the_standard_deviation_is_honest(arm: tuple[Path, DynamicsModel]):
    """Also with much friction, and with noise that lasts; and no log of motors that drive one joint each gets a proposal."""
    off = []
    for seed in range(4):
        for of_motors in (False, True):
            log = mixture(arm, mixed(c54=0.8), of_motors, seed, friction=3.0)
            white = np.random.default_rng(seed).standard_normal(log.effort.shape)
            if seed % 2:
                lasting = 0.3 * NOISE * signal.lfilter([1.0], [1.0, -0.97], white, axis=0)
                log = replace(log, effort=log.effort + lasting)
            found = seen(log, arm[1])
            assert found is not None
            assert (found.joints, found.of_motors) == (("J5", "J6"), of_motors)
            assert min(found.after) > 0.9995  # 0.998 if the friction of coupled motors is not filtered
            off.append((found.matrix[1, 0] - 0.8) / found.std[1, 0])
        log = mixture(arm, np.eye(N), of_motors=True, seed=seed)
        assert seen(log, arm[1]) is None
    assert np.abs(off).max() < 3.0
    assert 0.4 < np.sqrt(np.mean(np.square(off))) < 1.5


@pytest.mark.parametrize("of_motors", [False, True])
def test_a_motor_that_moves_all_later_joints(arm: tuple[Path, DynamicsModel], of_motors: bool):
    true = mixed(c43=0.3, c53=-0.4, c54=0.9)

    found = seen(mixture(arm, true, of_motors, 3), arm[1])

    assert found is not None
    assert found.joints == ("J4", "J5", "J6")
    entries = found.std > 0.0
    assert np.array_equal(entries, np.tril(np.ones((3, 3)), -1) > 0.0)
    assert np.all(np.abs(found.matrix - true[3:, 3:])[entries] < 3.0 * found.std[entries])
    (table,) = tomllib.loads(found.toml)["coupling"]
    assert np.allclose(table["matrix"], found.matrix, atol=0.1 * found.std.max())


@pytest.mark.parametrize("share", slow_but_for([None], [None, 0.999]))
def test_an_error_of_one_joint_that_explains_more_is_named_instead(
    arm: tuple[Path, DynamicsModel], monkeypatch: pytest.MonkeyPatch, share: float | None
):
    """A wrong reduction ratio, which a coupling explains less well; unless the test says that it explains all."""
    log = geared(mixture(arm, np.eye(N), of_motors=True, seed=1), 2, 1.1)
    found = seen(log, arm[1])
    assert found is not None
    if share is not None:
        monkeypatch.setattr(judge, "proposed_coupling", lambda evidence: replace(found, explains=share))
    bare = CalibrateOptions(physical=False)

    record = calibrate_logs(arm[1], [log], bare, ChainRegressor(arm[1]), None, lambda _: None)

    assert record.verdict is not None
    verdict = record.verdict
    codes = {ground.code for ground in (*verdict.against, *verdict.suspected, *verdict.doubted)}
    named = codes & {"log_error", "undescribed_coupling"}
    assert named == ({"log_error"} if share is None else {"undescribed_coupling"})
    assert ("proposed_coupling" in record.facts) == (share is not None)


@pytest.mark.skipif(not UR10_LOG.exists(), reason="the UR10 log is not part of the project")
def test_a_real_robot_gets_a_proposal_only_if_its_log_is_mixed():
    """Friction is moved from the joints to the motors, where psdmc takes it to be."""
    folder = pytest.importorskip("cmeel").__path__[0]
    urdf = sorted((Path(folder).parent / "cmeel.prefix").rglob("ur10_robot.urdf"))
    if not urdf:
        pytest.skip("example-robot-data is not installed")
    model = derive(urdf[0], drive_inertia=True, expand=False)
    log = read_log(UR10_LOG / "exciting_trajectory.csv").ordered(model.joint_names)

    assert seen(log, model) is None

    plain = calibrate_logs(
        model, [log], CalibrateOptions(physical=False), ChainRegressor(model), None, lambda _: None
    )
    values = {(row.joint, row.name): row.value for row in plain.friction}
    coulomb, viscous = (
        np.array([values[joint, name] for joint in model.joint_names]) for name in ("coulomb", "viscous")
    )
    C = mixed(c21=-0.5)
    onto_motors = np.linalg.inv(C).T
    speeds = (log.velocity, log.velocity @ onto_motors)
    of_joints, of_motors = (coulomb * np.tanh(speed / 0.03) + viscous * speed for speed in speeds)
    torque = (log.effort - of_joints) @ C + of_motors
    found = seen(replace(log, effort=torque, position=log.position @ onto_motors, velocity=None), model)

    assert found is not None
    assert found.joints == ("shoulder_lift_joint", "elbow_joint")
    assert found.of_motors
    assert abs(found.matrix[1, 0] + 0.5) < 3.0 * found.std[1, 0]
