"""Which mechanisms psdmc derives and lowers: trees whose joints have coordinates of their own or follow another's."""

from __future__ import annotations

from psdmc.errors import InputError
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import Mechanism


def require_derivable(chain: Mechanism) -> None:
    """InputError with a remedy where a joint is held: readers merge what does not move."""
    for joint, coordinate in zip(chain.joints, chain.coordinates, strict=True):
        if coordinate.leader is None:
            raise InputError(
                f"{shown(chain.name)}: joint {shown(joint.name)} is held at {coordinate.offset:g}",
                "make it a fixed joint",
            )
