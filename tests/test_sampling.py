"""psdmc sample: states and values against Pinocchio, SciPy and the limits; interruptions, full disks and refusals."""

from __future__ import annotations

import hashlib
import json
import os
import re
import signal
import subprocess
import sys
import time
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from bundled import robot_path
from command_line import typed
from full_disk import files_of_at_most
from random_trees import RandomTree
from robots_at_hand import subject
from scipy.interpolate import BPoly
from scipy.stats import qmc
from unoptimised import without_optimisation

import psdmc
from psdmc import sampling, workers
from psdmc.calibration.logs.log_files import write_columns
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError, ToolchainError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.store import file_bytes
from psdmc.program.signature import QD, Q
from psdmc.robot.load import load_robot
from psdmc.sampling import Motion, Sampled, Sampling, parts
from psdmc.sampling.plan import Plan
from psdmc.sampling.states import WithinLimits

parquet = pytest.importorskip("pyarrow.parquet")

Array = np.ndarray

GIVEN = {"position": 3.0, "speed": 2.0, "acceleration": 5.0, "effort": 10.0}
WHAT = Sampling(500, ("inverse_dynamics", "mass_matrix"), given=GIVEN, rows=200)
"""Two whole parts and a half."""


def sample(model: DynamicsModel, folder: Path, what: Sampling = WHAT) -> Sampled:
    with without_optimisation():
        return sampling.sample(model, folder, what)


def columns(folder: Path) -> dict[str, Array]:
    """All parts, one after the other."""
    tables = [parquet.read_table(path) for path in sorted(folder.glob("part-*.parquet"))]
    rows = {name: [] for name in tables[0].column_names}
    for table in tables:
        for name in table.column_names:
            column = table[name].combine_chunks()
            flat = column.flatten() if hasattr(column, "flatten") else column
            rows[name].append(flat.to_numpy().reshape(table.num_rows, -1))
    return {name: np.concatenate(parts) for name, parts in rows.items()}


def hashes(folder: Path) -> dict[str, str]:
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(folder.iterdir())}


def near(found: Array, expected: Array, limit: float = 1e-12) -> None:
    assert np.abs(found - expected.reshape(found.shape)).max() < limit * np.abs(expected).max()


@pytest.fixture(scope="module")
def arm() -> DynamicsModel:
    return subject("two_link").model


