"""Options of the search for an exciting motion, apart so that the command line need not import the search."""

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
SMALLEST_MARGIN, LARGEST_MARGIN = 0.05, 0.99
"""Share of a limit that is used. What is left lets the motion begin and end at rest, so it is never all."""
LARGEST_EVALUATIONS = 10_000_000
FEWEST_SAMPLES, MOST_SAMPLES = 10, 100_000

Objective = Literal["deviation", "condition", "log_det"]


def chosen_objective(condition: bool, log_det: bool) -> Objective:
    """Return the objective for the options --condition and --log-det. Raises InputError if both are given."""
    if condition and log_det:
        raise InputError("--condition and --log-det are two objectives", "give one of them, or neither")
    return "condition" if condition else "log_det" if log_det else "deviation"


@dataclass(frozen=True, slots=True)
class ExciteOptions:
    """The choice of motions that are searched, and the limits of the search.

    duration       s, the period of the motion
    harmonics      multiples of 1/duration that each joint's sines have
    samples        number of samples per period at which the columns are computed
    objective      deviation: smallest condition number of the scaled columns over their mean length, a bound on standard
                   deviations; condition: smallest condition number, whatever the lengths; log_det: largest log determinant
    margin         share of the limits of position, speed and acceleration that the motion uses
    torque_margin  share of the torque limits that the motion uses; the rest is for unknown friction and the controller
    seconds        limit of CPU time, child processes included; the random motions and the checks of limits and collisions
                   run in any case
    evaluations    largest number of evaluations of the objective with its gradient. If they end the search before
                   `seconds`, the same seed gives the same motion again
    seed           of the random motions, from which the search starts and with which the result is compared
    random         number of random trajectories
    """

    duration: float = 10.0
    harmonics: tuple[int, ...] = (1, 2, 3, 4, 5)
    samples: int = 100
    objective: Objective = "deviation"
    margin: float = 0.98
    torque_margin: float = 0.8
    seconds: float = 60.0
    evaluations: int = 6000
    seed: int = 1
    random: int = 1000

    def __post_init__(self) -> None:
        bounds: tuple[tuple[str, float, float, float], ...] = (
            ("duration", self.duration, SHORTEST_DURATION, LONGEST_DURATION),
            ("seconds", self.seconds, 0.0, LONGEST_SEARCH),
            ("seed", self.seed, 0, LARGEST_SEED),
            ("harmonics", len(self.harmonics), 1, MOST_HARMONICS),
            ("highest harmonic", max(self.harmonics, default=0), 1, HIGHEST_HARMONIC),
            ("margin", self.margin, SMALLEST_MARGIN, LARGEST_MARGIN),
            ("torque margin", self.torque_margin, SMALLEST_MARGIN, 1.0),
            ("evaluations", self.evaluations, 1, LARGEST_EVALUATIONS),
            ("samples", self.samples, FEWEST_SAMPLES, MOST_SAMPLES),
            ("random", self.random, 1, LARGEST_EVALUATIONS),
        )
        for what, value, low, high in bounds:
            if not low <= value <= high:
                raise InputError(
                    f"exciting motion: {what} is {value:g}, expected {low:g} to {high:g}",
                    "choose a value in that range",
                )
