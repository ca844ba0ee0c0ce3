"""One process that runs inputs of one format until its budget is spent, by mutation or guided by coverage."""

from __future__ import annotations

import argparse
import contextlib
import faulthandler
import importlib
import pkgutil
import re
import shutil
import sys
import tempfile
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from random import Random

FRESH = 0.5
"""Share of libFuzzer's inputs that start from a good seed: what it keeps is small and mostly refused early."""

WANDERING = 0.15
"""Share of the others that libFuzzer mutates in its own way instead of by the format's structure."""

MOST_KEPT = 400
"""Inputs that are kept for mutation because psdmc said something new about them."""

LARGEST_KEPT = 1 << 16
"""bytes; of libFuzzer's inputs too"""

KEPT_SHARE = 0.3
"""Share of mutations that start from these: most of them are refused, and what is mutated further too."""

RAM = Path("/dev/shm")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("format")
    parser.add_argument("state", type=Path)
    parser.add_argument("seeds", type=Path)
    parser.add_argument("--engine", choices=("mutate", "atheris"), default="mutate")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=60.0)
    given = parser.parse_args()
    if given.engine == "atheris":
        _import_instrumented()
    _work(given)


def _import_instrumented() -> None:
    """All of psdmc, before anything else imports a part of it: what is imported later guides nothing."""
    import atheris

    with atheris.instrument_imports(include=["psdmc"]):
        import psdmc

        for module in pkgutil.walk_packages(psdmc.__path__, "psdmc."):
            if not module.name.endswith("__main__"):
                importlib.import_module(module.name)


def _work(given: argparse.Namespace) -> None:
    from formats import FORMATS
    from limits import LARGEST_INPUT, limited_memory
    from outcome import Outcome, outcome_of, warnings_are_errors
    from recorder import Recorder
    from seeds import read_seeds

    format = FORMATS[given.format]
    recorder = Recorder(given.state, format.name)
    faulthandler.enable((given.state / "fault").open("w", encoding="utf-8"))
    with scratch(given.seeds) as folder, warnings_are_errors(), limited_memory():
        format.set_up(folder)

        def one(data: bytes) -> Outcome | None:
            if len(data) > LARGEST_INPUT:
                return None
            deep = is_deep(data, format.deep_every)
            recorder.start(data, deep)
            outcome = outcome_of(lambda: format.run(data, folder, deep))
            recorder.end(data, outcome)
            return outcome

        seeds = read_seeds(given.seeds, format.name)
        if given.engine == "atheris":
            _guided(given, one, format.mutate, seeds)
        else:
            _mutated(given, one, format.mutate, seeds)


def is_deep(data: bytes, every: int) -> bool:
    """Decided by the bytes, so that an input is run the same way again."""
    return zlib.crc32(data) % every == 0


@contextlib.contextmanager
def scratch(seeds: Path):
    """A folder in memory where there is one; `seed` in it leads to what stands around mutated files."""
    folder = Path(tempfile.mkdtemp(prefix="psdmc-fuzz-", dir=RAM if RAM.is_dir() else None))
    (folder / "seed").symlink_to(seeds.resolve())
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _mutated(given: argparse.Namespace, one: Callable, mutate: Callable, seeds: list[bytes]) -> None:
    """Mutations of the seeds, and of inputs that drew a new message; small ones are taken more often."""
    rng, end = Random(given.seed), time.monotonic() + given.seconds
    good, kept, heard = Pool(seeds), Pool([]), set()
    for number in range(given.count):
        if time.monotonic() > end:
            break
        pool = kept if kept.data and rng.random() < KEPT_SHARE else good
        data = seeds[number] if number < len(seeds) else mutated(pool.draw(rng), rng, mutate)
        outcome = one(data)
        gist = None if outcome is None else outcome.kind + outcome.where + gist_of(outcome.said)
        if gist not in heard and len(data) <= LARGEST_KEPT and len(kept.data) < MOST_KEPT:
            kept.add(data)
        heard.add(gist)


class Pool:
    """Inputs to mutate, drawn by size."""

    def __init__(self, data: list[bytes]) -> None:
        self.data: list[bytes] = []
        self._weights: list[float] = []
        for one in data:
            self.add(one)

    def add(self, data: bytes) -> None:
        self.data.append(data)
        self._weights.append((self._weights[-1] if self._weights else 0.0) + (len(data) + 300) ** -1.5)

    def draw(self, rng: Random) -> bytes:
        return rng.choices(self.data, cum_weights=self._weights)[0]


def mutated(data: bytes, rng: Random, mutate: Callable) -> bytes:
    """By the format's structure; by its bytes where that fails, as it may on what was mutated before."""
    from mutate_bytes import mutate_bytes

    try:
        return mutate(data, rng)
    except Exception:
        return mutate_bytes(data, rng)


def gist_of(message: str) -> str:
    """A message without the names and numbers in it."""
    return re.sub(r"'[^']*'|\"[^\"]*\"|/\S*|[-+\d.]+(e[-+]?\d+)?", "_", message)[:160]


def _guided(given: argparse.Namespace, one: Callable, mutate: Callable, seeds: list[bytes]) -> None:
    """libFuzzer keeps what reaches new code; finds are recorded and do not stop it."""
    import atheris

    good, corpus = Pool(seeds), given.state / "corpus"
    corpus.mkdir(exist_ok=True)
    for number, data in enumerate(seeds):
        (corpus / f"seed-{number:02d}").write_bytes(data)

    def mutator(data: bytes, most: int, seed: int) -> bytes:
        rng = Random(seed)
        if rng.random() < FRESH:
            return mutated(good.draw(rng), rng, mutate)[:most]
        if rng.random() < WANDERING:
            return atheris.Mutate(data, most)
        return mutated(data, rng, mutate)[:most]

    def test_one_input(data: bytes) -> None:
        one(data)

    own_signals = [
        f"-handle_{name}=0" for name in ("segv", "bus", "abrt", "ill", "fpe", "int", "term", "xfsz")
    ]
    limits = [
        f"-runs={given.count}",
        f"-max_total_time={int(given.seconds)}",
        "-rss_limit_mb=0",
        "-timeout=1000000",
        f"-artifact_prefix={given.state}/",
    ]
    shape = [
        f"-max_len={LARGEST_KEPT}",
        "-len_control=0",
        f"-seed={given.seed or 1}",
        "-print_final_stats=0",
    ]
    atheris.Setup(
        [sys.argv[0], *own_signals, *limits, *shape, str(corpus)], test_one_input, custom_mutator=mutator
    )
    atheris.Fuzz()


if __name__ == "__main__":
    main()