@pytest.fixture(scope="module")
def whole(arm: DynamicsModel, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sample") / "whole"
    found = sample(arm, folder)
    assert (found.states, found.parts, found.before) == (500, 3, 0)
    assert found.columns == {"q": 2, "qd": 2, "qdd": 2, "inverse_dynamics": 2, "mass_matrix": 4}
    return folder


def test_a_range_that_is_given_and_the_limits_hold_together() -> None:
    """A speed below the file's limits narrows the range; positions that no limit allows are refused."""
    robot = load_robot(Path(__file__).parents[1] / "examples/robots/kr6.toml").mechanism
    joints = tuple(
        replace(joint, limits=replace(joint.limits, lower=1.0, upper=2.0, speed=3.0))
        for joint in robot.joints
    )
    robot = replace(robot, joints=joints)
    found = WithinLimits.of(robot, [Q, QD], {"position": 1.5, "speed": 0.5}).ranges
    assert np.array_equal(found["q"], [[1.0] * 6, [1.5] * 6])
    assert np.array_equal(found["qd"], [[-0.5] * 6, [0.5] * 6])
    with pytest.raises(InputError, match=r"no position within its limits is from -0\.9 to 0\.9"):
        WithinLimits.of(robot, [Q], {"position": 0.9})


def test_values_are_pinocchios_at_states_within_the_limits(arm: DynamicsModel, whole: Path) -> None:
    own, pinocchio = columns(whole), subject("two_link").pinocchio
    assert len(own["q"]) == 500
    near(own["inverse_dynamics"], pinocchio.inverse_dynamics(own["q"], own["qd"], own["qdd"]))
    near(own["mass_matrix"], pinocchio.mass_matrix(own["q"]))
    for name, word in (("q", "position"), ("qd", "speed"), ("qdd", "acceleration")):
        limits = [joint.limits for joint in arm.mechanism.joints]
        upper = [{"q": each.upper, "qd": each.speed, "qdd": each.acceleration}[name] for each in limits]
        upper = np.minimum(upper, GIVEN[word])
        assert (own[name] < upper).all()
        assert (own[name].max(axis=0) > 0.95 * upper).all()
        assert (np.abs(own[name].mean(axis=0)) < 0.1 * upper).all() or name == "q"


def test_each_part_says_what_it_is(arm: DynamicsModel, whole: Path) -> None:
    for number, path in enumerate(sorted(whole.glob("part-*.parquet"))):
        said = json.loads(parquet.read_metadata(path).metadata[b"psdmc"])
        assert said["model"] == arm.content_hash
        assert (said["part"], said["first_state"], said["seed"]) == (number, 200 * number, 0)
        assert (said["psdmc"], said["numpy"]) == (psdmc.__version__, np.__version__)


def test_parts_that_are_missing_or_damaged_are_made_again(
    arm: DynamicsModel, whole: Path, tmp_path: Path
) -> None:
    sample(arm, tmp_path / "again")
    before = hashes(tmp_path / "again")
    assert before == hashes(whole)
    (tmp_path / "again" / "part-000000.parquet").unlink()
    (tmp_path / "again" / "part-000002.parquet").write_bytes(b"PAR1 and no more")
    assert sample(arm, tmp_path / "again").before == 1
    assert hashes(tmp_path / "again") == before
    assert sample(arm, tmp_path / "again").before == 3


def test_sobols_points_are_scipys_also_after_an_interruption(arm: DynamicsModel, tmp_path: Path) -> None:
    what = replace(WHAT, draw="sobol", states=512, rows=128, seed=3)
    sample(arm, tmp_path / "one", what)
    before = hashes(tmp_path / "one")
    for number in (1, 3):
        (tmp_path / "one" / f"part-00000{number}.parquet").unlink()
    sample(arm, tmp_path / "one", what)
    assert hashes(tmp_path / "one") == before
    shares = qmc.Sobol(6, bits=32, rng=np.random.default_rng(3)).random(512)
    own, low_high = (
        columns(tmp_path / "one"),
        json.loads((tmp_path / "one" / "sample.json").read_text())["ranges"],
    )
    for k, name in enumerate(("q", "qd", "qdd")):
        low, high = map(np.array, low_high[name])
        np.testing.assert_allclose(own[name], low + (high - low) * shares[:, 2 * k : 2 * k + 2], atol=1e-14)


def circle(rows: int = 400) -> Motion:
    """A motion in closed form whose joints swing, at uneven times from 1 s to 5 s, with rates and accelerations."""
    t = 1.0 + 4.0 * np.linspace(0.0, 1.0, rows) ** 1.2
    q = np.column_stack([np.sin(t), 0.5 * np.cos(2.0 * t)])
    qd = np.column_stack([np.cos(t), -np.sin(2.0 * t)])
    return Motion(
        "circle", ("shoulder", "elbow"), t, q, qd, np.column_stack([-np.sin(t), -2.0 * np.cos(2.0 * t)])
    )


ALONG = Sampling(500, ("inverse_dynamics",), rows=200, along=circle())


@pytest.mark.parametrize(("given", "exact"), [("q qd qdd", 1e-9), ("q qd", 1e-4), ("q", 1e-3)])
def test_states_along_a_motion_are_those_of_its_times(
    arm: DynamicsModel, tmp_path: Path, given: str, exact: float
) -> None:
    """Against the motion in closed form, at uniform times; with fewer columns, splines are less exact."""
    whole = circle()
    motion = replace(whole, qd=whole.qd if "qd" in given else None, qdd=whole.qdd if "qdd" in given else None)
    sample(arm, tmp_path / "along", replace(ALONG, along=motion))
    found = columns(tmp_path / "along")
    (t,) = found["time"].T
    assert list(found) == ["time", "q", "qd", "qdd", "inverse_dynamics"]
    assert 1.0 <= t.min() < 1.1 < 4.9 < t.max() < 5.0
    assert abs(t.mean() - 3.0) < 4.0 * 4.0 / np.sqrt(12.0 * 500)
    near(found["q"], np.column_stack([np.sin(t), 0.5 * np.cos(2.0 * t)]), exact)
    near(found["qd"], np.column_stack([np.cos(t), -np.sin(2.0 * t)]), 10.0 * exact)
    near(found["qdd"], np.column_stack([-np.sin(t), -2.0 * np.cos(2.0 * t)]), 100.0 * exact)
    states = [found[name] for name in ("q", "qd", "qdd")]
    near(found["inverse_dynamics"], subject("two_link").pinocchio.inverse_dynamics(*states))


def test_the_spline_is_scipys(arm: DynamicsModel) -> None:
    """SciPy's polynomial of degree 5 through positions, rates and accelerations of each pair of rows."""
    motion = circle(12)
    given = np.stack([motion.q, motion.qd, motion.qdd], axis=1)
    expected, t = BPoly.from_derivatives(motion.time, given), np.linspace(1.0, 5.0, 99)
    near(motion.spline(t), expected(t))
    near(motion.spline.derivative(2)(t), expected.derivative(2)(t), 1e-11)


def test_noise_along_a_motion(arm: DynamicsModel, tmp_path: Path) -> None:
    """Normal, independent of each other, and of a tenth of each value's deviation."""
    many = replace(ALONG, states=4000, rows=4096, draw="sobol")
    sample(arm, tmp_path / "plain", many)
    sample(arm, tmp_path / "noisy", replace(many, noise=0.1))
    plain, noisy, motion = columns(tmp_path / "plain"), columns(tmp_path / "noisy"), circle()
    errors = []
    for name in ("q", "qd", "qdd"):
        t = noisy["time"][:, 0]
        exact = {"q": motion.spline, "qd": motion.spline.derivative(), "qdd": motion.spline.derivative(2)}[
            name
        ](t)
        deviation = getattr(motion, name).std(axis=0)
        errors.append((noisy[name] - exact) / (0.1 * deviation))
        assert not np.array_equal(plain[name], noisy[name])
    together = np.hstack(errors)
    assert np.abs(together.mean(axis=0)).max() < 0.05
    assert np.abs(np.cov(together.T) - np.eye(6)).max() < 0.06


def test_parts_along_a_motion_are_made_again_alike(arm: DynamicsModel, tmp_path: Path) -> None:
    noisy = replace(ALONG, noise=0.1, real="float32")
    sample(arm, tmp_path / "c", noisy)
    before = hashes(tmp_path / "c")
    (tmp_path / "c" / "part-000001.parquet").unlink()
    assert sample(arm, tmp_path / "c", noisy).before == 2
    assert hashes(tmp_path / "c") == before
    other = circle()
    other.q[7, 1] += 1e-9
    with pytest.raises(InputError, match="holds another sampling, whose along: numbers is"):
        sample(arm, tmp_path / "c", replace(noisy, along=other))
    with pytest.raises(InputError, match=r"holds another sampling, whose along: noise is 0\.1, not 0\.2"):
        sample(arm, tmp_path / "c", replace(noisy, noise=0.2))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"functions": ("forward_dynamics",)}, "a motion does not give tau"),
        ({"given": {"speed": 1.0}}, "--speed with --along"),
        ({"along": None, "noise": 0.1}, "--noise without --along"),
        ({"noise": -0.1}, "--noise is -0.1"),
    ],
)
def test_what_a_motion_does_not_give_is_refused(
    arm: DynamicsModel, tmp_path: Path, change: dict[str, object], said: str
) -> None:
    with pytest.raises(InputError, match=said):
        sample(arm, tmp_path / "c", replace(ALONG, **change))  # type: ignore[arg-type]
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("time_s,position_rad.shoulder\n0,0\n1,1\n2,1\n3,1\n", r"no positions of joint\(s\) elbow"),
        (
            "time_s,position_rad.shoulder,position_m.elbow\n0,0,0\n",
            r"position of joint\(s\) elbow in another unit",
        ),
        ("position_rad.shoulder,position_rad.elbow\n0,0\n", r"no column\(s\) time_s"),
        ("time_s,tau\n0,0\n", r"no column\(s\) position_rad.<joint>"),
        ("{head},velocity_rad_s.elbow\n0,0,0,0\n", r"no column\(s\) velocity_rad_s.shoulder"),
        ("{head}\n0,0,0\n1,1,1\n1,1,1\n2,0,0\n", "row 3: the time does not grow"),
        ("{head}\n0,0,0\n1,1,1\n2,nan,1\n3,0,0\n", "q, row 3: no finite number"),
        ("{head}\n0,0,0\n1,1,1\n", "2 rows, expected 4 or more"),
    ],
)
def test_files_that_are_no_motion_are_refused(
    arm: DynamicsModel, tmp_path: Path, rows: str, said: str
) -> None:
    (tmp_path / "model.npz").write_bytes(file_bytes(arm))
    head = "time_s,position_rad.shoulder,position_rad.elbow"
    (tmp_path / "motion.csv").write_text(rows.replace("{head}", head))
    words = ["-o", tmp_path / "c", "--states", "9", "--along", tmp_path / "motion.csv"]
    done = typed("sample", tmp_path / "model.npz", *words)
    assert done.returncode == 2, done.stderr
    assert re.search(said, done.stderr), done.stderr
    assert not (tmp_path / "c").exists()


