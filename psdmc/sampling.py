"""Draws random states of a robot within its limits and writes them with the values of functions to Parquet files.

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
import warnings
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib.metadata import version
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri
from scipy.stats import qmc

from psdmc import compiler
from psdmc.atomic import make_folder, refuse_foreign_folder, system_errors_at, write_whole
from psdmc.cluster import at_once, connected
from psdmc.errors import InputError, ToolchainError
from psdmc.functions import BY_ROWS, RECIPES, SIGNATURES
from psdmc.lower.kernels import wanted
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.load import load_bytes
from psdmc.model.store import file_bytes
from psdmc.program.signature import QD, QDD, TAU, Q, Quantity, Signature, Sizes
from psdmc.program.theta_rows import THETA_ROWS
from psdmc.progress import Progress, Step, silent
from psdmc.reading import read_file
from psdmc.reproducible import times
from psdmc.robot.limits import listed, shown
from psdmc.robot.mechanism import Limits, Mechanism
from psdmc.robot.unit_lengths import units_of
from psdmc.target.target import Real
from psdmc.version import psdmc_version

Array = NDArray[Any]
Draw = Literal["uniform", "sobol"]

SCHEMA = 1
MANIFEST = "sample.json"
MOST_MANIFEST = 1 << 24
"""Bytes of a manifest: one of 200 joints has 50 kB."""

KEY = b"psdmc"
"""Of the metadata of a part."""

PART_BYTES, PART_STATES = 1 << 26, 1 << 18
"""Largest part, unless its size is chosen. It is in memory as numbers, as a table and as a file."""

MOST_STATES = 10**12

SOBOL_BITS, MOST_POINTS = 32, 2**32 - 1
"""Binary digits of a Sobol point, and how many points there are. SciPy 1.17 can skip points of up to 32 digits only."""

LIMITS: Mapping[str, tuple[str, str]] = {
    Q.name: ("position", "rad or m"),
    QD.name: ("speed", "rad/s or m/s"),
    QDD.name: ("acceleration", "rad/s^2 or m/s^2"),
    TAU.name: ("effort", "N m or N"),
}
"""Quantities that are drawn, in this order: the option that gives limits that the robot's file lacks, and their units."""

LEAST = 2.0**-53
"""Nearest to 0 and 1 that a share is taken where it becomes a normal deviate, which is infinite there."""


@dataclass(frozen=True, slots=True)
class Sampling:
    """The settings of a sampling: which states to draw and which functions to evaluate.

    states     number of states
    functions  names of the functions, as for the option `--functions`
    draw       'uniform': independent states; 'sobol': states that fill the limits more evenly, by a scrambled Sobol
               sequence
    seed       seed of the random states
    real       precision of states and values
    spread     0 to 1: for each state, the mass and inertia of each link are multiplied by a random factor between 1 -
               spread and 1 + spread
    given      ranges, plus and minus, for joints without a limit in the robot file: word of LIMITS -> range
    rows       number of states per part; None: as many as PART_BYTES and PART_STATES allow
    """

    states: int
    functions: Sequence[str] = ("inverse_dynamics",)
    draw: Draw = "uniform"
    seed: int = 0
    real: Real = "float64"
    spread: float = 0.0
    given: Mapping[str, float] = field(default_factory=dict)
    rows: int | None = None

    def __post_init__(self) -> None:
        _range("--states", self.states, 1, MOST_POINTS if self.draw == "sobol" else MOST_STATES)
        _range("--seed", self.seed, 0, 2**63 - 1)
        _range("--theta-spread", self.spread, 0.0, 1.0)
        _range("--part-states", 1 if self.rows is None else self.rows, 1, MOST_STATES)
        for word, value in self.given.items():
            _range(f"--{word}", value, 0.0, 1e6)
        if self.draw not in ("uniform", "sobol"):
            raise InputError(f"--draw is {self.draw!r}", "choose uniform or sobol")
        if self.real not in ("float64", "float32"):
            raise InputError(f"--real is {self.real!r}", "choose float64 or float32")


