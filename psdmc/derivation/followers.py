"""Base parameters of robots whose joints follow others: fewer than those of the same tree with every joint free.

All torques of the free tree depend on its base parameters alone, and so do their sums onto the leaders. Which of these
parameters the sums tell apart is found from sampled rows, one column for each: two fingers that close together show the sum
of their masses.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import sparse

from psdmc.derivation.link_by_link import reduction_link_by_link
from psdmc.derivation.reduce import Reduction, reduced
from psdmc.derivation.sampled import reduction_of, sampled_regressor
from psdmc.derivation.units import Scaled
from psdmc.dynamics.following import any_follows
from psdmc.robot.mechanism import PARAMETERS_PER_LINK

STATES = 64
"""Sampled motions; a joint's own link has eleven columns to tell apart."""


def reduction_for(scaled: Scaled) -> Reduction:
    """The base parameters within the span's columns, of robots with and without followers."""
    return _of_followers(scaled) if any_follows(scaled.frames) else reduction_of(scaled)


def _of_followers(scaled: Scaled) -> Reduction:
    free = replace(scaled, frames=tuple(replace(frame, follows=None) for frame in scaled.frames))
    tree = reduction_link_by_link(free)
    rows = sampled_regressor(scaled, STATES).reshape(-1, PARAMETERS_PER_LINK * len(scaled.types))
    seen = np.asarray((sparse.csr_array(scaled.span.T) @ rows.T).T)[:, tree.pivots]
    own = reduced(seen)
    return Reduction(tree.pivots[own.pivots], own.echelon @ tree.echelon, True)
