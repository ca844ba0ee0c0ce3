"""log.toml is read whole, or refused in one line that names file, table, key, what was found and what is expected."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from psdmc.calibration.description.description import (
    FIT,
    LOGS,
    FitChoice,
    LogEntry,
    is_description,
    read_description,
)
from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.logs.filter import SplitOptions
from psdmc.errors import InputError

WHOLE = """
[[log]]
file = "one.csv"
start = 1.5
end = 60
[[log]]
file = "two.csv"
use = "validate"
[fit]
cutoff = 5
held_out = 0.2
friction = ["coulomb", "viscous", "viscous^2", "offset"]
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "log.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_whole_description(tmp_path: Path):
    found = read_description(written(tmp_path, WHOLE))

    assert found.part(LOGS) == (
        LogEntry({"": tmp_path / "one.csv"}, "fit", 1.5, 60.0, ""),
        LogEntry({"": tmp_path / "two.csv"}, "validate", 0.0, math.inf, ""),
    )
    assert found.part(FIT) == FitChoice(5.0, SplitOptions(0.2, 0), (1.0, 2.0), True)
    options = found.options(LinearOptions())
    assert (options.filter.cutoff, options.split.held_out, options.exponents) == (5.0, 0.2, (1.0, 2.0))


FAULTS = {
    "[fit]\ncutoff = 5": "no [[log]], expected one for each recording",
    "log = 3": "log: found 3, expected 1 to 1000 tables [[log]]",
    "[[log]]": "log 1: file: missing, expected a text of at most 300 characters",
    '[[log]]\nfile = "a.csv"\nfil = 3': "log 1: unknown key(s) 'fil', known are file, tables, use, start, end, topic",
    '[[log]]\nfile = "a.csv"\nuse = "test"': "log 1: use: found 'test', expected one of fit, validate",
    '[[log]]\nfile = "a.csv"\nuse = "validate"': "log: every one is for validation, expected one for fitting",
    '[[log]]\nfile = "a.csv"\nstart = 3\nend = 2': "log 1: end: found 2, expected more than its start, 3 s",
    '[[log]]\nfile = "a\\u0000b"': "log 1: file: found 'a\\x00b', expected a text of at most 300 characters",
    '[[log]]\nfile = "a.csv"\n[fit]\ncutoff = "5"': "fit: cutoff: found '5', expected a number from 0.01 to 10000",
    '[[log]]\nfile = "a.csv"\n[fit]\nfriction = ["viscous"]': "fit: friction: no coulomb",
    '[[log]]\nfile = "a.csv"\n[fit]\nfriction = ["coulomb", 3]': "fit: friction: found 3, expected coulomb, viscous",
    '[[log]]\nfile = "a.csv"\n[fits]\ncutoff = 5': "description: unknown key(s) 'fits', known are log, ",
}


@pytest.mark.parametrize("text", FAULTS)
def test_what_is_wrong_is_named_in_one_line(tmp_path: Path, text: str):
    path = written(tmp_path, text)

    with pytest.raises(InputError) as raised:
        read_description(path)

    assert FAULTS[text] in raised.value.message
    assert raised.value.message.startswith(f"{path}: ")
    assert "\n" not in raised.value.message
    assert "--describe" in (raised.value.hint or "")


def test_a_campaign_is_no_description(tmp_path: Path):
    assert is_description(written(tmp_path, WHOLE))
    assert not is_description(written(tmp_path, '[[run]]\nstep = "motor"'))
    assert not is_description(tmp_path / "log.csv")
