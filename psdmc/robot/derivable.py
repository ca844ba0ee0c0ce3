"""Which mechanisms psdmc derives, lowers and keeps in model files: serial chains only, so far."""

from __future__ import annotations

from psdmc.errors import InputError
from psdmc.robot.coordinates import Coordinate
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import BASE, Mechanism

CUT = "choose a chain in it with --base and --tip"
FREE = "make it a fixed joint, or leave out what it follows"


def require_derivable(chain: Mechanism) -> None:
    """InputError with a remedy unless the robot is a serial chain whose joints have a coordinate each."""
    fault = _fork(chain) or _inner_tip(chain)
    if fault is not None:
        raise InputError(f"{shown(chain.name)}: {fault}, and psdmc derives serial chains only", CUT)
    follower = _follower(chain)
    if follower is not None:
        raise InputError(f"{shown(chain.name)}: {follower}, and psdmc derives independent joints only", FREE)


def _fork(chain: Mechanism) -> str | None:
    """The first link, or base, that carries several joints."""
    for body in range(BASE, len(chain)):
        carried = [shown(chain.joints[i].name) for i, parent in enumerate(chain.parents) if parent == body]
        if len(carried) > 1:
            link = chain.base_name if body == BASE else chain.joints[body].link_name
            return f"link {shown(link)} carries joints {', '.join(carried[:-1])} and {carried[-1]}"
    return None


def _inner_tip(chain: Mechanism) -> str | None:
    if chain.tip_body in chain.leaves:
        return None
    return f"the tip is on link {shown(chain.joints[chain.tip_body].link_name)}, which carries other joints"


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
