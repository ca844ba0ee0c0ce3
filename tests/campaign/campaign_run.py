"""The differential campaign: random robots through psdmc, Pinocchio and MuJoCo; worst errors and their robots.

python tests/campaign/campaign_run.py --robots 1000          the chains of seeds 0 to 999 and the usual trees
python tests/campaign/campaign_run.py --robots 1000:2000 --journal generated/campaign.jsonl
                                                             the next thousand, added to what that file holds
python tests/campaign/campaign_run.py --robots 0 --trees 100 the trees of seeds 1,000,000 to 1,000,099 alone
python tests/campaign/campaign_run.py --robots 0 --trees 0 --contacts 300
                                                             robots with contacts and loops, seeds 2,000,000 to 2,000,299
python tests/campaign/campaign_run.py --lowered-only         those of them alone that are lowered and compiled
python tests/campaign/campaign_run.py --seed 52 --urdf       one robot again, all its errors and its file
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1])]

from campaign_contacts import STATES as CONTACT_STATES  # noqa: E402
from campaign_draw import FIRST_CONTACTS, FIRST_TREE, described, robot_of  # noqa: E402
from campaign_journal import Outcome, append, read, report, summary  # noqa: E402
from campaign_measure import failures, limit_of, measured  # noqa: E402

from psdmc.toolchain.cache_room import cache_contents, clear_cache  # noqa: E402

ROBOTS, TREES, CONTACTS, STATES, LOWERED_EVERY = 10_000, 1_000, 300, 1_000, 50

MOST_ENTRIES = 300
"""Of a process's compile cache."""

CHUNK = 4
"""Robots handed to a process at once."""


def outcome(seed: int, states: int, every: int, commit: str) -> Outcome:
    """Errors of one robot, or what psdmc raised, as plain JSON values."""
    started = time.process_time()
    _tidy_cache()
    lowered = is_lowered(seed, every)
    states = states if seed < FIRST_CONTACTS else CONTACT_STATES
    one: Outcome = {"seed": seed, "commit": commit, "count": states, "lowered": lowered}
    one["mixed"] = robot_of(seed).is_mixed
    try:
        found = measured(seed, states, lowered=lowered)
    except Exception as raised:  # whatever a robot makes psdmc raise is a finding, and the campaign goes on
        one["raised"] = f"{type(raised).__name__}: {raised}"
    else:
        one |= {"states": found.states, "errors": found.errors, "failed": sorted(failures(found.errors))}
        one |= {"refused": found.refused} if found.refused else {}
    return one | {"cpu": round(time.process_time() - started, 3)}


def _own_cache() -> None:
    """Of this process, within the folder that is thrown away at the end."""
    os.environ["PSDMC_CACHE_DIR"] += f"-{os.getpid()}"


def _tidy_cache() -> None:
    """Empty this process's cache now and then: no robot comes twice, and each build looks through all entries."""
    if cache_contents().entries > MOST_ENTRIES:
        clear_cache()


def is_lowered(seed: int, every: int) -> bool:
    """Robots with contacts, and one other robot in `every`, at another place in each such block, so that robots of every
    kind are among them."""
    return seed >= FIRST_CONTACTS or (every > 0 and seed % every == seed // every % every)


def outcomes(seeds: Sequence[int], states: int, every: int, jobs: int, commit: str) -> Iterator[Outcome]:
    one = partial(outcome, states=states, every=every, commit=commit)
    if jobs == 1:
        yield from map(one, seeds)
        return
    with ProcessPoolExecutor(jobs, initializer=_own_cache) as pool:
        yield from pool.map(one, seeds, chunksize=CHUNK)


def one_robot(seed: int, states: int, with_urdf: bool) -> int:
    robot = robot_of(seed)
    print(f"seed {seed}: {described(robot)}")
    if with_urdf:
        print(robot.text)
    found = measured(seed, states, lowered=True)
    for what, error in found.errors.items():
        print(f"{what:70} {error:.2e}{'' if error <= limit_of(what) else '   FAILS'}")
    for name, refusal in found.refused.items():
        print(f"{name}: refused: {refusal}")
    return 1 if failures(found.errors) else 0


def seed_range(text: str) -> range:
    """'A:B' are the seeds from A up to but not B, 'N' the first N."""
    first, _, last = text.rpartition(":")
    return range(int(first or 0), int(last))


def this_commit() -> str:
    """As git has it; 'unknown' outside a checkout."""
    command = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty", "--exclude=*"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--robots", type=seed_range, default=range(ROBOTS), help="seeds of chains: N or A:B")
    add("--trees", type=seed_range, default=range(TREES), help=f"trees by seed less {FIRST_TREE:,}: N or A:B")
    add(
        "--contacts",
        type=seed_range,
        default=range(CONTACTS),
        help=f"by seed less {FIRST_CONTACTS:,}: N or A:B",
    )
    add("--states", type=int, default=STATES, help="random states of each robot")
    add("--lowered-every", type=int, default=LOWERED_EVERY, help="lower and compile one in so many; 0: none")
    add("--lowered-only", action="store_true", help="those robots alone")
    add("--jobs", type=int, default=os.cpu_count() or 1)
    add("--journal", type=Path, help="file of outcomes: seeds that it holds are not run again")
    add("--json", type=Path, help="where to write the figures of all that the journal holds")
    add("--commit", default=this_commit(), help="what the journal says was run")
    add("--seed", type=int, help="this robot alone, with everything lowered and compiled")
    add("--urdf", action="store_true", help="print that robot's file")
    return parser.parse_args()


def main() -> int:
    chosen = arguments()
    # Kernels found with a short search must not stay in the user's cache.
    with tempfile.TemporaryDirectory() as folder:
        os.environ["PSDMC_CACHE_DIR"] = str(Path(folder) / "cache")
        if chosen.seed is not None:
            return one_robot(chosen.seed, chosen.states, chosen.urdf)
        journal = chosen.journal or Path(folder) / "journal"
        _run(chosen, journal)
        result = summary(read(journal).values())
    print(report(result))
    if chosen.json:
        chosen.json.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    return 1 if result["raised"] or result["failed"] else 0


def _run(chosen: argparse.Namespace, journal: Path) -> None:
    known = read(journal)
    wanted = [
        *chosen.robots,
        *(FIRST_TREE + number for number in chosen.trees),
        *(FIRST_CONTACTS + number for number in chosen.contacts),
    ]
    seeds = [seed for seed in wanted if seed not in known]
    if chosen.lowered_only:
        seeds = [seed for seed in seeds if is_lowered(seed, chosen.lowered_every)]
    ran = outcomes(seeds, chosen.states, chosen.lowered_every, chosen.jobs, chosen.commit)
    for count, one in enumerate(ran, 1):
        append(journal, one)
        if "raised" in one or one["failed"]:
            print(one, flush=True)
        elif count % (10 if chosen.lowered_only else 100) == 0:
            print(f"{count} of {len(seeds)}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
