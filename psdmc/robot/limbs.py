"""Limbs of equal structure in a tree: branches on one body whose joints are alike, one by one."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

from psdmc.robot.mechanism import BASE

Limbs = tuple[tuple[int, ...], ...]
"""Limb by limb its joints, parents before children; those at one place of all limbs correspond to each other."""


def limb_groups(parents: Sequence[int], labels: Sequence[Hashable]) -> tuple[Limbs, ...]:
    """The groups of two or more limbs on one body, next to the base first; within limbs there are no further groups.

    parents  of each body, BASE or an earlier one
    labels   joints with different ones do not correspond
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
        """A branch's joints in an order that depends on shapes alone."""
        found = [branch]
        for child in sorted(self.children[branch], key=lambda child: (self.shapes[child], child)):
            found += self.joints(child)
        return tuple(found)
