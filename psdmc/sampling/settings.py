"""The settings of a sampling: which states to draw, and which functions to evaluate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from psdmc.errors import InputError
from psdmc.sampling.along import Motion
from psdmc.target.target import Real

Draw = Literal["uniform", "sobol"]

MOST_STATES = 10**12

MOST_POINTS = 2**32 - 1
"""How many Sobol points of 32 binary digits there are."""


@dataclass(frozen=True, slots=True)
class Sampling:
    """The settings of a sampling: which states to draw and which functions to evaluate.

    states     number of states
    functions  names of the functions, as for the option `--functions`
    draw       'uniform': independent states; 'sobol': states that fill the limits more evenly, by a scrambled Sobol
               sequence
    seed       seed of the random states
    real       precision of states and values
    spread     0 to 1: for each state, the mass and inertia of each link are multiplied by a random factor between 1 -
               spread and 1 + spread
    given      ranges, plus and minus, beside the limits in the robot file: word of LIMITS -> range
    along      the motion at whose times the states are drawn; None: the states are drawn within the limits
    noise      standard deviation of noise on states of a motion, as a share of each value's standard deviation
    rows       number of states per part; None: as many as PART_BYTES and PART_STATES allow
    """

    states: int
    functions: Sequence[str] = ("inverse_dynamics",)
    draw: Draw = "uniform"
    seed: int = 0
    real: Real = "float64"
    spread: float = 0.0
    given: Mapping[str, float] = field(default_factory=dict)
    rows: int | None = None
    along: Motion | None = None
    noise: float = 0.0

    def __post_init__(self) -> None:
        _range("--states", self.states, 1, MOST_POINTS if self.draw == "sobol" else MOST_STATES)
        _range("--seed", self.seed, 0, 2**63 - 1)
        _range("--theta-spread", self.spread, 0.0, 1.0)
        _range("--part-states", 1 if self.rows is None else self.rows, 1, MOST_STATES)
        _range("--noise", self.noise, 0.0, 1e6)
        if self.noise and self.along is None:
            raise InputError("--noise without --along", "leave it out, or give a motion with --along")
        if self.given and self.along is not None:
            raise InputError(
                f"--{next(iter(self.given))} with --along", "leave it out: a motion needs no limits"
            )
        for word, value in self.given.items():
            _range(f"--{word}", value, 0.0, 1e6)
        if self.draw not in ("uniform", "sobol"):
            raise InputError(f"--draw is {self.draw!r}", "choose uniform or sobol")
        if self.real not in ("float64", "float32"):
            raise InputError(f"--real is {self.real!r}", "choose float64 or float32")


def _range(option: str, value: float, least: float, most: float) -> None:
    if not least <= value <= most:
        raise InputError(f"{option} is {value:g}", f"give a number from {least:g} to {most:g}")
