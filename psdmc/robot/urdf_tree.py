"""Whether links and joints form a tree."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.robot.limits import shown

Ends = tuple[str, str, str]
"""A joint's name, its parent link and its child link."""

LISTED = 12
"""Largest number of links in a message."""


def tree_faults(links: Sequence[str], joints: Sequence[Ends]) -> list[str]:
    """The reasons why the links are not one tree, one sentence each."""
    known = dict.fromkeys(links)
    faults = []
    parents: dict[str, list[str]] = {}
    for name, parent, child in joints:
        for role, link in (("parent", parent), ("child", child)):
            if link not in known:
                faults.append(f"joint '{name}': {role} link {shown(link)} does not exist")
        parents.setdefault(child, []).append(name)
    for link, above in parents.items():
        if len(above) > 1:
            quoted = " and ".join(f"'{name}'" for name in above)
            faults.append(f"link '{link}' is the child of joints {quoted}: a loop")
    roots = [name for name in links if name not in parents]
    if not faults and len(roots) > 1:
        faults.append(f"links {_listed(roots)} all have no parent joint")
    return faults or _cycle_faults(links, joints, roots)


def _cycle_faults(links: Sequence[str], joints: Sequence[Ends], roots: Sequence[str]) -> list[str]:
    """Faults of links that no root reaches: they form a ring."""
    below: dict[str, list[str]] = {}
    for _, parent, child in joints:
        below.setdefault(parent, []).append(child)
    reached = dict.fromkeys(roots)
    queue = list(roots)
    while queue:
        for child in below.get(queue.pop(), []):
            reached[child] = None
            queue.append(child)
    ring = [name for name in links if name not in reached]
    return [f"links {_listed(ring)} form a loop"] if ring else []


def _listed(names: Sequence[str]) -> str:
    quoted = ", ".join(f"'{name}'" for name in names[:LISTED])
    return quoted + (f" and {len(names) - LISTED} more" if len(names) > LISTED else "")