def test_the_command_draws_along_a_file_of_excite(arm: DynamicsModel, tmp_path: Path) -> None:
    """The joints may stand in another order than the robot's, and more joints may be there."""
    (tmp_path / "model.npz").write_bytes(file_bytes(arm))
    whole = circle()
    table = {"time_s": whole.time, "position_rad.gripper": whole.time}
    for k, name in ((1, "elbow"), (0, "shoulder")):
        table[f"position_rad.{name}"] = whole.q[:, k]
        table[f"velocity_rad_s.{name}"] = whole.qd[:, k]
        table[f"acceleration_rad_s2.{name}"] = whole.qdd[:, k]
    table |= {f"{column}.gripper": whole.time for column in ("velocity_rad_s", "acceleration_rad_s2")}
    write_columns(table, tmp_path / "motion.npz")
    words = [
        "-o",
        tmp_path / "c",
        "--states",
        "500",
        "--part-states",
        "200",
        "--along",
        tmp_path / "motion.npz",
    ]
    with without_optimisation():
        done = typed("sample", tmp_path / "model.npz", *words)
    assert done.returncode == 0, done.stderr
    assert "columns: time (1), q (2), qd (2), qdd (2), inverse_dynamics (2)" in done.stdout
    sample(arm, tmp_path / "python", ALONG)
    assert hashes(tmp_path / "c") == hashes(tmp_path / "python")


