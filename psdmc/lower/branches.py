"""Estimate of the operations that an exchange of carriers saves, from the branches of a tree that it changes.

The cost of a function of a tree is nearly a sum over its branches; the bodies that carry them add what branches share. The
search of a large robot therefore traces the changed branches with these bodies alone, before and after the exchange, and
traces the whole robot only where that is cheaper: 9 to 11 of talos's 33 joints are traced.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from psdmc.dynamics.frames import BASE, Frame, part_of, with_carriers
from psdmc.lower.factored import Arrangement, RobotConstants
from psdmc.lower.geometry import LARGE
from psdmc.lower.reframe import Reframed
from psdmc.recipes.recipe import Recipe
from psdmc.robot.limbs import Limbs
from psdmc.robot.mechanism import PARAMETERS_PER_LINK

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
        """Joints of the branches that two arrangements of one geometry differ in, and of the bodies that carry them; None
        where that is most of the robot, or of a small one, or where a part of it is no robot for the function.

        groups   limbs of which the same joints are kept
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
        """The arrangement of these joints alone, and the constants of a robot of them."""
        number = {joint: i for i, joint in enumerate(kept)}
        links = [divmod(carrier, PARAMETERS_PER_LINK) for carrier in whole.carriers]
        rows = [row for row, (joint, _) in enumerate(links) if joint in number]
        carriers = tuple(PARAMETERS_PER_LINK * number[links[row][0]] + links[row][1] for row in rows)
        reframed = _part_of(whole.reframed, kept)
        joints = [frame.joint for frame in reframed.frames if frame.follows is None]
        old = self.robot.sizes
        sizes = replace(old, n=len(kept), nq=sum(j.nq for j in joints), nv=sum(j.nv for j in joints))
        arrangement = replace(whole, reframed=reframed, carriers=carriers, transfer=whole.transfer[rows])
        return arrangement, replace(self.robot, sizes=sizes)


def around(frames: Sequence[Frame], joints: Iterable[int]) -> tuple[int, ...]:
    """Return the limb of each of these joints, and all joints that carry it, ascending. Of a body that carries several
    limbs the first one: what limbs take from it is needed anyway."""
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
    """The groups as far as their limbs are among these joints, which are numbered anew."""
    number = {joint: i for i, joint in enumerate(kept)}
    left = (
        tuple(tuple(number[joint] for joint in limb if joint in number) for limb in limbs) for limbs in groups
    )
    return tuple(limbs for limbs in left if limbs[0])


@lru_cache(maxsize=256)
def _part_of(whole: Reframed, kept: tuple[int, ...]) -> Reframed:
    places = tuple(whole.link_frames[joint] for joint in kept)
    return replace(whole, frames=part_of(whole.frames, kept), link_frames=places, named=(), tip_body=0)
