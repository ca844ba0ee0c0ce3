"""Every reader stops at a stated limit: files, pipes and devices that never end are refused in a line."""

from __future__ import annotations

import ast
import io
import os
import resource
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from bundled import ROBOTS
from command_line import typed

import psdmc
from psdmc.calibration.logs.formats.text import PIECE_BYTES, whole_lines
from psdmc.errors import InputError
from psdmc.files import in_words, read_file, read_rest

PACKAGE = Path(psdmc.__file__).parent


class Endless(io.RawIOBase):
    """A device that never ends, and counts what was taken of it."""

    def __init__(self, text: bytes = b"\0") -> None:
        self.text, self.taken = text, 0

    def read(self, size: int = -1) -> bytes:
        assert size >= 0, "all of it was asked for"
        start = self.taken
        self.taken += size
        return bytes(self.text[k % len(self.text)] for k in range(start, start + size))


@pytest.mark.parametrize("most", [0, 1, 1000])
def test_one_byte_beyond_the_limit_is_read_at_most(most: int) -> None:
    device = Endless()

    with pytest.raises(
        InputError, match=rf"it: more than {most:,} bytes, which is the most that psdmc reads"
    ):
        read_rest(device, most, "it", "give less")

    assert device.taken == most + 1


def test_of_a_file_that_begins_otherwise_nothing_more_is_read() -> None:
    device = Endless()
    assert read_rest(device, 10**9, "it", "", b"PK") == b"\0\0"
    assert device.taken == 2


@pytest.mark.parametrize("content", [b"", b"P", b"PK", b"PK and more"])
def test_what_fits_comes_back_whole(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(content)
    assert read_file(tmp_path / "a", len(content), "") == content
    assert read_file(tmp_path / "a", len(content), "", b"PK") == content


def test_a_pipe_that_gives_little_at_a_time_is_read_to_its_end() -> None:
    reading, writing = os.pipe()

    def write() -> None:
        with open(writing, "wb", buffering=0) as file:
            for _ in range(100):
                file.write(b"PK" * 500)

    writer = threading.Thread(target=write)
    writer.start()
    with open(reading, "rb", buffering=0) as file:
        assert read_rest(file, 100_000, "pipe", "", b"PK") == b"PK" * 50_000
    writer.join()


def test_limits_in_words() -> None:
    assert [in_words(size) for size in (5, 4 << 20, 2 << 30, (1 << 20) + 1)] == [
        "5 bytes",
        "4 MiB",
        "2 GiB",
        "1,048,577 bytes",
    ]


def test_a_line_without_end_is_refused() -> None:
    device = io.BytesIO(b"1" * (2 * PIECE_BYTES + 5))
    with pytest.raises(InputError, match=r"log.csv: a line of more than 16 MiB"):
        list(whole_lines(device, "log.csv"))
    assert device.tell() == 2 * PIECE_BYTES


def test_lines_come_back_whole() -> None:
    text = b"1,2\n" * (PIECE_BYTES // 4 + 3) + b"3,4"
    pieces = list(whole_lines(io.BytesIO(text), "log.csv", b"0,0\n"))
    assert b"".join(pieces) == b"0,0\n" + text
    assert all(piece.endswith(b"\n") for piece in pieces[:-1])


MEMORY = 400_000_000
"""Bytes of address space that a refusal may take: a device would fill far more."""


@pytest.mark.skipif(sys.platform != "linux", reason="needs /dev/zero and /proc")
@pytest.mark.parametrize(
    ("command", "said"),
    [
        (["show", "/dev/zero"], "/dev/zero: not a psdmc model file"),
        (["emit-c", "/dev/zero", "-o", "package"], "/dev/zero: not a psdmc model file"),
        (["derive", "/dev/zero", "-o", "m.npz"], "/dev/zero: more than 4 MiB"),
        (["show", "zero.urdf"], "zero.urdf: more than 4 MiB"),
        (["calibrate", "zero.npz", "zero.csv", "-o", "c.npz"], "zero.npz: not a psdmc model file"),
        (["simulate", "zero.toml", "zero.toml"], "zero.toml: is not a file"),
    ],
)
def test_a_device_that_never_ends_is_refused(command: list[str], said: str, tmp_path: Path) -> None:
    for name in ("zero.urdf", "zero.npz", "zero.csv", "zero.toml"):
        (tmp_path / name).symlink_to("/dev/zero")

    typed("--version")  # loads what commands need
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MEMORY, before[1]))
    try:
        done = typed(*command, cwd=tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)

    assert done.returncode == 2, done.stderr
    assert f"error: {said}" in done.stderr
    assert len(done.stderr.splitlines()) == 2


