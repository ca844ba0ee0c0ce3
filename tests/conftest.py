"""Shared set-up: test helpers beside this file can be imported by name; hypothesis draws the same examples every time,
however busy the machine is, or, with HYPOTHESIS_PROFILE=explore, new ones; one compile cache serves the whole run and is
thrown away with it; Ctrl-C is heard by the commands under test also where a shell runs the tests in the background and
has it ignored; Python keeps the bytecode of tests and psdmc, which hundreds of processes load, also where the environment
says otherwise; commands under test tell no progress, which depends on the machine's load; tests that need a program which
is not installed are skipped, and the run ends with how many tests were skipped for which reason; --part K/N runs the
tests whose name's checksum leaves K if divided by N; tests named in long_tests.txt are slow."""

from __future__ import annotations

import os
import signal
import sys
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings
from installed import need

sys.path.insert(0, str(Path(__file__).parent))

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
os.environ["PSDMC_PROGRESS"] = "off"

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("explore", derandomize=False)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--part", default="0/1", metavar="K/N", help="run part K of N of the tests")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    _mark_long_tests(config, items)
    part, parts = map(int, config.getoption("--part").split("/"))
    chosen = [zlib.crc32(item.nodeid.partition("[")[0].encode()) % parts == part for item in items]
    config.hook.pytest_deselected(items=[item for item, own in zip(items, chosen, strict=True) if not own])
    kept = [item for item, own in zip(items, chosen, strict=True) if own]
    items[:] = sorted(kept, key=lambda item: not item.nodeid.startswith(SHARED))


SHARED = "tests/functions/"
"""Tests that share compiled robots: they come first, so that one worker runs them all."""

LONG_TESTS = Path(__file__).parent / "long_tests.txt"


def _mark_long_tests(config: pytest.Config, items: list[pytest.Item]) -> None:
    lines = LONG_TESTS.read_text(encoding="utf-8").splitlines()
    long = {line for line in lines if not line.startswith("#")}
    for item in items:
        if item.nodeid in long:
            item.add_marker(pytest.mark.slow)
    files = {item.nodeid.partition("::")[0] for item in items}
    unknown = {line for line in long if line.partition("::")[0] in files} - {item.nodeid for item in items}
    if unknown and config.args == ["tests"]:
        raise pytest.UsageError(f"{LONG_TESTS.name}: there is no test {min(unknown)}")


@pytest.fixture(scope="session", autouse=True)
def compile_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Shared by all workers: each robot is lowered and compiled once a run."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if base.name.startswith("popen-gw") else base) / "compile-cache"
    patch = pytest.MonkeyPatch()
    patch.setenv("PSDMC_CACHE_DIR", str(folder))
    yield folder
    patch.undo()


@pytest.fixture
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A compile cache of the test's own, which does not exist yet."""
    monkeypatch.setenv("PSDMC_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    for mark in item.iter_markers("needs"):
        need(*mark.args)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    reasons = Counter(
        report.longrepr[2].removeprefix("Skipped: ") for report in terminalreporter.stats.get("skipped", [])
    )
    for reason, count in sorted(reasons.items(), key=lambda entry: (-entry[1], entry[0])):
        terminalreporter.write_line(f"skipped: {count} {'test' if count == 1 else 'tests'}: {reason}")
