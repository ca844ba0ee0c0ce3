"""What an exciting motion is searched among, and for how long; apart from the search, which the command line loads late."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from psdmc.errors import InputError

SHORTEST_DURATION, LONGEST_DURATION = 0.1, 120.0
"""s, of a period: from what a small joint can follow to what fits a log, six periods at 1 kHz."""
LONGEST_SEARCH = 86_400.0
"""s: a day."""
MOST_HARMONICS, HIGHEST_HARMONIC = 20, 100
"""Per joint: each adds two unknowns per joint to the search."""
LARGEST_SEED = 2**31
"""Largest seed. Seeds start at 1, as the search takes 0 for a seed drawn from the clock."""

Objective = Literal["condition", "log_det"]


@dataclass(frozen=True, slots=True)
class ExciteOptions:
    """What is searched, and for how long.

    duration    s, the period of the motion
    harmonics   multiples of 1/duration that each joint's sines have
    samples     times per period at which the regressor is stacked
    objective   condition: smallest condition number of the column-scaled stack; log_det: largest log determinant
    columns     base parameters that count; None: all. The paper's (23) counts those that gravity does not show
    margin      share of every limit that is used
    seconds     s, wall-clock limit of the search
    evaluations largest number of candidates: together with the seed it decides the result, where `seconds` does not
    population  candidates at once
    seed        of the search and of the random trajectories to compare with
    random      number of random trajectories to compare with
    """

    duration: float = 10.0
    harmonics: tuple[int, ...] = (1, 2, 3)
    samples: int = 100
    objective: Objective = "condition"
    columns: tuple[int, ...] | None = None
    margin: float = 0.98
    seconds: float = 50.0
    evaluations: int = 120_000
    population: int = 48
    seed: int = 1
    random: int = 1000

    def __post_init__(self) -> None:
        bounds: tuple[tuple[str, float, float, float], ...] = (
            ("duration", self.duration, SHORTEST_DURATION, LONGEST_DURATION),
            ("seconds", self.seconds, 0.0, LONGEST_SEARCH),
            ("seed", self.seed, 1, LARGEST_SEED),
            ("harmonics", len(self.harmonics), 1, MOST_HARMONICS),
            ("highest harmonic", max(self.harmonics, default=0), 1, HIGHEST_HARMONIC),
        )
        for what, value, low, high in bounds:
            if not low <= value <= high:
                raise InputError(
                    f"exciting motion: {what} is {value:g}, expected {low:g} to {high:g}",
                    "choose a value in that range",
                )
