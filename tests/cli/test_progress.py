"""What a command says while it works: nothing for two seconds, then one line a stage, with the time left if it is known."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from bundled import bundled_model, robot_path

from psdmc.cli.console import PATIENCE, Estimate, Lines, in_words
from psdmc.lower.kernels import lower
from psdmc.progress import Step, within


class Clock:
    """A clock that the test moves."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


def test_the_time_left_is_that_of_the_pace_so_far(clock: Clock) -> None:
    estimate = Estimate(clock)
    estimate.tell("reading the robot")
    assert estimate.left() is None
    estimate.tell(Step("round 1 of 10", 0.0))
    clock.now += 4.0
    estimate.tell(Step("round 3 of 10", 0.2))
    assert estimate.left() == pytest.approx(16.0)
    assert estimate.stage == 2

    estimate.tell(Step("round 1 of 3", 0.0))  # another robot
    assert (estimate.stage, estimate.left()) == (3, None)
    estimate.tell("writing")
    assert (estimate.stage, estimate.left()) == (4, None)


def test_nothing_is_said_of_short_work_and_one_line_of_each_long_stage(clock: Clock) -> None:
    said: list[str] = []
    lines = Lines(said.append, clock)
    lines.tell("reading")
    clock.now += PATIENCE - 0.1
    lines.look()
    assert said == []

    lines.tell(Step("lowering gravity", 0.0))
    clock.now += 0.2
    lines.look()
    assert said == ["lowering gravity ..."]
    for k in range(1, 10):
        clock.now += 1.0
        lines.tell(Step(f"lowering function {k}", k / 10))
        lines.look()
    assert len(said) == 1

    lines.tell("writing")
    lines.look()
    assert said[1:] == ["writing ..."]


def test_a_line_has_the_time_left(clock: Clock) -> None:
    said: list[str] = []
    lines = Lines(said.append, clock)
    lines.tell(Step("round 1 of 10", 0.0))
    clock.now += 1.5
    lines.tell(Step("round 2 of 10", 0.1))
    clock.now += 1.5
    lines.tell(Step("round 3 of 10\x1b[2J", 0.2))
    lines.look()

    assert said == [r"round 3 of 10\x1b[2J ..., about 12 s left"]


def test_a_stage_that_is_about_to_end_is_not_told(clock: Clock) -> None:
    said: list[str] = []
    lines = Lines(said.append, clock)
    lines.tell(Step("lowering jacobian", 0.0))
    clock.now += 2.1
    lines.tell(Step("lowering jacobian", 0.9))
    lines.look()
    assert said == []

    lines.tell(Step("round 1 of 2", 0.0))
    lines.look()
    assert said == ["round 1 of 2 ..."], "the patience was not used up"


def test_shares_pass_through_longer_texts() -> None:
    told: list[str] = []
    tell = within("kr6", told.append)
    tell(Step("round 2 of 4", 0.25))
    tell("checking")

    assert told == ["kr6: round 2 of 4", "kr6: checking"]
    assert isinstance(told[0], Step)
    assert told[0].share == 0.25
    assert in_words(99.4) == "99 s"
    assert in_words(300) == "5 min"


def test_lowering_says_how_far_it_is() -> None:
    told: list[str] = []
    lower(bundled_model("two_link"), "factored", ["gravity", "mass_matrix"], told.append)

    assert [(str(step), step.share) for step in told if isinstance(step, Step)] == [
        ("lowering mass_matrix", 0.0),
        ("lowering mass_matrix_theta", 0.25),
        ("lowering gravity", 0.5),
        ("lowering gravity_theta", 0.75),
    ]


IMPATIENT = """
import sys, psdmc.cli.console as progress
progress.PATIENCE, progress.TICK = 0.0, 0.0001
from psdmc.cli import main
main(sys.argv[1:])
"""


@pytest.mark.parametrize("variable", ["", "off"])
def test_stages_of_a_command_are_lines_on_standard_error(variable: str, tmp_path: Path) -> None:
    """Of a command that has no patience; without a terminal."""
    done = subprocess.run(
        [sys.executable, "-c", IMPATIENT, "derive", robot_path("kr6"), "-o", tmp_path / "m.npz"],
        capture_output=True, text=True, check=True, env=os.environ | {"PSDMC_PROGRESS": variable},
    )  # fmt: skip
    *stages, last = done.stderr.splitlines()

    assert last.startswith("next: psdmc check")
    assert all(line.endswith(" ...") for line in stages)
    assert len(stages) == len(set(stages))
    assert ("reading the robot ..." in stages) == (variable != "off")
    assert "..." not in done.stdout
