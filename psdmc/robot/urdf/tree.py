"""Selects joints of a URDF: its whole tree, or the chain from a base link to a tip link."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from psdmc.errors import InputError
from psdmc.robot.joints import URDF_TYPES
from psdmc.robot.limits import MAX_JOINTS, listed, shown
from psdmc.robot.urdf.read_urdf import LOCKABLE, MOVABLE, UrdfJoint, UrdfRobot

BALLS = ("spherical", "ball")
"""Types that no standard of URDF has, and some writers use."""

BALL = "a URDF has no joint about every axis: write it as three revolute ones through one point"


@dataclass(frozen=True, slots=True)
class Route:
    """The joints of a URDF that a model contains, with the fixed joints between them. `to_base` is the path from the
    root to the base link, `path` that from the base link to the tip.

    ends   end links if `path` is the whole tree; empty for a chain. The joints of a tree are in the order of
           Pinocchio's buildModelFromUrdf: branch by branch, and by name if they are on the same link
    """

    base: str
    tip: str
    to_base: tuple[UrdfJoint, ...]
    path: tuple[UrdfJoint, ...]
    notes: tuple[str, ...]
    ends: tuple[str, ...] = ()

    @property
    def movable(self) -> tuple[UrdfJoint, ...]:
        return tuple(joint for joint in self.path if joint.is_movable)


def find_route(
    robot: UrdfRobot, base: str | None, tip: str | None, source: str, frames: Sequence[str] = ()
) -> Route:
    """Return the joints from the base link (default: the root) to the tip link (default: see default_tip).

    If neither link is given and the joints branch, return the whole tree. The tip of a tree is the first of `frames`,
    or of the end links. Raises InputError if a link is unknown, the tip is not below the base, no joint moves, or psdmc
    cannot model a joint.
    """
    for role, link in (("base", base), ("tip", tip)):
        if link is not None and link not in robot.inertials:
            raise InputError(
                f"{source}: {role} link '{link}' does not exist", f"links: {listed(robot.inertials)}"
            )
    is_tree = base is None and tip is None and len(_last_joints(robot)) > 1
    route = _tree(robot, frames, source) if is_tree else _chain(robot, base, tip, source)
    where = "" if route.ends else f" from '{route.base}' to '{route.tip}'"
    if len(route.movable) > MAX_JOINTS:
        raise InputError(
            f"{source}: {len(route.movable)} movable joints{where}, psdmc reads at most {MAX_JOINTS}",
            "choose a shorter chain with --base and --tip",
        )
    if not route.movable:
        raise InputError(
            f"{source}: no movable joint between '{route.base}' and '{route.tip}'",
            "choose other --base or --tip",
        )
    _refuse_unsupported(robot, route, source)
    _refuse_other_planes(route, source)
    return replace(route, notes=(*route.notes, *_locked_note(robot, route)))


def _chain(robot: UrdfRobot, base: str | None, tip: str | None, source: str) -> Route:
    start = robot.root if base is None else base
    end, notes = (tip, ()) if tip is not None else default_tip(robot, start, source)
    path = joints_between(robot, start, end)
    if path is None:
        above = " but above it" if joints_between(robot, end, start) is not None else ""
        fault = f"{source}: tip link '{end}' is not below base link '{start}'{above}"
        raise InputError(fault, _way_out(robot, start, end))
    return Route(start, end, joints_between(robot, robot.root, start) or (), path, notes)


def _tree(robot: UrdfRobot, frames: Sequence[str], source: str) -> Route:
    path = tuple(outward(robot))
    last = _last_joints(robot)
    ends = tuple(_fixed_end(robot, joint.child) for joint in path if joint in last)
    moved: set[str] = set()
    for joint in path:
        if joint.is_movable or joint.parent in moved:
            moved.add(joint.child)
    tip = next((name for name in frames[:1] if name in moved), ends[0])
    return Route(robot.root, tip, (), path, (_whole_note(robot, ends, source),), ends)


def outward(robot: UrdfRobot) -> Iterator[UrdfJoint]:
    """Yield all joints from the root outward, branch by branch; joints on the same link are sorted by name."""
    stack, above = [robot.root], robot.above
    below: dict[str, list[UrdfJoint]] = {}
    for joint in robot.joints:
        below.setdefault(joint.parent, []).append(joint)
    while stack:
        link = stack.pop()
        if link in above:
            yield above[link]
        stack += [j.child for j in sorted(below.get(link, []), key=lambda j: j.name, reverse=True)]


def _last_joints(robot: UrdfRobot) -> list[UrdfJoint]:
    """Movable joints beyond which nothing moves, in the file's order."""
    above, carrying = robot.above, set[str]()
    for joint in robot.joints:
        link = joint.parent
        while joint.is_movable and link in above and link not in carrying:
            carrying.add(link)
            link = above[link].parent
    return [joint for joint in robot.joints if joint.is_movable and joint.child not in carrying]


def _whole_note(robot: UrdfRobot, ends: Sequence[str], source: str) -> str:
    """Describe the tree, and the options for earlier releases' chain, unless its root is free."""
    if robot.root_joint is not None:
        return f"the whole tree, to its ends {listed(ends)}"
    try:
        before = f", as --tip {shlex.quote(default_tip(robot, robot.root, source)[0])}"
    except InputError:
        before = ""
    return f"the whole tree, to its ends {listed(ends)}; --tip LINK takes one chain of it{before}"