def test_single_precision_gives_the_values_of_the_states_that_it_writes(
    arm: DynamicsModel, tmp_path: Path
) -> None:
    sample(arm, tmp_path / "single", replace(WHAT, real="float32"))
    own = columns(tmp_path / "single")
    assert own["q"].dtype == own["inverse_dynamics"].dtype == np.float32
    q, qd, qdd = (own[name].astype(float) for name in ("q", "qd", "qdd"))
    near(own["inverse_dynamics"], subject("two_link").pinocchio.inverse_dynamics(q, qd, qdd), 2e-5)


def test_other_seeds_give_other_states(arm: DynamicsModel, whole: Path, tmp_path: Path) -> None:
    sample(arm, tmp_path / "other", replace(WHAT, seed=1))
    assert not np.isin(columns(tmp_path / "other")["q"], columns(whole)["q"]).any()
    part = columns(whole)["q"]
    assert len(np.unique(part, axis=0)) == len(part)


def test_quaternions_have_length_one_and_turn_to_every_side(tmp_path: Path) -> None:
    model = derive_model(RandomTree(4, (-1, 0), "FR").mechanism(), expand=False)
    sample(model, tmp_path / "free", replace(WHAT, states=4000, rows=4000, functions=("kinetic_energy",)))
    own = columns(tmp_path / "free")
    assert own["kinetic_energy"].shape == (4000, 1)
    quaternions = own["q"][:, 3:7]
    np.testing.assert_allclose(np.linalg.norm(quaternions, axis=1), 1.0, atol=1e-15)
    assert np.abs(quaternions.T @ quaternions / 4000 - np.eye(4) / 4).max() < 0.02
    assert np.abs(own["q"][:, :3]).max(axis=0) == pytest.approx(3.0, rel=0.01)


