"""An estimate of the operations that a change of carriers saves, from the changed branches of a robot's tree alone.
Carriers are the link parameters that are not set to zero in generated code.

In a tree, the cost of a function is nearly a sum over branches. For large robots, the search first traces (records on
symbols) only the branches that a change affects and the bodies that carry them, before and after the change. It traces
the whole robot only if these branches become cheaper. For talos, 9 to 11 of 33 joints are traced.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from psdmc.dynamics.frames import BASE, Frame, part_of, with_carriers
from psdmc.lower.factored import Arrangement, RobotConstants
from psdmc.lower.reframe import Reframed
from psdmc.recipes.recipe import Recipe
from psdmc.robot.limbs import Limbs
from psdmc.robot.mechanism import PARAMETERS_PER_LINK

LARGE = 10
"""Joints. Each trial of a larger robot takes longer, so that fewer are made, and less of what they can change is tried."""

MANY = 20
"""Joints of a robot with parameters at run time from which on branches are traced first. What an exchange changes in how all
carriers follow from theta_b is not told by branches: on quadrupeds that is what decides."""

WORTH = 0.7
"""Share of a robot's joints up to which its part is traced first."""


@dataclass(frozen=True, slots=True)
class Branches:
    """Parts of one robot."""

    robot: RobotConstants

    def changed(
        self, recipe: Recipe, before: Arrangement, behind: Arrangement, groups: Sequence[Limbs] = ()
    ) -> tuple[int, ...] | None:
        """Return the joints of the branches in which two forms of the code differ, with all joints between these
        branches and the base. Both forms have equal link frames, but different nonzero link parameters (carriers).

        Return None if these are most of the robot's joints, if the robot is small, or if the function cannot be
        computed for a part of the robot.

        groups  groups of limbs: if a joint of one limb is in the result, the joints at its place in the other limbs
                are, too
        """
        frames = before.reframed.frames
        is_told = self.robot.theta_b is not None or len(frames) >= MANY
        if len(frames) <= LARGE or not is_told or not recipe.in_limbs:
            return None
        carriers = set(before.carriers) ^ set(behind.carriers)
        found = around(frames, {carrier // PARAMETERS_PER_LINK for carrier in carriers})
        for limbs in groups:
            places = {k for limb in limbs for k, joint in enumerate(limb) if joint in found}
            found = tuple(sorted({*found, *(limb[k] for limb in limbs for k in places)}))
        found = with_carriers(frames, found)
        return found if len(found) <= WORTH * len(frames) else None

    def part(self, whole: Arrangement, kept: tuple[int, ...]) -> tuple[Arrangement, RobotConstants]:
        """Return an arrangement (frames, nonzero parameters, recursion options) for a robot that has only the joints
        `kept`, and the constants of this robot."""
        number = {joint: i for i, joint in enumerate(kept)}
        links = [divmod(carrier, PARAMETERS_PER_LINK) for carrier in whole.carriers]
        rows = [row for row, (joint, _) in enumerate(links) if joint in number]
        carriers = tuple(PARAMETERS_PER_LINK * number[links[row][0]] + links[row][1] for row in rows)
        reframed = _part_of(whole.reframed, kept)
        joints = [frame.joint for frame in reframed.frames if frame.mimic is None]
        old = self.robot.sizes
        sizes = replace(old, n=len(kept), nq=sum(j.nq for j in joints), nv=sum(j.nv for j in joints))
        arrangement = replace(whole, reframed=reframed, carriers=carriers, transfer=whole.transfer[rows])
        return arrangement, replace(self.robot, sizes=sizes)


def around(frames: Sequence[Frame], joints: Iterable[int]) -> tuple[int, ...]:
    """Return each given joint, all joints that carry it, and one limb that it carries, as joint numbers in ascending
    order. One limb is enough to make use of the values that a body computes for its limbs."""
    children: dict[int, list[int]] = {i: [] for i in range(BASE, len(frames))}
    for i, frame in enumerate(frames):
        children[frame.parent].append(i)
    kept: set[int] = set()
    for joint in joints:
        while joint != BASE and children[joint]:
            joint = children[joint][0]
        while joint != BASE:
            kept.add(joint)
            joint = frames[joint].parent
    return tuple(sorted(kept))


def limbs_in(groups: Sequence[Limbs], kept: tuple[int, ...]) -> tuple[Limbs, ...]:
    """Return the groups of limbs, restricted to the joints in `kept`. Joints are numbered by their position in
    `kept`."""
    number = {joint: i for i, joint in enumerate(kept)}
    left = (
        tuple(tuple(number[joint] for joint in limb if joint in number) for limb in limbs) for limbs in groups
    )
    return tuple(limbs for limbs in left if limbs[0])


@lru_cache(maxsize=256)
def _part_of(whole: Reframed, kept: tuple[int, ...]) -> Reframed:
    places = tuple(whole.link_frames[joint] for joint in kept)
    return replace(
        whole, frames=part_of(whole.frames, kept), link_frames=places, named=(), loops=(), tip_body=0
    )