def test_a_robot_and_a_model_come_through_a_pipe(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")

    def piped(content: bytes, *words: str) -> subprocess.CompletedProcess[str]:
        writer = threading.Thread(target=(tmp_path / "pipe").write_bytes, args=(content,))
        writer.start()
        done = typed(*words, cwd=tmp_path)
        writer.join()
        return done

    derived = piped((ROBOTS / "rounded_arm.urdf").read_bytes(), "derive", "pipe", "-o", "arm.npz")
    shown = piped((tmp_path / "arm.npz").read_bytes(), "show", "pipe")

    assert (derived.returncode, shown.returncode) == (0, 0), (derived.stderr, shown.stderr)
    assert "source: pipe" in shown.stdout


READS_ALL = {"read_text", "read_bytes"}
"""Methods that read a file to its end."""

OWN = {
    "bench/measure.py": "the kernel's figures, and valgrind's output",
    "bench/contestant.py": "psdmc's own sources",
    "bench/cases.py": "the kernel's figures",
    "bench/machine.py": "the kernel's figures",
    "bench/rivals/casadi_c.py": "a file that was just written",
    "bench/rivals/cppadcg_c.py": "a file that was just written",
    "calibration/simulate_campaign.py": "psdmc's own sources",
    "derivation/memory.py": "the kernel's figures",
    "backends/render.py": "psdmc's own templates",
    "backends/c/render.py": "psdmc's own words",
    "robot/dh.py:write_new_robot": "psdmc's own template",
    "toolchain/cache_room.py": "the user's own cache, by its size",
    "toolchain/direct_calls.py": "psdmc's own sources",
    "toolchain/compile.py": "the user's own cache, sealed",
    "toolchain/stubs.py": "psdmc's own sources",
}
"""What is read whole and is no input of a user's: file of psdmc, or one function of it, and whose it is."""


def unbounded_reads(part: ast.AST) -> Iterator[int]:
    """Lines that read a file to its end, however long it is."""
    for node in ast.walk(part):
        if not isinstance(node, ast.Call):
            continue
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        of = node.func.value if isinstance(node.func, ast.Attribute) else None
        module = of.id if isinstance(of, ast.Name) else ""
        if (
            name in READS_ALL
            or (name in ("read", "readline", "readlines") and not node.args and not node.keywords)
            or (module, name) in {("json", "load"), ("tomllib", "load"), ("np", "load"), ("np", "fromfile")}
        ):
            yield node.lineno


def test_no_file_of_a_users_is_read_without_a_limit() -> None:
    found = {
        file if file in OWN else f"{file}:{getattr(part, 'name', '')}": lines
        for path in sorted(PACKAGE.rglob("*.py"))
        for file in [str(path.relative_to(PACKAGE))]
        for part in ast.parse(path.read_text(encoding="utf-8")).body
        if (lines := list(unbounded_reads(part)))
    }
    assert {name: lines for name, lines in found.items() if name not in OWN} == {}
    assert set(OWN) <= set(found), "no longer needed: take it out of the list"


def test_a_read_without_a_limit_is_seen() -> None:
    module = ast.parse("x = path.read_bytes()\ny = file.read()\nz = file.read(5)")
    assert list(unbounded_reads(module)) == [1, 2]
    assert list(unbounded_reads(ast.parse("json.load(file)\njson.loads(text)"))) == [1]
