"""A full disk in every command that writes: one line, status 4, the old files whole, nothing else left behind.

No file may grow beyond some bytes: the kernel refuses as a full disk does, for any user and on any machine.
A small disk that is really full is tried where mounting is allowed.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from bundled import bundled_model, robot_path
from command_line import files_in, started, typed
from full_disk import files_of_at_most
from killable import run
from slow_cases import slow_but_for
from test_killed import a_log, built_package

from psdmc.bench.machine import this_machine
from psdmc.bench.results import BenchResult
from psdmc.compiler import compile as compile_model

KILOBYTES_LEFT = 2
TOO_LITTLE = KILOBYTES_LEFT << 10


def model_into(folder: Path) -> None:
    bundled_model("two_link").save(folder / "m.npz")


def old_model(folder: Path) -> None:
    a_log(folder)
    shutil.copy(folder / "m.npz", folder / "x.npz")


COMMANDS = {
    "derive": (["derive", robot_path("kr6"), "-o", "x.npz"], old_model),
    "emit-c": (["emit-c", "m.npz", "-o", "c", "--force"], built_package),
    "calibrate": (
        ["calibrate", "m.npz", "log.csv", "-o", "x.npz", "--report", "x.html", "--no-physical"],
        old_model,
    ),
}


@pytest.mark.parametrize("name", slow_but_for(["emit-c"], COMMANDS))
def test_a_full_disk_is_one_line_and_the_old_files(name: str, tmp_path: Path):
    words, prepare = COMMANDS[name]
    folder = tmp_path / "work"
    folder.mkdir()
    prepare(folder)
    if name == "calibrate":
        assert run(words, folder) == 0, (
            tmp_path / "work.said"
        ).read_text()  # what is compiled is in the cache now
    before = files_in(folder)

    with files_of_at_most(TOO_LITTLE):
        status = run(words, folder)

    said = (tmp_path / "work.said").read_text(encoding="utf-8")
    errors = [line for line in said.splitlines() if line.startswith("error: ")]
    assert status == 4, said
    assert "File too large" in errors[0]
    assert "Traceback" not in said
    assert files_in(folder) == before


def test_a_full_disk_under_a_campaign(tmp_path: Path):
    """It writes many files: those that are there are whole, and none is a temporary one."""
    folder = tmp_path / "work"
    folder.mkdir()
    model_into(folder)
    words = ["excite", "m.npz", "-o", "plan", "--seconds", 1, "--duration", 5, "--acceleration", 10]
    compile_model(bundled_model("two_link"), functions=["regressor"])  # in the cache before the disk is full
    with files_of_at_most(TOO_LITTLE):
        status = run(words, folder)

    said = (tmp_path / "work.said").read_text(encoding="utf-8")
    assert status == 4, said
    assert said.splitlines()[-2].startswith("error: ")
    assert files_in(folder).keys() == {"m.npz"}


def test_a_full_cache_disk_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The compiler's own files do not fit either: what it says is passed on, and no entry stays."""
    monkeypatch.setenv("PSDMC_CACHE_DIR", str(tmp_path / "cache"))
    folder = tmp_path / "work"
    folder.mkdir()
    a_log(folder)
    with files_of_at_most(TOO_LITTLE):
        status = run(["calibrate", "m.npz", "log.csv", "-o", "x.npz", "--no-physical"], folder)

    said = (tmp_path / "work.said").read_text(encoding="utf-8")
    assert status == 4, said
    assert [line.split(":")[0] for line in said.splitlines()] == ["error", "hint"], said
    assert not [path for path in (tmp_path / "cache").glob("*") if path.name.startswith(".")]


@pytest.mark.parametrize("options", [["--json", "x.json"], ["--report", "x.html"]])
def test_a_full_disk_under_what_was_measured(
    options: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    measured = BenchResult(this_machine(), {f"rival {k}": "1.0" for k in range(200)}, 1, 1, ())
    monkeypatch.setattr("psdmc.bench.run.run", lambda *_: measured)
    folder = tmp_path / "work"
    folder.mkdir()
    model_into(folder)
    (folder / options[1]).write_text("old")
    before = files_in(folder)

    with files_of_at_most(TOO_LITTLE):
        status = run(["bench", "m.npz", *options], folder)

    said = (tmp_path / "work.said").read_text(encoding="utf-8")
    assert status == 4, said
    assert [line.split(":")[0] for line in said.splitlines()[-2:]] == ["error", "hint"], said
    assert "Traceback" not in said
    assert files_in(folder) == before


def test_a_full_disk_behind_the_benchmarks_table(tmp_path: Path):
    """`python -m psdmc.bench > table`."""
    code = (
        "import sys; from psdmc.bench import __main__ as bench; from psdmc.bench.results import BenchResult\n"
        "from psdmc.bench.machine import this_machine\n"
        "bench.standard_cases = lambda *_, **__: []; sys.argv = ['bench', '--quick']\n"
        "bench.run = lambda *_: BenchResult(this_machine(), {}, 1, 1, ())\n"
        "sys.exit(bench.main())"
    )
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-c", code], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 4
    assert done.stderr.splitlines()[0].startswith("error: standard output: No space left")
    assert [line.split(":")[0] for line in done.stderr.splitlines()] == ["error", "hint"]


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 64 KiB; skipped where mounting is not allowed."""
    place = tmp_path / "disk"
    place.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=64k", "none", str(place)], capture_output=True, check=False
    )
    if mounted.returncode:
        pytest.skip("mounting a small disk is not allowed here")
    yield place
    subprocess.run(["umount", str(place)], check=True)


def test_a_disk_that_is_really_full(small_disk: Path, tmp_path: Path):
    old = small_disk / "m.npz"
    bundled_model("two_link").save(old)
    before = old.read_bytes()
    (small_disk / "filler").write_bytes(bytes(shutil.disk_usage(small_disk).free - 4096))

    derived = typed("derive", robot_path("kr6"), "-o", old)
    emitted = typed("emit-c", old, "-o", small_disk / "c", "--functions", "gravity")

    for done in (derived, emitted):
        assert done.returncode == 4, done.stderr
        assert "No space left on device" in done.stderr
        assert [line.split(":")[0] for line in done.stderr.splitlines()] == ["error", "hint"]
    assert old.read_bytes() == before
    assert set(files_in(small_disk)) == {"m.npz", "filler"}


def test_the_commands_that_show_write_no_file(tmp_path: Path):
    model_into(tmp_path)
    with files_of_at_most(TOO_LITTLE):
        assert started("show", tmp_path / "m.npz").returncode == 0
    assert os.listdir(tmp_path) == ["m.npz"]
