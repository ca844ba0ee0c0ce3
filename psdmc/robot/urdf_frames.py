"""Links of a URDF as named frames: the link of the chain that each is fixed to, and its place there."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from psdmc.errors import InputError
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import Joint, NamedFrame
from psdmc.robot.tree import Route, listed
from psdmc.robot.urdf import UrdfJoint, UrdfRobot
from psdmc.robot.urdf_bodies import place_of


def urdf_frames(
    robot: UrdfRobot,
    route: Route,
    joints: Sequence[Joint],
    tip: NamedFrame,
    names: Iterable[str],
    source: str,
) -> tuple[NamedFrame, ...]:
    """The named links, placed by the file's own numbers; the tip as in the chain.

    InputError where a link does not exist, does not move, or is not rigidly on one of the chain's links.
    """
    carriers = {joint.name: number for number, joint in enumerate(joints)}
    return tuple(
        tip if name == tip.name else _placed(robot, route, joints, carriers, name, source) for name in names
    )


def _placed(
    robot: UrdfRobot, route: Route, joints: Sequence[Joint], carriers: dict[str, int], name: str, source: str
) -> NamedFrame:
    if name not in robot.inertials:
        raise InputError(
            f"{source}: frame {shown(name)} is no link of the file",
            f"links that can be frames: {listed(_rigid(robot, carriers))}",
        )
    fixed, carrier = _carried_by(robot, name)
    if carrier is None:
        raise InputError(
            f"{source}: frame {shown(name)} is fixed to the root: no joint moves it",
            f"links that can be frames: {listed(_rigid(robot, carriers))}",
        )
    if carrier.name not in carriers:
        above = carrier in route.to_base
        where = "above the base" if above else f"not between '{route.base}' and the tip '{route.tip}'"
        raise InputError(
            f"{source}: frame {shown(name)} moves with joint '{carrier.name}', which is {where}: it is on no link of the "
            "chain",
            f"choose another --tip or --base, or one of {listed(_rigid(robot, carriers))}",
        )
    number = carriers[carrier.name]
    place = joints[number].link_frame
    for joint in fixed:
        place = place @ place_of(joint)
    return NamedFrame(name, number, place)


def _carried_by(robot: UrdfRobot, link: str) -> tuple[list[UrdfJoint], UrdfJoint | None]:
    """Fixed joints from the link that a joint moves down to this link, and that joint; None at the root."""
    above = {joint.child: joint for joint in robot.joints}
    fixed: list[UrdfJoint] = []
    while link in above and not above[link].is_movable:
        fixed.append(above[link])
        link = above[link].parent
    return fixed[::-1], above.get(link)


def _rigid(robot: UrdfRobot, carriers: dict[str, int]) -> list[str]:
    """The links that may be frames."""
    found = []
    for link in robot.inertials:
        _, carrier = _carried_by(robot, link)
        if carrier is not None and carrier.name in carriers:
            found.append(link)
    return found
