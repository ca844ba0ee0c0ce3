"""python -m psdmc.bench [NAME ...] [--rounds N] [--json FILE]: measure the standard robots."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from psdmc.atomic import write_whole
from psdmc.bench.cases import standard_cases
from psdmc.bench.defaults import ROUNDS
from psdmc.bench.rivals import EVERYONE
from psdmc.bench.run import Settings, run
from psdmc.bench.scaling import scaling_cases
from psdmc.bench.table import as_text
from psdmc.errors import exit_status_of

START = time.perf_counter()


def main() -> int:
    """Run the benchmark as the command line says; the exit status."""
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
    cases = list(standard_cases(options.names or None, progress=_tell))
    scaling = list(scaling_cases(progress=_tell)) if full and not options.names else []
    result = run(cases, settings, _tell, scaling)
    print(as_text(result))
    if options.json:
        write_whole(options.json, result.to_json())
    return 1 if result.wrong else 0


def _tell(message: str) -> None:
    print(f"{time.perf_counter() - START:6.0f} s  {message}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
