"""python -m psdmc.bench [NAME ...] [--rounds N] [--json FILE]: time psdmc's functions and other libraries' on standard
robots."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from psdmc.bench import ROUNDS
from psdmc.bench.case import Case, generic_chain
from psdmc.bench.cases import bundled_chain, derive_fresh, first_joints, standard_cases
from psdmc.bench.results import as_text
from psdmc.bench.rivals import EVERYONE
from psdmc.bench.run import Settings, run
from psdmc.errors import exit_status_of
from psdmc.files import write_whole
from psdmc.progress import Progress, on_standard_error
from psdmc.robot.joints import REVOLUTE
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, Joint, Mechanism, Placement, serial_parents

JOINTS = (2, 3, 4, 5, 6, 7, 8)
SEED = 8


def main() -> int:
    """Run the benchmark with the options of the command line, and return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m psdmc.bench", description=__doc__)
    parser.add_argument("names", nargs="*", help="standard robots; all where none is named")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="trials that count (default %(default)s)")
    parser.add_argument(
        "--rivals", nargs="+", choices=[entrant.name for entrant in EVERYONE], help="whom to measure"
    )
    parser.add_argument("--quick", action="store_true", help="no instruction counts, no threads, no scaling")
    parser.add_argument("--cold", action="store_true", help="single calls after sweeping the caches, too")
    parser.add_argument("--json", type=Path, help="write everything measured there")
    options = parser.parse_args()
    return exit_status_of(lambda: _measure(options))


def _measure(options: argparse.Namespace) -> int:
    """Measure, print the table and write the JSON; 1 where a contestant's results are wrong."""
    rivals = tuple(options.rivals) if options.rivals else None
    full = not options.quick
    settings = Settings(
        rounds=options.rounds, rivals=rivals, count=full, threads=full, cold=full or options.cold
    )
    cases = list(standard_cases(options.names or None, progress=on_standard_error))
    scaling = list(scaling_cases(on_standard_error)) if full and not options.names else []
    result = run(cases, settings, on_standard_error, scaling)
    print(as_text(result))
    if options.json:
        write_whole(options.json, result.to_json())
    return 1 if result.wrong else 0


def scaling_cases(progress: Progress) -> Iterator[Case]:
    """Yield the KUKA LBR with different numbers of joints, as benchmark robots that show how times grow with the
    joints. Each model is derived in a new process."""
    longest = generic_chain(eight_joints(bundled_chain("LBR7")), SEED)
    for n in JOINTS:
        progress(f"LBR with {n} joints: deriving")
        chain = longest if n == 8 else generic_chain(first_joints(bundled_chain("LBR7"), n), SEED)
        found = derive_fresh(chain)
        note = f"LBR7 geometry, generic physical inertias, seed {SEED}"
        yield Case(f"LBR {n} joints", found.model, note, found.seconds, found.peak_bytes)


def eight_joints(lbr: Mechanism) -> Mechanism:
    """Return the seven-joint LBR with an eighth joint before its last one (standard DH: a 0, alpha -pi/2, d 0.2 m)."""
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


if __name__ == "__main__":
    sys.exit(main())
