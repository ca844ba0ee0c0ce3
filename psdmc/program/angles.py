"""The angles (arguments of sines and cosines) of a PROGRAM, a list of scalar operations. They are grouped by which can
be computed together, and what must be computed before."""

from __future__ import annotations

from psdmc.program.program import Op, Program

TRIGONOMETRIC = frozenset((Op.SIN, Op.COS))


def angle_groups(program: Program) -> list[list[int]]:
    """Return the angles (arguments of sines and cosines) in groups. The angles of a group can be computed together,
    because they depend on sines and cosines of earlier groups only."""
    first = next((i for i, (op, _, _, _) in enumerate(program.body) if op in TRIGONOMETRIC), None)
    if first is None:  # as in most parts of a long PROGRAM
        return []
    level = [0] * first
    groups: dict[int, dict[int, None]] = {}
    for op, args, _, _ in program.body[first:]:
        below = max([level[a] for a in args]) if args else 0
        is_trig = op in TRIGONOMETRIC
        if is_trig:
            groups.setdefault(below, {})[args[0]] = None
        level.append(below + 1 if is_trig else below)
    return [list(groups[key]) for key in sorted(groups)]


def cone(program: Program, roots: list[int]) -> list[int]:
    """Return the given values `roots` and all values on which they depend, in the PROGRAM's order."""
    needed = [False] * len(program)
    for root in roots:
        needed[root] = True
    for i in reversed(range(max(roots) + 1)):
        if needed[i]:
            for a in program.body[i].args:
                needed[a] = True
    return [i for i, wanted in enumerate(needed) if wanted]


def angles_first(program: Program) -> list[list[int]]:
    """Return all values of the PROGRAM once, each after its arguments. There is one list per group of angles (see
    `angle_groups`), and one for the rest.

    The list of a group contains the values from which the angles are computed, then the sines and cosines of the
    angles.
    """
    taken: dict[int, list[int]] = {}
    for i, (op, args, _, _) in enumerate(program.body):
        if op in TRIGONOMETRIC:
            taken.setdefault(args[0], []).append(i)
    done = [False] * len(program)
    found = []
    for group in angle_groups(program):
        wanted = [*cone(program, group), *(i for angle in group for i in taken[angle])]
        found.append([i for i in wanted if not done[i]])
        for i in wanted:
            done[i] = True
    return [*found, [i for i in range(len(program)) if not done[i]]]
