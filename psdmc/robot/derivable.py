"""Checks whether psdmc can derive a model of a robot, whether each joint has one coordinate, and whether it has loops."""

from __future__ import annotations

from psdmc.errors import InputError
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import Mechanism

AXES = "hold this joint: derive the model with --lock JOINT=0"


def require_derivable(chain: Mechanism) -> None:
    """Raise InputError with a remedy if a joint of the mechanism is locked at a constant position. Readers of robot
    files merge the links of such joints."""
    for joint, coordinate in zip(chain.joints, chain.coordinates, strict=True):
        if coordinate.leader is None:
            raise InputError(
                f"{shown(chain.name)}: joint {shown(joint.name)} is held at {coordinate.offset:g}",
                "make it a fixed joint",
            )


def require_axes(chain: Mechanism, what: str) -> None:
    """Raise InputError if a joint of the robot has several coordinates, such as a ball joint.

    what  name of the operation that needs joints with one coordinate, such as "calibration"
    """
    wide = next((joint for joint in chain.joints if not joint.type.about_z), None)
    if wide is not None:
        raise InputError(
            f"{shown(chain.name)}: {what} is of joints of one coordinate each, and joint {shown(wide.name)}"
            f" {wide.type.verb}",
            "derive the model without a floating base" if chain.has_free_root else AXES,
        )


def require_no_loops(chain: Mechanism, what: str) -> None:
    """Raise InputError if the mechanism has closed loops, because its motors then also carry the forces of these loops.

    what  name of the operation that needs torques without such forces, such as "calibration"
    """
    if chain.loops:
        raise InputError(
            f"{shown(chain.name)}: {what} is of robots without closed loops: torques of its motors contain forces of loop "
            f"{shown(chain.loops[0].name)}",
            "fit model.loop_base_parameters to the logs yourself (docs/how-to/loops.md), or leave out follows = [] in a "
            "parallelogram",
        )