def _range(option: str, value: float, least: float, most: float) -> None:
    if not least <= value <= most:
        raise InputError(f"{option} is {value:g}", f"give a number from {least:g} to {most:g}")


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
    plan = _Plan(model, what)
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


def _here(plan: _Plan, missing: Sequence[int], progress: Progress) -> Made:
    if missing:
        file = plan.files(progress)
        progress(Step("sampling", 1.0 - len(missing) / plan.parts))
        yield from ((part, file(part)) for part in missing)


def _on_workers(plan: _Plan, missing: Sequence[int], scheduler: str) -> Made:
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
            plan = _Plan(load_bytes(zlib.decompress(filed), Path("(model of psdmc sample)")), what)
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
    for key, value in manifest.items():
        if known.get(key) != value:
            raise InputError(
                f"{folder}: holds another sampling, whose {key} is {shown(known.get(key))}, not {shown(value)}",
                "give -o another folder, or the options, model and versions of its sample.json",
            )


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
            f"{folder}: the missing parts take {size / 1e9:.1f} GB, and the disk has {free / 1e9:.1f} GB free",
            "make room there, write to another disk, or sample fewer states",
        )


def _file(columns: Mapping[str, Array], described: bytes) -> bytes:
    """The Parquet file of a part: lists of fixed length, numbers alone as they are. Random numbers do not compress."""
    import pyarrow
    import pyarrow.parquet

    arrays = []
    for values in columns.values():
        flat = pyarrow.array(values.reshape(-1))
        row = pyarrow.list_(pyarrow.field("item", flat.type, False), math.prod(values.shape[1:]))
        arrays.append(flat if values.ndim == 1 else pyarrow.FixedSizeListArray.from_arrays(flat, type=row))
    fields = [pyarrow.field(name, array.type, False) for name, array in zip(columns, arrays, strict=True)]
    table = pyarrow.table(arrays, schema=pyarrow.schema(fields, {KEY: described}))
    stream = pyarrow.BufferOutputStream()
    pyarrow.parquet.write_table(
        table, stream, compression="none", use_dictionary=False, write_statistics=False
    )
    return bytes(stream.getvalue().to_pybytes())


