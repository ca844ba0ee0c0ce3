"""Which mechanisms psdmc derives and lowers: trees of joints with a coordinate of their own, so far."""

from __future__ import annotations

from psdmc.errors import InputError
from psdmc.robot.coordinates import Coordinate
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import Mechanism

FREE = "make it a fixed joint, leave out what it follows, or take a chain without it: --tip LINK"


def require_derivable(chain: Mechanism) -> None:
    """InputError where a joint has no coordinate of its own; the hint is the remedy."""
    follower = _follower(chain)
    if follower is not None:
        raise InputError(f"{shown(chain.name)}: {follower}, and psdmc derives independent joints only", FREE)


def _follower(chain: Mechanism) -> str | None:
    """A sentence about the first joint without a coordinate of its own; None where all have one."""
    for i, coordinate in enumerate(chain.coordinates):
        name = f"joint {shown(chain.joints[i].name)}"
        if coordinate.leader is None:
            return f"{name} is held at {coordinate.offset:g}"
        if coordinate != Coordinate(i):
            leader = shown(chain.joints[coordinate.leader].name)
            return f"{name} follows joint {leader} ({coordinate.ratio:g} q + {coordinate.offset:g})"
    return None
