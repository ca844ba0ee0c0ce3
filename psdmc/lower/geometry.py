"""New joint frames of a model, for each choice of their origins on the joint axes, and the possible carriers (nonzero
parameters). All searches share these results."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

from psdmc.lower.carrier_columns import carrier_space
from psdmc.lower.carriers import CarrierSpace
from psdmc.lower.reframe import Foot, Reframed, reframe, unmoved
from psdmc.robot.mechanism import Array, Mechanism

LARGE = 10
"""Joints. Each trial of a larger robot takes longer, so that fewer are made, and less of what they can change is tried."""


class Geometry:
    """The new joint frames of one model and the possible carriers (nonzero parameters). They depend neither on the
    generated function, nor on whether theta_b is constant in the code.

    turns_base  whether the base may be turned about the first axis, to align it with gravity
    """

    def __init__(self, chain: Mechanism, representative: Array, turns_base: bool = True) -> None:
        self.chain, self.representative, self.turns_base = chain, representative, turns_base
        self._reframed: dict[tuple[Foot, ...], Reframed] = {}
        self._spaces: dict[Reframed, CarrierSpace] = {}

    @cached_property
    def feet(self) -> tuple[tuple[Foot, ...], ...]:
        """Return the choices of `all_feet` that give different frames. For parallel or crossing axes, both positions on
        an axis give the same frame."""
        seen: dict[tuple[Foot, ...], Reframed] = {}
        for feet in all_feet(self.chain):
            reframed = self.reframed(feet)
            if not any(reframed.is_same(other) for other in seen.values()):
                seen[feet] = reframed
        return tuple(seen)

    def reframed(self, feet: tuple[Foot, ...]) -> Reframed:
        """Return the robot's new joint frames, with each origin where a common normal meets the joint's axis.

        feet  for each joint, whether this is the normal to the previous or to the next axis
        """
        if feet not in self._reframed:
            self._reframed[feet] = reframe(self.chain, feet, self.turns_base)
        return self._reframed[feet]

    @cached_property
    def unmoved(self) -> Reframed:
        """The robot's own frames."""
        return unmoved(self.chain)

    def space(self, reframed: Reframed) -> CarrierSpace:
        """Return the possible carriers in these frames: sets of link parameters that can represent all others."""
        if reframed not in self._spaces:
            self._spaces[reframed] = carrier_space(reframed, self.representative)
        return self._spaces[reframed]


def all_feet(chain: Mechanism) -> Iterator[tuple[Foot, ...]]:
    """Yield choices of the frames' origins on the joint axes. First, all frames are on the normal to the previous axis.
    Then each single frame is on the normal to the next axis, and then all frames. Joints without children have no next
    axis.

    For large robots, only the first choice and the last one are yielded.
    """
    n, leaves = len(chain), chain.leaves
    singly = [(i,) for i in range(n) if i not in leaves] if n <= LARGE else []
    for moved in [(), *singly, tuple(range(n))]:
        yield tuple("next" if i in moved else "previous" for i in range(n))
