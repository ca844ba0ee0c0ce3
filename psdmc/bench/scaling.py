"""Cost against the number of joints: the LBR7 with fewer joints, and with an eighth joint before its last."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from psdmc.bench.case import Case, generic_chain
from psdmc.bench.cases import bundled_chain, first_joints
from psdmc.bench.fresh import derive_fresh
from psdmc.robot.joints import REVOLUTE
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, Joint, Mechanism, Placement, serial_parents

JOINTS = (2, 3, 4, 5, 6, 7, 8)
SEED = 8


def scaling_cases(
    joints: Sequence[int] = JOINTS, progress: Callable[[str], None] = lambda message: None
) -> Iterator[Case]:
    """One case per number of joints, each derived in a process of its own."""
    longest = generic_chain(eight_joints(bundled_chain("LBR7")), SEED)
    for n in joints:
        progress(f"LBR with {n} joints: deriving")
        chain = longest if n == 8 else generic_chain(first_joints(bundled_chain("LBR7"), n), SEED)
        found = derive_fresh(chain)
        note = f"LBR7 geometry, generic physical inertias, seed {SEED}"
        yield Case(f"LBR {n} joints", found.model, note, found.seconds, found.peak_bytes)


def eight_joints(lbr: Mechanism) -> Mechanism:
    """An eighth joint before the last: standard DH a 0, alpha -pi/2, d 0.2 (its own turn comes first)."""
    turn = Placement(
        np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]), np.array([0.0, 0.0, 0.2])
    )
    last = lbr.joints[-1]
    extra = Joint("joint_extra", "link_extra", REVOLUTE, last.placement, turn)
    joints = (*lbr.joints[:-1], extra, replace(last, placement=turn))
    rows = PARAMETERS_PER_LINK * len(joints)
    parameters = np.vstack([lbr.parameters[:-1], lbr.parameters[-1:], lbr.parameters[-1:]])
    return replace(
        lbr,
        joints=joints,
        parameters=parameters,
        parameter_span=np.eye(rows),
        parents=serial_parents(len(joints)),
        coordinates=(),
        tip_body=len(joints) - 1,
    )
