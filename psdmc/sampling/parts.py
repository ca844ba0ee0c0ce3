"""Writes states of a robot and the values of functions to Parquet files, in parts.

The output folder has a manifest (settings of the sampling) and numbered parts, each a file. The manifest and the number
of a part determine the part's content. Each part is written as a whole, so an interrupted run continues with the
missing parts. The memory that psdmc needs does not grow with the number of states.
"""

from __future__ import annotations

import hashlib
import json
import math
import shutil
import threading
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import Any

from psdmc.errors import InputError, ToolchainError
from psdmc.files import make_folder, read_file, refuse_foreign_folder, system_errors_at, write_whole
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.load import load_bytes
from psdmc.model.store import file_bytes
from psdmc.progress import Progress, Step, silent
from psdmc.robot.limits import shown
from psdmc.sampling.plan import KEY, Plan, Sampling
from psdmc.workers import at_once, connected

MANIFEST = "sample.json"
MOST_MANIFEST = 1 << 24
"""Bytes of a manifest: one of 200 joints has 50 kB."""


@dataclass(frozen=True, slots=True)
class Sampled:
    """The content of an output folder after sampling: number of states, parts (output files) and bytes. It also has the
    number of parts that were there before, and the length of each column."""

    states: int
    parts: int
    bytes: int
    before: int
    columns: Mapping[str, int]


def sample(
    model: DynamicsModel,
    folder: Path,
    what: Sampling,
    progress: Progress = silent,
    scheduler: str | None = None,
) -> Sampled:
    """Draw random states, evaluate the functions, and write the parts (output files) that are missing in the folder.

    scheduler  address of a Dask scheduler, whose workers compute the parts; None: this process computes them

    Raises InputError if the folder holds another sampling or files that psdmc did not write. The error is also raised
    if a joint has no limit, or if a function needs an input that psdmc cannot sample. Raises ToolchainError if the disk
    is full or too small for the missing parts, or if the scheduler does not answer.
    """
    if find_spec("pyarrow") is None:
        raise InputError("psdmc sample needs pyarrow", "pip install 'psdmc[sample]'")
    plan = Plan(model, what)
    _begin(folder, plan.manifest)
    paths = [folder / f"part-{number:06d}.parquet" for number in range(plan.parts)]
    missing = [k for k, path in enumerate(paths) if not _is_done(path, plan.described(k))]
    _check_room(folder, sum(map(plan.count, missing)) * plan.row_bytes)
    before = plan.parts - len(missing)
    made = _on_workers(plan, missing, scheduler) if scheduler else _here(plan, missing, progress)
    for done, (part, content) in enumerate(made, before + 1):
        write_whole(paths[part], content)
        progress(Step(f"{done} of {plan.parts} parts", done / plan.parts))
    size = sum(path.stat().st_size for path in paths)
    lengths = {name: math.prod(shape) for name, shape in plan.columns.items()}
    return Sampled(what.states, plan.parts, size, before, lengths)


Made = Iterator[tuple[int, bytes]]
"""Numbers of parts and their files' contents."""


def _here(plan: Plan, missing: Sequence[int], progress: Progress) -> Made:
    if missing:
        file = plan.files(progress)
        progress(Step("sampling", 1.0 - len(missing) / plan.parts))
        yield from ((part, file(part)) for part in missing)


def _on_workers(plan: Plan, missing: Sequence[int], scheduler: str) -> Made:
    """Parts from the workers of a scheduler, in the order in which they are ready, few at a time. Dask gives the parts of a
    worker that dies to others."""
    with connected(scheduler) as client:
        from distributed import as_completed

        filed, text = zlib.compress(file_bytes(plan.model)), json.dumps(plan.manifest)
        running: Any = as_completed([], loop=client.loop)  # type: ignore[no-untyped-call]
        left = iter(missing)

        def submit(count: int) -> None:
            for part in islice(left, count):
                running.add(client.submit(_of_worker, filed, plan.what, text, part, pure=False))

        submit(at_once(client))
        for future in running:
            yield future.result()
            submit(1)


def _of_worker(filed: bytes, what: Sampling, manifest: str, part: int) -> tuple[int, bytes]:
    """A part, and its number. InputError where this process has other versions than the one that asks."""
    key = hashlib.sha256(manifest.encode()).hexdigest()
    with _ONE_AT_A_TIME:
        if key not in _WORKING:
            plan = Plan(load_bytes(zlib.decompress(filed), Path("(model of psdmc sample)")), what)
            for name, value in json.loads(manifest).items():
                if plan.manifest[name] != value:
                    raise InputError(
                        f"a worker's {name} is {shown(plan.manifest[name])}, not {shown(value)}",
                        "install the same versions there",
                    )
            _WORKING.clear()
            _WORKING[key] = plan.files(silent)
        return part, _WORKING[key](part)


_WORKING: dict[str, Callable[[int], bytes]] = {}
"""What a worker computes parts with, by the manifest's hash: that of the last sampling."""

_ONE_AT_A_TIME = threading.Lock()
"""Threads of a worker share it."""


def _begin(folder: Path, manifest: Mapping[str, Any]) -> None:
    """Write the manifest into a folder without parts; InputError where there are parts of another one, or other files."""
    path, elsewhere = folder / MANIFEST, "give -o another folder"
    if not path.exists():
        refuse_foreign_folder(folder, elsewhere)
        make_folder(folder)
        write_whole(path, json.dumps(manifest, indent=1) + "\n")
        return
    try:
        found = json.loads(read_file(path, MOST_MANIFEST, elsewhere))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: no manifest of psdmc sample: {error}", elsewhere) from error
    known = found if isinstance(found, dict) else {}
    is_own = known.get("generator") == manifest["generator"]
    if is_own and known != manifest and not any(folder.glob("part-*.parquet")):
        write_whole(path, json.dumps(manifest, indent=1) + "\n")
        return
    own = {name: known.get(name) for name in manifest}
    if own != manifest:
        what, here, value = _first_difference(own, manifest)
        raise InputError(
            f"{folder}: holds another sampling, whose {what} is {shown(here)}, not {shown(value)}",
            "give -o another folder, or the options, model and versions of its sample.json",
        )


def _first_difference(known: Mapping[str, Any], wanted: Mapping[str, Any]) -> tuple[str, Any, Any]:
    """Return the name of the first entry that differs, and its two values; within entries that are objects, too."""
    absent = object()
    name = next(name for name in {**wanted, **known} if known.get(name, absent) != wanted.get(name, absent))
    here, value = known.get(name), wanted.get(name)
    if isinstance(here, Mapping) and isinstance(value, Mapping):
        within, here, value = _first_difference(here, value)
        return f"{name}: {within}", here, value
    return name, here, value


def _is_done(path: Path, described: bytes) -> bool:
    """Check if a file is the part that is so described."""
    import pyarrow
    import pyarrow.parquet

    try:
        return bool((pyarrow.parquet.read_metadata(path).metadata or {}).get(KEY) == described)
    except (OSError, pyarrow.ArrowException):
        return False


def _check_room(folder: Path, size: int) -> None:
    """ToolchainError where the disk has no room for so many bytes."""
    with system_errors_at(folder):
        free = shutil.disk_usage(folder).free
    if size > free:
        raise ToolchainError(
            f"{folder}: the missing parts take {_shown_bytes(size)}, and the disk has {_shown_bytes(free)} free",
            "make room there, write to another disk, or sample fewer states",
        )


def _shown_bytes(size: int) -> str:
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.1f} MB"
