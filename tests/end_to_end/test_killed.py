"""kill -9 at random moments: never a half file under its final name, and the next run works.

`make test-processes` kills each command 50 times, `make test` two of them once, `make test-slow` the others.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import time
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model, robot_path
from command_line import files_in
from killable import run
from slow_cases import slow_but_for

from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_files import read_columns, write_log
from psdmc.compiler import compile as compile_model
from psdmc.files import whole_file
from psdmc.model.load import load

FEW = {"derive": 1, "emit-c": 1, "build": 1, "calibrate": 2, "excite": 1}
MANY = os.environ.get("PSDMC_KILLS")
KILLS = {name: int(MANY or few) for name, few in FEW.items()}
LATEST = 0.9
"""Of a whole run's time: some are faster than the one that was timed."""
SOONER = 0.8
"""The latest moment comes by this much nearer whenever a run ended before its moment: so all kills are reached,
however uneven the machine is."""
TRACES = (".psdmc-",)
"""How everything begins that psdmc leaves where it is killed."""


@dataclass(frozen=True)
class Command:
    """words in a folder that `prepare` fills; `whole` asserts that the files under final names are."""

    words: list[object]
    prepare: Callable[[Path], None]
    whole: Callable[[Path], None]


def model_into(folder: Path) -> None:
    shutil.copy(model_file(folder.parent), folder / "m.npz")


def model_file(root: Path) -> Path:
    path = root / "two_link.npz"
    if not path.exists():
        bundled_model("two_link").save(path)
    return path


def whole_models(folder: Path) -> None:
    for path in folder.glob("*.npz"):
        load(path)


def other_package(folder: Path) -> None:
    model_into(folder)
    assert (
        run(["emit-c", "m.npz", "-o", "c", "--functions", "gravity,jacobian", "--real", "float32"], folder)
        == 0
    )


def whole_package(folder: Path) -> None:
    """Every file is of the old package or of the new."""
    packages = [expected_packages[key] for key in ("old", "new")]
    for name, content in files_in(folder / "c").items():
        if not Path(name).name.startswith(TRACES):
            assert content in [package.get(name) for package in packages], name


expected_packages: dict[str, dict[str, bytes]] = {}


def built_package(folder: Path) -> None:
    model_into(folder)
    assert run(["emit-c", "m.npz", "-o", "c", "--functions", "gravity"], folder) == 0


def a_log(folder: Path) -> None:
    model_into(folder)
    model = bundled_model("two_link")
    t = np.arange(0.0, 8.0, 0.01)
    w = 2 * np.pi * np.array([[0.25, 0.4], [0.7, 1.1]])
    q = 0.3 * sum(np.sin(np.outer(t, row)) for row in w)
    qd = 0.3 * sum(row * np.cos(np.outer(t, row)) for row in w)
    qdd = 0.3 * sum(-(row**2) * np.sin(np.outer(t, row)) for row in w)
    tau = model.inverse_dynamics(q, qd, qdd) + 0.3 * np.sign(qd) + 0.2 * qd
    tau += np.random.default_rng(0).normal(scale=0.01, size=tau.shape)
    write_log(Log("run", model.joint_names, t, q, qd, tau, "motor_torque"), folder / "log.csv")


def whole_calibration(folder: Path) -> None:
    whole_models(folder)
    for path in folder.glob("*.html"):
        assert path.read_text(encoding="utf-8").rstrip().endswith("</html>")
    for path in folder.glob("*.json"):
        json.loads(path.read_text(encoding="utf-8"))


def whole_campaign(folder: Path) -> None:
    for path in folder.glob("plan/trajectories/[!.]*"):
        columns = read_columns(path)
        assert len({len(column) for column in columns.values()}) == 1
    for path in folder.glob("plan/*.json"):
        json.loads(path.read_text(encoding="utf-8"))
    for path in folder.glob("plan/*.svg"):
        assert path.read_text(encoding="utf-8").rstrip().endswith("</svg>")
    if (folder / "plan/campaign.toml").exists():
        plan = tomllib.loads((folder / "plan/campaign.toml").read_text(encoding="utf-8"))
        assert all((folder / "plan" / run["trajectory"]).exists() for run in plan["run"])


EXCITE = ["excite", "m.npz", "-o", "plan", "--seconds", 1, "--duration", 5, "--acceleration", 10]

COMMANDS = {
    "derive": Command(["derive", robot_path("scara"), "-o", "m.npz"], lambda folder: None, whole_models),
    "emit-c": Command(["emit-c", "m.npz", "-o", "c"], other_package, whole_package),
    "build": Command(["build", "c"], built_package, lambda folder: None),
    "calibrate": Command(
        ["calibrate", "m.npz", "log.csv", "-o", "x.npz", "--report", "x.html", "--no-physical"],
        a_log,
        whole_calibration,
    ),
    "excite": Command(EXCITE, model_into, whole_campaign),
}


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setenv("CFLAGS", "-O0")
    return tmp_path


def prepared(command: Command, root: Path, name: str) -> Path:
    folder = root / name
    folder.mkdir()
    command.prepare(folder)
    return folder


@pytest.mark.parametrize("name", slow_but_for(["derive", "emit-c"], COMMANDS))
def test_a_killed_command_leaves_nothing_half_done(name: str, root: Path):
    command = COMMANDS[name]
    reference = prepared(command, root, "reference")
    expected_packages["old"] = files_in(reference / "c") if (reference / "c").exists() else {}
    if name == "emit-c":
        run(command.words, prepared(command, root, "warm"))  # later runs find in caches what this one makes
    if name == "excite":
        compile_model(bundled_model("two_link"), functions=["regressor"])  # likewise
    start = time.monotonic()
    assert run(command.words, reference) == 0, (root / "reference.said").read_text()
    seconds = time.monotonic() - start
    expected_packages["new"] = files_in(reference / "c") if (reference / "c").exists() else {}

    moments, killed, number, latest = random.Random(name), 0, 0, LATEST * seconds
    while killed < KILLS[name]:
        number += 1
        folder = prepared(command, root, str(number))
        if run(command.words, folder, moments.uniform(0.0, latest)) == -9:
            killed += 1
        else:
            latest *= SOONER
        command.whole(folder)

        status = run(command.words, folder)

        said = (root / f"{number}.said").read_text(encoding="utf-8")
        is_there = name == "excite" and status == 2 and "holds a campaign already: campaign.toml" in said
        assert status == 0 or is_there, said  # killed after its last file: the campaign is whole
        command.whole(folder)
        assert list(files_in(folder)) == list(files_in(reference)) or name == "build" or is_there
        assert not [path for path in folder.rglob("*") if path.name.startswith(TRACES) and not is_there]
        shutil.rmtree(folder)
    print(f"{name}: {killed} of {number} runs were killed within {seconds:.2f} s")


def test_the_check_sees_a_half_file(root: Path):
    """The test of the test: a writer that is killed half way under the final name."""
    folder = prepared(COMMANDS["derive"], root, "half")
    with whole_file(folder / "m.npz") as own:
        own.write_bytes(model_file(root).read_bytes()[:1000])
    with pytest.raises(Exception, match="damaged"):
        COMMANDS["derive"].whole(folder)