@dataclass(frozen=True, eq=False)
class _Plan:
    """A sampling of one model, checked."""

    model: DynamicsModel
    what: Sampling

    @cached_property
    def functions(self) -> tuple[Signature, ...]:
        """Return the functions whose values are sampled. Raises InputError if a function is unknown, or needs an input
        that psdmc cannot sample."""
        names = [name for name in wanted(self.what.functions, self.model.mechanism) if name not in BY_ROWS]
        found = tuple(SIGNATURES[name] for name in names)
        for function in found:
            strange = [quantity.name for quantity in function.inputs if quantity.name not in LIMITS]
            if strange:
                raise InputError(
                    f"{function.name} reads {strange[0]}, which has no limits to draw it from",
                    f"sample functions of {', '.join(LIMITS)} alone",
                )
        if any(function.theta for function in found):
            self.model.known_theta_b()
        return found

    @cached_property
    def reads(self) -> tuple[Quantity, ...]:
        """Return the input quantities that are drawn at random for the sampled functions, such as q and qd."""
        read = {quantity.name: quantity for function in self.functions for quantity in function.inputs}
        return tuple(read[name] for name in LIMITS if name in read)

    @cached_property
    def columns(self) -> dict[str, tuple[int, ...]]:
        """Return the columns of the Parquet files: name -> shape for one state. The inputs come first, then the outputs
        of the sampled functions."""
        model = self.model
        sizes = Sizes(model.n, model.nq, model.nv, model.l, len(model.mechanism.frames))
        found = {quantity.name: sizes.shape(quantity.axes) for quantity in self.reads}
        if self.what.spread:
            found["theta_b"] = (model.l,)
        for function in self.functions:
            packs = RECIPES[function.name].packs
            kept = len(packs.places(model.mechanism, model.representative)) if packs else 0
            for output in function.outputs:
                found[function.label(output)] = replace(sizes, nonzeros=kept).shape(output.axes)
        return found

    @property
    def row_bytes(self) -> int:
        """Return the number of bytes that one state takes in a part (one output file)."""
        return (8 if self.what.real == "float64" else 4) * sum(map(math.prod, self.columns.values()))

    @cached_property
    def rows(self) -> int:
        """Return the number of states in a full part (one output file). It is a power of two, because such numbers of
        Sobol points are spread most evenly."""
        fit = max(PART_BYTES // self.row_bytes, 1)
        return self.what.rows or min(1 << (fit.bit_length() - 1), PART_STATES)

    @property
    def parts(self) -> int:
        return -(-self.what.states // self.rows)

    def count(self, part: int) -> int:
        """Return the number of states in the part (output file) with this number."""
        return min(self.rows, self.what.states - part * self.rows)

    @cached_property
    def ranges(self) -> dict[str, tuple[Array, Array]]:
        """Return the lower and upper bounds of the random values of each quantity: name -> two arrays. Raises
        InputError if a joint has no limits."""
        robot, found, lacking = self.model.mechanism, {}, {}
        for quantity in self.reads:
            word, _ = LIMITS[quantity.name]
            bounds, without = _bounds(robot, quantity.name, self.what.given.get(word))
            found[quantity.name] = bounds[:, 0], bounds[:, 1]
            if without:
                lacking[word] = without
        if lacking:
            faults = "; ".join(f"{word}: {listed(names, 4)}" for word, names in lacking.items())
            units = dict(LIMITS.values())
            options = " and ".join(f"--{word} NUMBER ({units[word]})" for word in lacking)
            raise InputError(f"{robot.name}: joints without limits of {faults}", f"add {options}")
        return found

    @cached_property
    def manifest(self) -> dict[str, Any]:
        """Return the settings that determine the content of all output files, as JSON values."""
        model, what = self.model, self.what
        found = {
            "generator": "psdmc sample",
            "schema": SCHEMA,
            "robot": model.mechanism.name,
            "model": model.content_hash,
            "states": what.states,
            "states_per_part": self.rows,
            "functions": [function.name for function in self.functions],
            "draw": what.draw,
            "seed": what.seed,
            "real": what.real,
            "theta_spread": what.spread,
            "ranges": {name: [side.tolist() for side in sides] for name, sides in self.ranges.items()},
            "columns": self.columns,
            "q_names": model.mechanism.q_names,
            "v_names": model.mechanism.v_names,
            "psdmc": psdmc_version(),
            "numpy": np.__version__,
            "scipy": version("scipy"),
            "pyarrow": version("pyarrow"),
        }
        plain: dict[str, Any] = json.loads(json.dumps(found))
        return plain

    def described(self, part: int) -> bytes:
        """Return a part's (output file's) metadata as bytes: settings, number and states."""
        own = {"part": part, "first_state": part * self.rows, "states_of_part": self.count(part)}
        return json.dumps({**self.manifest, **own}).encode()

    def files(self, progress: Progress) -> Callable[[int], bytes]:
        """Compile the functions; return a function from a part's number to its file's bytes."""
        columns = self.evaluated(progress)
        return lambda part: _file(columns(part), self.described(part))

    def evaluated(self, progress: Progress) -> Callable[[int], dict[str, Array]]:
        """Compile the functions; return a function from a part's number to its file's columns."""
        by_rows = {function.name for function in self.functions if function.theta and self.what.spread}
        names = [
            f"{function.name}{THETA_ROWS}" if function.name in by_rows else function.name
            for function in self.functions
        ]
        robot = compiler.compile(self.model, functions=names, real=self.what.real, progress=progress)
        draw = _shares(self.what, self.rows, sum(len(low) for low, _ in self.ranges.values()) + self.links)

        def columns(part: int) -> dict[str, Array]:
            found = self.drawn(draw(part)[: self.count(part)])
            for function in self.functions:
                theta_b = found["theta_b"] if function.name in by_rows else None
                outputs = robot.call(function, [found[q.name] for q in function.inputs], theta_b)
                several = [outputs] if len(function.outputs) == 1 else outputs
                found |= {function.label(o): a for o, a in zip(function.outputs, several, strict=True)}
            return found

        return columns

    @property
    def links(self) -> int:
        """Return the number of links whose masses and inertias are multiplied by random factors.

        The number is zero if the option `spread` is zero, because all factors are then one.
        """
        return len(self.model.mechanism) if self.what.spread else 0

    def drawn(self, shares: Array) -> dict[str, Array]:
        """Return states within the limits, made from random numbers between 0 and 1. If masses and inertias are
        sampled, return base parameters theta_b, too."""
        robot, found = self.model.mechanism, {}
        for name, (lower, upper) in self.ranges.items():
            own, shares = shares[:, : len(lower)], shares[:, len(lower) :]
            values = lower + (upper - lower) * own
            for start, stop in (
                units_of(robot.joints[i].type for i in robot.own_joints) if name == Q.name else ()
            ):
                normal = ndtri(np.clip(own[:, start:stop], LEAST, 1.0 - LEAST))
                values[:, start:stop] = normal / np.sqrt(sum(x * x for x in normal.T))[:, None]
            found[name] = values.astype(self.what.real)
        if self.what.spread:
            links = robot.known_parameters
            effects = [
                times(block, x)
                for block, x in zip(np.split(self.model.B, len(robot), axis=1), links, strict=True)
            ]
            factors = self.what.spread * (2.0 * shares - 1.0)
            theta_b = self.model.known_theta_b() + times(factors, np.array(effects))
            found["theta_b"] = theta_b.astype(self.what.real)
        return found


def _bounds(robot: Mechanism, quantity: str, given: float | None) -> tuple[Array, list[str]]:
    """(size, 2) the range of each entry, and the names of joints that have none. Entries of quaternions need none."""
    bounds: list[tuple[float, float]] = []
    lacking = []
    for joint in (robot.joints[i] for i in robot.own_joints):
        low, high = _limits(joint.limits, quantity)
        if given is not None:
            low, high = (low if math.isfinite(low) else -given), (high if math.isfinite(high) else given)
        size = joint.type.nq if quantity == Q.name else joint.type.nv
        own = [(low, high)] * size
        if quantity == Q.name:
            own[joint.type.unit] = [(0.0, 0.0)] * len(own[joint.type.unit])
        if not all(math.isfinite(bound) for pair in own for bound in pair) or low > high:
            lacking.append(joint.name)
        bounds += own
    return np.array(bounds).reshape(-1, 2), lacking


def _limits(limits: Limits, quantity: str) -> tuple[float, float]:
    if quantity == Q.name:
        return limits.lower, limits.upper
    largest = {QD.name: limits.speed, QDD.name: limits.acceleration, TAU.name: limits.effort}[quantity]
    return -largest, largest


def _shares(what: Sampling, rows: int, size: int) -> Callable[[int], Array]:
    """Return a function that draws a part's shares, (rows, size), 0 to 1. They follow from seed and part."""
    if what.draw == "uniform":
        return lambda part: np.random.default_rng([what.seed, part]).random((rows, size))
    engine = qmc.Sobol(size, bits=SOBOL_BITS, rng=np.random.default_rng(what.seed))

    def sobol(part: int) -> Array:
        if engine.num_generated > part * rows:
            engine.reset()
        if engine.num_generated < part * rows:
            engine.fast_forward(part * rows - engine.num_generated)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # on parts whose size is no power of two
            found: Array = engine.random(rows)
        return found

    return sobol