def _way_out(robot: UrdfRobot, start: str, end: str) -> str:
    if joints_between(robot, end, start) is not None:
        return f"a chain runs from its base to its tip: swap them, --base '{end}' --tip '{start}'"
    below = [link for link in _movable_depths(robot, start) if link != start]
    return (
        f"links below '{start}': {listed(below)}"
        if below
        else f"no link is below '{start}': choose another --base"
    )


def joints_between(robot: UrdfRobot, start: str, end: str) -> tuple[UrdfJoint, ...] | None:
    """Return the joints from link `start` outward to link `end`; None if `end` is not beyond `start`."""
    above, path, link = robot.above, list[UrdfJoint](), end
    while link != start:
        if link not in above:
            return None
        path.append(above[link])
        link = above[link].parent
    return tuple(reversed(path))


def default_tip(robot: UrdfRobot, base: str, source: str) -> tuple[str, tuple[str, ...]]:
    """Return the name of the link at the end of the path with most movable joints. Return a note, too, if several ends
    were possible.

    If several paths have equally many joints, like the fingers of a gripper, the tip is the link where they branch.
    That link must have more movable joints before it than each path has after it. Otherwise the function raises an
    InputError that lists the ends.
    """
    depth = _movable_depths(robot, base)
    most = max(depth.values())
    ends = [
        j.child for j in robot.joints if j.is_movable and depth.get(j.child) == most and j.parent in depth
    ]
    if most == 0:
        raise InputError(
            f"{source}: no movable joint below link '{base}'", f"joint types: {', '.join(MOVABLE)}"
        )
    if len(ends) == 1:
        return _fixed_end(robot, ends[0]), ()
    parting = _parting_link(robot, base, ends)
    if depth[parting] <= most - depth[parting]:
        raise InputError(f"{source}: several chains end in {listed(ends)}", "choose one with --tip LINK")
    note = f"tip '{parting}': there the chain parts towards {listed(ends)}; --tip chooses another"
    return parting, (note,)


def _movable_depths(robot: UrdfRobot, base: str) -> dict[str, int]:
    """Links from base down, each with the number of movable joints above it."""
    depth = {base: 0}
    queue = [base]
    while queue:
        link = queue.pop(0)
        for joint in robot.joints_below(link):
            depth[joint.child] = depth[link] + joint.is_movable
            queue.append(joint.child)
    return depth


def _fixed_end(robot: UrdfRobot, link: str) -> str:
    """The far end of the longest sequence of fixed joints (tool flanges); of equally long ones the file's first. Links that
    are shapes for collisions alone, such as those along the calf of Unitree's Go2, are no ends."""
    distance = {link: 0}
    queue = [link]
    while queue:
        here = queue.pop(0)
        for joint in robot.joints_below(here):
            if not joint.is_movable:
                distance[joint.child] = distance[here] + 1
                queue.append(joint.child)
    return max(
        (name for name in distance if name == link or name not in robot.shapes), key=distance.__getitem__
    )


def _parting_link(robot: UrdfRobot, base: str, ends: Sequence[str]) -> str:
    """The last link that the paths from base to all of the ends share."""
    paths = [[joint.child for joint in joints_between(robot, base, end) or ()] for end in ends]
    shared = base
    for links in zip(*paths, strict=False):
        if any(link != links[0] for link in links):
            break
        shared = links[0]
    return shared


def _refuse_other_planes(route: Route, source: str) -> None:
    """InputError for joints whose <axis> programs understand in different ways."""
    problems = []
    for joint in route.movable:
        only, length = URDF_TYPES[joint.type].only_axis, math.hypot(*joint.axis)
        if only is not None and any(x != length * a for x, a in zip(joint.axis, only, strict=True)):
            axis = " ".join(f"{x:g}" for x in joint.axis)
            problems.append(f"joint {shown(joint.name)} of type {shown(joint.type)} has <axis> {axis}")
    if problems:
        raise InputError(
            f"{source}: {'; '.join(problems)}: the plane's normal by the standard, where other readers always take z",
            'write <axis xyz="0 0 1"/>, and turn the plane by rpy of its <origin>',
        )


def _refuse_unsupported(robot: UrdfRobot, route: Route, source: str) -> None:
    on_chain = {joint.name for joint in route.movable}
    problems = [
        f"joint '{joint.name}': type {shown(joint.type)} is not supported"
        for joint in robot.joints
        if joint.type not in (*MOVABLE, "fixed") and (joint.name in on_chain or joint.type not in LOCKABLE)
    ]
    if problems:
        can_cut = route.ends and robot.root_joint is None
        cut = "; --tip LINK takes one chain of the tree" if can_cut else ""
        ball = f"; {BALL}" if any(joint.type in BALLS for joint in robot.joints) else ""
        hint = f"psdmc models {', '.join(MOVABLE)} and fixed joints{ball}{cut}"
        raise InputError(f"{source}: " + "; ".join(problems), hint)


def _locked_note(robot: UrdfRobot, route: Route) -> tuple[str, ...]:
    on_chain = [joint.name for joint in route.movable]
    locked = [joint.name for joint in robot.joints if joint.is_movable and joint.name not in on_chain]
    if not locked:
        return ()
    names = listed(locked, len(locked))
    return (f"locked at zero, their bodies counted where they move with the chain: {names}",)
