"""Determines which unknowns the data show: alone, weakly, only in combination with others, or not at all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.identify.estimate import FitOptions
from psdmc.calibration.logs.foreign_bytes import listed
from psdmc.calibration.logs.log import Array
from psdmc.model.calibrated import IDENTIFIED, SHOWN, WEAK, Remark

TOGETHER_WORDS = "only in combination with "
WEAK_SHARE = 0.5
"""Standard deviation, as a share of the value, from which a parameter is called weakly visible: its sign is then
certain by two standard deviations at most."""
INVISIBLE_SHARE = 0.9999
"""Share (squared) of a parameter in unseen directions from which it is not seen at all: a hundredth may remain."""
TOGETHER = 0.2
"""Correlation within unseen directions from which two parameters are said to be visible in combination only."""
NAMED = 4
"""Partners that a message names."""


@dataclass(frozen=True, slots=True, eq=False)
class Visibility:
    """Remarks on what the data show of each of the m unknowns of a fit.

    words       m remarks: "identified", "weakly visible", "only in combination with ...", "not visible: kept at ..."
    determined  (m,) True: the data determine the unknown by itself, however weakly. The unknown then has a standard
                deviation
    """

    words: tuple[Remark, ...]
    determined: NDArray[np.bool_]


def visibility(
    names: Sequence[str],
    values: Array,
    std: Array,
    unseen: Array,
    kept_at: Sequence[str],
    options: FitOptions | None = None,
) -> Visibility:
    """Return a remark for each of m unknowns of a fit on how well the data show the unknown.

    values, std  (m,) final values and their standard deviations
    unseen       (m, k) k directions that the data do not show, in units of plausible sizes
    kept_at      m texts: the value at which an unknown stays if the data do not show the unknown
    """
    limit = (options or FitOptions()).unseen_share
    share = np.minimum(np.sum(unseen**2, axis=1), 1.0)
    size = np.linalg.norm(unseen, axis=1)
    size[size == 0] = 1.0
    together = np.abs(unseen @ unseen.T) / np.outer(size, size)
    words = []
    for j in range(len(names)):
        if share[j] < limit:
            weak = not std[j] < WEAK_SHARE * abs(values[j])
            words.append(WEAK if weak else IDENTIFIED)
        else:
            words.append(_unseen(names, j, share, together[j], limit, kept_at[j]))
    return Visibility(tuple(words), share < limit)


BY_PRIOR = Remark("by the stated prior more than by the data", "stated")


def as_fitted(
    seen: Visibility, kept_at: Sequence[str], dropped: NDArray[np.bool_], stated: NDArray[np.bool_]
) -> Visibility:
    """Return the remarks on m unknowns after a fit that left out unknowns or used a prior.

    dropped  (m,) True: the fit left the unknown out because the data do not need it
    stated   (m,) True: the unknown has a prior with a confidence that the user stated
    """
    words = [
        Remark(f"not essential: kept at {kept_at[k]}", "dropped")
        if dropped[k]
        else BY_PRIOR
        if stated[k] and not known
        else word
        for k, (word, known) in enumerate(zip(seen.words, seen.determined, strict=True))
    ]
    return Visibility(tuple(words), (seen.determined | stated) & ~dropped)


def _unseen(
    names: Sequence[str], j: int, share: Array, together: Array, limit: float, kept_at: str
) -> Remark:
    if share[j] > INVISIBLE_SHARE:
        return Remark(f"not visible: kept at {kept_at}", "invisible")
    partly = (share >= limit) & (share <= INVISIBLE_SHARE) & (together > TOGETHER)
    partners = [k for k in np.argsort(-together, kind="stable") if partly[k] and k != j]
    if not partners:
        return Remark(f"mostly invisible: near {kept_at}", "mostly")
    named = ", ".join(names[k] for k in partners[:NAMED])
    more = f" and {len(partners) - NAMED} more" if len(partners) > NAMED else ""
    return Remark(f"{TOGETHER_WORDS}{named}{more}", "together")


def visibility_warnings(step: str, names: Sequence[str], found: Visibility) -> tuple[str, ...]:
    """Return a sentence for each way in which the data do not show unknowns, friction and offsets included."""
    together = [
        f"{name} (with {words.removeprefix(TOGETHER_WORDS)})"
        for name, words in zip(names, found.words, strict=True)
        if words.code == "together"
    ]
    groups: dict[str, list[str]] = {}
    for name, words in zip(names, found.words, strict=True):
        if words.code not in SHOWN and words.code not in ("together", "dropped"):
            groups.setdefault(words, []).append(name)
    alone = tuple(f"{step}: {', '.join(own)}: {words}" for words, own in groups.items())
    if not together:
        return alone
    return (
        f"{step}: visible only in combination, each as near to the prior as it may be: {'; '.join(together)}",
        *alone,
    )


def weak_notes(step: str, names: Sequence[str], found: Visibility) -> tuple[str, ...]:
    """Return notes with the names of unknowns whose standard deviation is almost as large as their value."""
    weak = [name for name, words in zip(names, found.words, strict=True) if words.code == WEAK.code]
    if not weak:
        return ()
    seen = sum(words.code == IDENTIFIED.code for words in found.words)
    return (
        f"{step}: {seen} of {len(names)} unknowns identified; {len(weak)} weakly visible (standard deviation above "
        f"half of the value): {listed(weak)}",
    )
