"""Finds equal limbs of a robot, such as legs: branches on one body with the same joint structure."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

from psdmc.robot.mechanism import BASE

Limbs = tuple[tuple[int, ...], ...]
"""Limb by limb its joints, parents before children; those at one place of all limbs correspond to each other."""


def limb_groups(parents: Sequence[int], labels: Sequence[Hashable]) -> tuple[Limbs, ...]:
    """Return the groups of two or more equal limbs (branches such as legs) on one body, those nearest to the base
    first. Each limb is a tuple of joints.

    parents  parent of each body: BASE or an earlier body
    labels   a label for each joint; joints of equal limbs must have equal labels

    If a limb itself carries equal branches, such as fingers of a hand, these are not returned as a further group.
    """
    tree = _Tree(parents, labels)
    groups: list[Limbs] = []
    bodies = [BASE]
    while bodies:
        alike: dict[int, list[int]] = {}
        for child in tree.children[bodies.pop(0)]:
            alike.setdefault(tree.shapes[child], []).append(child)
        for branches in alike.values():
            if len(branches) > 1:
                groups.append(tuple(tree.joints(branch) for branch in branches))
            else:
                bodies += branches
    return tuple(groups)


class _Tree:
    """Children of each body, and a number for the shape of what lies beyond it."""

    def __init__(self, parents: Sequence[int], labels: Sequence[Hashable]) -> None:
        self.children: dict[int, list[int]] = {i: [] for i in range(BASE, len(parents))}
        for i, parent in enumerate(parents):
            self.children[parent].append(i)
        self.shapes: dict[int, int] = {}
        known: dict[Hashable, int] = {}
        for i in reversed(range(len(parents))):
            shape = (labels[i], tuple(sorted(self.shapes[child] for child in self.children[i])))
            self.shapes[i] = known.setdefault(shape, len(known))

    def joints(self, branch: int) -> tuple[int, ...]:
        """Return the joints of a branch, in an order that is the same for branches of equal structure."""
        found = [branch]
        for child in sorted(self.children[branch], key=lambda child: (self.shapes[child], child)):
            found += self.joints(child)
        return tuple(found)
