"""The command `psdmc show` for a robot file."""

from __future__ import annotations

import math
import shlex

from psdmc.cli.show import followed, position_range
from psdmc.cli.tables import Table, print_line, print_note, print_table
from psdmc.errors import InputError
from psdmc.robot.coordinates import leaders
from psdmc.robot.derivable import require_derivable
from psdmc.robot.mechanism import Mechanism


def print_mechanism(found: Mechanism) -> None:
    """Print a robot file's bodies, what each hangs on and follows, and whether psdmc derives it."""
    count, own = len(found), len(leaders(found.coordinates))
    shape = "a serial chain" if found.is_serial else f"a tree with {len(found.leaves)} ends"
    print_line(f"{found.name}: {shape} of {count} joints with {own} coordinates, from {found.base_name}")
    print()
    print_table(_bodies(found))
    print()
    for note in found.notes:
        print_note(note)
    refused = why_not_derived(found)
    if refused is not None:
        print_line(f"not derived as a whole: {refused}")
        print_line(f"hint: {refused.hint}")
    for leaf in found.leaves if len(found.leaves) > 1 else ():
        moving = len(found.path_to(leaf))
        print_line(f"--tip {shlex.quote(found.joints[leaf].link_name)}: {moving} joints")


def why_not_derived(found: Mechanism) -> InputError | None:
    """The error with which a derivation of the whole robot would end, if any."""
    try:
        require_derivable(found)
    except InputError as refused:
        return refused
    return None


def _bodies(found: Mechanism) -> Table:
    rows = []
    for i, joint in enumerate(found.joints):
        limits = joint.limits
        rows.append(
            (
                joint.name,
                joint.link_name,
                found.parent_link(i),
                joint.type.word,
                followed(found, i),
                position_range(limits.lower, limits.upper, joint.type.position_unit),
                "unknown" if math.isnan(found.parameters[i, 0]) else f"{found.parameters[i, 0]:.6g} kg",
            )
        )
    return Table(("joint", "link", "hangs on", "type", "q", "position", "mass"), rows)