def test_bodies_that_vary_are_pinocchios_with_scaled_inertias(tmp_path: Path) -> None:
    tree = RandomTree(4, (-1, 0, 1), "RPR")
    model = derive_model(tree.mechanism(), expand=False)
    what = replace(WHAT, states=20, functions=("inverse_dynamics", "forward_kinematics"), spread=0.3)
    sample(model, tmp_path / "varied", what)
    own, robot = columns(tmp_path / "varied"), model.mechanism
    effects = np.stack([model.B[:, 11 * i : 11 * i + 11] @ robot.parameters[i] for i in range(3)], axis=1)
    factors = np.linalg.lstsq(effects, own["theta_b"].T, rcond=None)[0].T
    near(factors @ effects.T, own["theta_b"])
    assert (np.abs(factors - 1.0) < 0.3).all()
    assert (np.ptp(factors, axis=0) > 0.3).all()
    bodies, drives = tree.parameters, np.array(tree.drives)
    for row, scale in enumerate(factors):
        tree.parameters, tree.drives = bodies * scale[:, None], (drives * scale).tolist()
        other, _ = tree._pinocchio()
        near(
            own["inverse_dynamics"][row],
            pin.rnea(other, other.createData(), *(own[k][row] for k in ("q", "qd", "qdd"))),
        )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": 1}, "holds another sampling, whose seed is 0, not 1"),
        ({"states": 501}, "holds another sampling, whose states is 500, not 501"),
        ({"real": "float32"}, "holds another sampling, whose real is 'float64', not 'float32'"),
    ],
)
def test_the_folder_of_another_sampling_is_refused(
    arm: DynamicsModel, whole: Path, change: dict[str, object], message: str
) -> None:
    before = hashes(whole)
    with pytest.raises(InputError, match=message):
        sample(arm, whole, replace(WHAT, **change))
    assert hashes(whole) == before


@pytest.mark.parametrize(
    ("change", "message", "hint"),
    [
        (
            {"functions": ("integrate",)},
            "integrate reads v, which has no limits",
            "sample functions of q, qd, qdd, tau",
        ),
        ({"functions": ("inverse",)}, "function 'inverse' is not known", ""),
    ],
)
def test_what_cannot_be_drawn_is_refused(
    arm: DynamicsModel, tmp_path: Path, change: dict[str, object], message: str, hint: str
) -> None:
    with pytest.raises(InputError, match=message) as caught:
        sample(arm, tmp_path / "new", replace(WHAT, **change))
    assert hint in str(caught.value.hint)
    assert not (tmp_path / "new").exists()


def test_joints_without_limits_are_named_with_the_options_that_give_them(tmp_path: Path) -> None:
    model = derive_model(RandomTree(4, (-1, 0), "FR").mechanism(), expand=False)
    with pytest.raises(InputError) as caught:
        sample(model, tmp_path / "new", replace(WHAT, given={"speed": 1.0}))
    assert caught.value.message == (
        "tree: joints without limits of position: 'joint0', 'joint1'; acceleration: 'joint0', 'joint1'"
    )
    assert (
        caught.value.hint == "add --position NUMBER (rad or m) and --acceleration NUMBER (rad/s^2 or m/s^2)"
    )
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    "change",
    [
        {"states": 0},
        {"seed": -1},
        {"spread": 1.5},
        {"rows": 0},
        {"draw": "grid"},
        {"draw": "sobol", "states": 2**32},
        {"real": "half"},
    ]
    + [{"given": {"speed": value}} for value in (-1.0, 0.0, float("nan"), float("inf"))],
    ids=str,
)
def test_options_without_a_meaning_are_refused(change: dict[str, object]) -> None:
    with pytest.raises(InputError, match=r"^--"):
        replace(WHAT, **change)


