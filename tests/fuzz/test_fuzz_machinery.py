"""The fuzzer itself: its seeds are good, its mutations repeatable, and it sees what it is there to see."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
import warnings
from dataclasses import replace
from pathlib import Path
from random import Random

import fixtures
import numpy as np
import pytest
from formats import FORMATS, Format, chosen
from isolated import outcome_in_child
from limits import TooSlow, limited_time
from minimise import minimised, smaller_lines, smaller_runs, smaller_xml
from mutate_npz import manifest_of, packed, set_hash, unpacked
from oracle import torque_error
from outcome import BrokenRule, Outcome, outcome_of, warnings_are_errors
from recorder import Recorder
from seeds import read_seeds, write_seeds
from worker import gist_of, scratch

from psdmc.derivation.derive import derive_model
from psdmc.errors import DerivationError, InputError, InternalError
from psdmc.model.load import load
from psdmc.robot.load import load_robot_text

QUICK = 50_000
"""bytes of the largest seed that is run here"""


@pytest.fixture(scope="module")
def around(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_seeds(tmp_path_factory.mktemp("fuzz"))


@pytest.mark.parametrize("name", [name for name in FORMATS if name not in ("urdf", "argv")])
def test_what_is_mutated_is_good_before(name: str, around: Path):
    """A seed that is refused would leave the code behind the refusal unseen."""
    format = FORMATS[name]
    with scratch(around) as folder, warnings_are_errors():
        format.set_up(folder)
        seeds = [data for data in read_seeds(around, name) if len(data) < QUICK]
        found = [outcome_of(lambda data=data: format.run(data, folder, False)) for data in seeds]

    assert "success" in {outcome.kind for outcome in found}, found


@pytest.mark.parametrize("name", FORMATS)
def test_mutations_are_many_and_repeatable(name: str, around: Path):
    format, seed = FORMATS[name], read_seeds(around, name)[0]

    once = [format.mutate(seed, Random(number)) for number in range(40)]
    again = [format.mutate(seed, Random(number)) for number in range(40)]

    assert once == again
    assert len(set(once)) > 20


def test_mutations_of_anything_stay_mutations():
    """Coverage guidance hands them inputs of any kind."""
    for format in FORMATS.values():
        for data in (b"", b"\xff\x00", b"[]", b"{}", b"PK\x03\x04", b"<a/>", b"\n" * 50):
            for seed in range(20):
                assert isinstance(format.mutate(data, Random(seed)), bytes)


def raising(error: BaseException):
    def run() -> None:
        raise error

    return run


@pytest.mark.parametrize(
    ("error", "kind"),
    [
        (InputError("arm: no joint", "give one"), "InputError"),
        (DerivationError("arm: too long", "--no-expand"), "DerivationError"),
        (InputError("arm: no joint"), "NoHint"),
        (InputError("arm:\nno joint", "give one"), "SeveralLines"),
        (InputError("a" * 100_000, "give one"), "EndlessLine"),
        (InternalError("a bug"), "InternalError"),
        (ZeroDivisionError("division"), "ZeroDivisionError"),
        (RecursionError("deep"), "RecursionError"),
        (BrokenRule("WrongTorque", "psdmc/derivation", "off"), "WrongTorque"),
    ],
)
def test_how_an_input_ended(error: BaseException, kind: str):
    found = outcome_of(raising(error))

    assert found.kind == kind
    assert found.is_find == (kind not in ("InputError", "DerivationError"))


def test_a_warning_is_a_find():
    with warnings_are_errors():
        assert outcome_of(lambda: np.float64(1e300) * np.float64(1e300)).kind == "RuntimeWarning"
        assert outcome_of(lambda: warnings.warn("old", DeprecationWarning, stacklevel=1)).kind == "success"


def test_a_refusal_for_want_of_memory_is_a_find():
    def run() -> None:
        try:
            raise MemoryError
        except MemoryError as error:
            raise InputError("arm: damaged", "derive it again") from error

    assert outcome_of(run).kind == "MemoryError"


def test_a_find_names_the_innermost_frame_of_psdmc():
    found = outcome_of(lambda: load_robot_text(3, "urdf"))  # type: ignore[arg-type]

    assert found.where == "psdmc/robot/load.py:load_robot_text"


def spin() -> None:
    while True:
        pass


def test_time_is_up():
    with pytest.raises(TooSlow), limited_time(0.05):
        spin()


def of_target(run) -> Format:
    return replace(FORMATS["urdf"], run=run)


def test_a_crash_and_a_flood_of_memory_are_outcomes(tmp_path: Path):
    crash = of_target(lambda data, folder, deep: os.abort())
    flood = of_target(lambda data, folder, deep: np.zeros(3 << 30, np.uint8).any())
    fine = of_target(lambda data, folder, deep: None)

    assert outcome_in_child(crash, b"", tmp_path).kind == "SIGABRT"
    assert "MemoryError" in outcome_in_child(flood, b"", tmp_path).kind
    assert outcome_in_child(fine, b"", tmp_path) == Outcome("success")


def test_minimising_leaves_what_matters():
    text = b"".join(b"line %d\n" % k for k in range(60))
    assert minimised(text, lambda data: b"line 37" in data, (smaller_lines, smaller_runs), 20.0) == b"line 37"

    small = minimised(
        fixtures.text("arm.urdf").encode(), lambda data: b'"third"' in data, (smaller_xml,), 20.0
    )
    assert small.count(b"<") == 4


def test_the_smallest_input_of_a_fault_is_kept(tmp_path: Path):
    recorder = Recorder(tmp_path, "urdf", fresh=True)
    fault = Outcome("KeyError", "psdmc/robot/urdf/read_urdf.py:_joint", "'a'", "trace")
    for data in (b"long input", b"short", b"longer input"):
        recorder.start(data, deep=True)
        recorder.end(data, fault)

    (find,) = Recorder(tmp_path, "urdf").finds()
    assert find.data == b"short"
    assert find.outcome == fault
    assert recorder.figures()["find"] == recorder.inputs == 3


def test_a_forged_manifest_has_the_right_hash(around: Path, tmp_path: Path):
    members = unpacked(read_seeds(around, "model")[0])
    manifest = manifest_of(members)
    manifest["chain"]["name"] = "forged"
    for hashed, expected in ((False, False), (True, True)):
        stream = dict(members) | {"manifest.npy": _npy(json.dumps(manifest))}
        if hashed:
            set_hash(stream)
        (tmp_path / "m.npz").write_bytes(packed(stream))
        assert _loads(tmp_path / "m.npz") == expected


def _npy(text: str) -> bytes:
    import io

    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.array(text))
    return stream.getvalue()


def _loads(path: Path) -> bool:
    try:
        return load(path).chain.name == "forged"
    except InputError:
        return False


@pytest.mark.parametrize(
    ("name", "kind"), [("arm.urdf", "urdf"), ("sliding.toml", "dh"), ("two_link.toml", "dh")]
)
def test_the_oracle_agrees_and_disagrees(name: str, kind: str):
    text = fixtures.text(name)
    model = derive_model(load_robot_text(text, kind, snap=0.0).chain)
    wrong = derive_model(load_robot_text(text.replace("1.5", "1.6"), kind, snap=0.0).chain)

    assert torque_error(text, kind, model) < 1e-12
    assert torque_error(text, kind, wrong) > 1e-3


@pytest.mark.parametrize(
    ("name", "options", "change"),
    [
        ("hand.urdf", {}, ('multiplier="-0.8"', 'multiplier="0.8"')),
        ("hand.urdf", {"lock": {"close": 0.5}}, ('offset="0.02"', 'offset="0.2"')),
        ("hand.urdf", {"floating": True, "lock": {"bend": 0.3}}, ('value="0.1"', 'value="0.2"')),
        ("hand.urdf", {"base": "palm", "tip": "thumb", "lock": {"wrist": 1.0}}, ("0 0.6 0.8", "0 0.8 0.6")),
        ("hand.urdf", {"drive_inertia": [0.1, 0.2, 0.3, 0.4]}, ('multiplier="2"', 'multiplier="3"')),
        ("legs.urdf", {"floating": True, "gravity": [1.0, 2.0, 3.0]}, ('value="8"', 'value="9"')),
        ("branches.toml", {"gravity": [1.0, 2.0, 3.0]}, ('parent = "trunk"', 'parent = "base"')),
    ],
)
def test_the_oracle_knows_trees_and_options(name: str, options: dict, change: tuple[str, str]):
    text, kind = fixtures.text(name), "urdf" if name.endswith("urdf") else "dh"

    def error(read: str) -> float | None:
        robot = load_robot_text(read, kind, snap=0.0, **options)
        return torque_error(text, kind, derive_model(robot.mechanism, expand=False), robot.options)

    assert error(text) < 1e-12
    assert text != text.replace(*change)
    assert error(text.replace(*change)) > 1e-6


def test_messages_differ_by_their_gist():
    assert gist_of("run.csv: row 17: 'x' is 3.5e-3") == gist_of("run.csv: row 4: 'y' is 2")


def test_formats_are_chosen_by_beginning():
    assert [format.name for format in chosen("log-c,dh")] == ["dh", "log-csv"]
    with pytest.raises(SystemExit, match="no format x"):
        chosen("x")


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mutate", "atheris"])
def test_a_run_from_end_to_end(engine: str, tmp_path: Path):
    if engine == "atheris":
        pytest.importorskip("atheris")
    script, figures = Path(__file__).parent / "fuzz.py", tmp_path / "figures.json"
    words = [
        script,
        "--engine",
        engine,
        "--format",
        "dh",
        "--count",
        "60",
        "--seconds",
        "100",
        "--state",
        tmp_path,
        "--json",
        figures,
        "--minimise",
        "0",
    ]
    began = time.monotonic()

    done = subprocess.run([sys.executable, *map(str, words)], capture_output=True, text=True, check=False)

    row = json.loads(figures.read_text(encoding="utf-8"))["formats"]["dh"]
    assert done.returncode in (0, 1), done.stderr
    assert 60 <= row["inputs"] <= 80
    assert row["inputs"] == sum(
        row[kind] for kind in ("success", "InputError", "DerivationError", "ToolchainError", "find")
    )
    assert row["success"] > 0
    assert row["InputError"] > 0
    assert row["seconds"] < time.monotonic() - began
    if engine == "atheris":
        assert [path for path in (tmp_path / "dh" / "corpus").iterdir() if len(path.name) == 40], (
            "nothing was guided"
        )