def test_a_sampling_that_wrote_no_part_gives_way_to_another(arm: DynamicsModel, tmp_path: Path) -> None:
    with pytest.raises(ToolchainError), files_of_at_most(10_000):
        sample(arm, tmp_path / "new")
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["sample.json"]
    assert sample(arm, tmp_path / "new", replace(WHAT, seed=1, states=10)).states == 10
    assert json.loads((tmp_path / "new" / "sample.json").read_text())["seed"] == 1


def test_a_folder_with_other_files_is_refused(arm: DynamicsModel, tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("")
    with pytest.raises(InputError, match=r"psdmc did not write the files in this folder: thesis\.tex"):
        sample(arm, tmp_path)
    (tmp_path / "sample.json").write_text('{"results": 1}')
    with pytest.raises(
        InputError, match="holds another sampling, whose generator is None, not 'psdmc sample'"
    ):
        sample(arm, tmp_path)
    (tmp_path / "sample.json").write_text("{")
    with pytest.raises(InputError, match=r"sample\.json: no manifest of psdmc sample"):
        sample(arm, tmp_path)


def test_a_full_disk_leaves_whole_parts_alone(arm: DynamicsModel, whole: Path, tmp_path: Path) -> None:
    sample(arm, tmp_path / "disk", replace(WHAT, states=200))
    manifest = json.loads((whole / "sample.json").read_text())
    (tmp_path / "disk" / "sample.json").write_text(json.dumps(manifest))
    (tmp_path / "disk" / "part-000000.parquet").write_bytes((whole / "part-000000.parquet").read_bytes())
    with (
        pytest.raises(ToolchainError, match=r"part-000001\.parquet: cannot be written"),
        files_of_at_most(10_000),
    ):
        sample(arm, tmp_path / "disk")
    assert sorted(path.name for path in (tmp_path / "disk").iterdir()) == [
        "part-000000.parquet",
        "sample.json",
    ]
    assert sample(arm, tmp_path / "disk").before == 1
    assert (
        hashes(tmp_path / "disk").items()
        >= {k: v for k, v in hashes(whole).items() if k != "sample.json"}.items()
    )


def test_a_disk_that_is_too_small_is_refused_before_the_work(arm: DynamicsModel, tmp_path: Path) -> None:
    with pytest.raises(ToolchainError, match=r"the missing parts take 96000\.0 GB, and the disk has"):
        sample(arm, tmp_path / "large", replace(WHAT, states=10**12, rows=10**9))


def test_without_pyarrow_it_says_what_to_install(
    arm: DynamicsModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(parts, "find_spec", lambda name: None)
    with pytest.raises(InputError, match="psdmc sample needs pyarrow") as caught:
        sample(arm, tmp_path / "new")
    assert caught.value.hint == "pip install 'psdmc[sample]'"


def test_the_command_says_what_it_wrote(arm: DynamicsModel, tmp_path: Path) -> None:
    psdmc.save(arm, tmp_path / "arm.npz")
    words = [
        "sample",
        "arm.npz",
        "-o",
        "states",
        "--states",
        "1e3",
        "--position",
        3,
        "--speed",
        2,
        "--acceleration",
        5,
    ]
    done = typed(*words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "states: 1000 states in 1 part, 0.1 MB",
        "columns: q (2), qd (2), qdd (2), inverse_dynamics (2)",
    ]
    assert "; 1 of them were there" in typed(*words, cwd=tmp_path).stdout
    for option, given, message in (
        ("--functions", "", "no function is named"),
        ("--part-states", "half", "--part-states is 'half'"),
    ):
        refused = typed(*words[:4], "--states", "1e3", option, given, cwd=tmp_path)
        assert refused.returncode == 2
        assert message in refused.stderr
    refused = typed(*words[:4], "--states", "1e3.5", cwd=tmp_path)
    assert (refused.returncode, refused.stderr.splitlines()[0]) == (2, "error: --states is '1e3.5'")


def test_columns_of_a_surface_contact_have_six_rows(tmp_path: Path) -> None:
    loaded = load_robot(robot_path("rounded_arm"), contacts=["tool:6"])
    what = Sampling(10, ("contact_jacobian",), given=GIVEN, rows=10)
    sample(derive_model(loaded.mechanism, expand=False), tmp_path / "states", what)

    manifest = json.loads((tmp_path / "states" / "sample.json").read_text(encoding="utf-8"))
    assert manifest["columns"]["contact_jacobian"] == [6, 6]
    assert columns(tmp_path / "states")["contact_jacobian"].shape == (10, 36)


def test_the_command_refuses_a_speed_of_zero(arm: DynamicsModel, tmp_path: Path) -> None:
    psdmc.save(arm, tmp_path / "arm.npz")
    ranges = ["--position", 3, "--speed", 0, "--acceleration", 5]
    done = typed("sample", "arm.npz", "-o", "states", "--states", 10, *ranges, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        "error: --speed is 0, so the robot would move in no state",
        "hint: give a number above 0; for a robot at rest, sample functions of q alone, such as gravity",
    ]
    assert not (tmp_path / "states").exists()


@pytest.mark.slow
def test_a_process_that_is_killed_leaves_the_parts_of_one_that_is_not(
    arm: DynamicsModel, tmp_path: Path
) -> None:
    """A million states in 32 parts, killed some ten times."""
    psdmc.save(arm, tmp_path / "arm.npz")
    words = [sys.executable, "-m", "psdmc", "sample", "arm.npz", "--states", "1e6", "--part-states", "32768"]
    words += ["--position", "3", "--speed", "2", "--acceleration", "5", "--draw", "sobol", "-o"]
    subprocess.run([*words, "whole"], cwd=tmp_path, check=True, capture_output=True)
    killed = 0
    for attempt in range(100):
        process = subprocess.Popen(
            [*words, "killed"], cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        parts = len(list((tmp_path / "killed").glob("part-*")))
        while process.poll() is None and len(list((tmp_path / "killed").glob("part-*"))) < parts + 3:
            time.sleep(0.001)
        if process.poll() is not None:
            assert process.returncode == 0
            break
        time.sleep(0.002 * (attempt % 7))
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        killed += 1
    assert killed > 3
    assert hashes(tmp_path / "killed") == hashes(tmp_path / "whole")


@pytest.mark.slow
@pytest.mark.parametrize(
    "drawn", [{"draw": "sobol"}, {"along": circle(), "noise": 0.1}], ids=["sobol", "along"]
)
def test_a_worker_that_dies_is_replaced_and_the_parts_are_the_same(
    arm: DynamicsModel, tmp_path: Path, drawn: dict[str, Any]
) -> None:
    distributed = pytest.importorskip("distributed")
    what = Sampling(40_000, rows=1000, **drawn)
    sampling.sample(arm, tmp_path / "whole", what)
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "dashboard_address": None}
    told: list[str] = []
    with distributed.LocalCluster(**options, local_directory=tmp_path / "dask") as cluster:
        with distributed.Client(cluster.scheduler_address) as client:
            process = next(iter(client.run(os.getpid).values()))

        def kill(step: str) -> None:
            told.append(step)
            if len(told) == 5:
                os.kill(process, signal.SIGKILL)

        found = sampling.sample(arm, tmp_path / "cluster", what, kill, cluster.scheduler_address)
    assert (found.parts, found.before) == (40, 0)
    assert sorted(told) == sorted(f"{k} of 40 parts" for k in range(1, 41))
    assert hashes(tmp_path / "cluster") == hashes(tmp_path / "whole")


def test_workers_with_other_versions_are_refused(arm: DynamicsModel) -> None:
    plan = Plan(arm, WHAT)
    other = json.dumps({**plan.manifest, "numpy": "1.0"})
    with pytest.raises(InputError, match=r"a worker's numpy is '.*', not '1\.0'"):
        parts._of_worker(zlib.compress(file_bytes(arm)), WHAT, other, 0)


def test_a_scheduler_that_does_not_answer_is_named(
    arm: DynamicsModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr(workers, "CONNECT", "0.1s")
    with pytest.raises(ToolchainError, match=r"--scheduler tcp://127\.0\.0\.1:9: does not answer: "):
        sampling.sample(arm, tmp_path / "new", WHAT, scheduler="tcp://127.0.0.1:9")
