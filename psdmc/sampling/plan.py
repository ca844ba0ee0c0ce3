"""The settings of a sampling, and its plan for one model: functions, columns, parts, and how to compute each part."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib.metadata import version
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from psdmc import compiler
from psdmc.errors import InputError
from psdmc.functions import BY_ROWS, RECIPES, SIGNATURES
from psdmc.lower.admitted import wanted
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program.kernel import THETA_ROWS
from psdmc.program.signature import Quantity, Signature, Sizes
from psdmc.progress import Progress
from psdmc.reproducible import times
from psdmc.sampling.states import LIMITS, AlongMotion, Motion, WithinLimits
from psdmc.target.target import Real
from psdmc.version import psdmc_version

Array = NDArray[Any]
Draw = Literal["uniform", "sobol"]

SCHEMA = 1

KEY = b"psdmc"
"""Of the metadata of a part."""

PART_BYTES, PART_STATES = 1 << 26, 1 << 18
"""Largest part, unless its size is chosen. It is in memory as numbers, as a table and as a file."""

SOBOL_BITS = 32
"""Binary digits of a Sobol point. SciPy 1.17 can skip points of up to 32 digits only."""

MOST_STATES = 10**12

MOST_POINTS = 2**32 - 1
"""How many Sobol points of 32 binary digits there are."""


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
    given      ranges, plus and minus, beside the limits in the robot file: word of LIMITS -> range
    along      the motion at whose times the states are drawn; None: the states are drawn within the limits
    noise      standard deviation of noise on states of a motion, as a share of each value's standard deviation
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
    along: Motion | None = None
    noise: float = 0.0

    def __post_init__(self) -> None:
        _range("--states", self.states, 1, MOST_POINTS if self.draw == "sobol" else MOST_STATES)
        _range("--seed", self.seed, 0, 2**63 - 1)
        _range("--theta-spread", self.spread, 0.0, 1.0)
        _range("--part-states", 1 if self.rows is None else self.rows, 1, MOST_STATES)
        _range("--noise", self.noise, 0.0, 1e6)
        if self.noise and self.along is None:
            raise InputError("--noise without --along", "leave it out, or give a motion with --along")
        if self.given and self.along is not None:
            raise InputError(
                f"--{next(iter(self.given))} with --along", "leave it out: a motion needs no limits"
            )
        for word, value in self.given.items():
            _range(f"--{word}", value, 0.0, 1e6)
        if self.given.get("speed") == 0.0:
            raise InputError(
                "--speed is 0, so the robot would move in no state",
                "give a number above 0; for a robot at rest, sample functions of q alone, such as gravity",
            )
        if self.draw not in ("uniform", "sobol"):
            raise InputError(f"--draw is {self.draw!r}", "choose uniform or sobol")
        if self.real not in ("float64", "float32"):
            raise InputError(f"--real is {self.real!r}", "choose float64 or float32")


def _range(option: str, value: float, least: float, most: float) -> None:
    if not least <= value <= most:
        raise InputError(f"{option} is {value:g}", f"give a number from {least:g} to {most:g}")


@dataclass(frozen=True, eq=False)
class Plan:
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
        sizes = Sizes.of(model.mechanism, model.l)
        found = self.source.shapes | {quantity.name: sizes.shape(quantity.axes) for quantity in self.reads}
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
    def source(self) -> WithinLimits | AlongMotion:
        """Return what draws the states. Raises InputError if a joint has no limits, or a motion lacks a quantity."""
        what = self.what
        if what.along is not None:
            return AlongMotion.of(self.model, self.reads, what.along, what.noise)
        return WithinLimits.of(self.model.mechanism, self.reads, what.given)

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
            **self.source.described,
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
        draw = _shares(self.what, self.rows, self.source.size + self.links)

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
        """Return states made from random numbers between 0 and 1. If masses and inertias are sampled, return base
        parameters theta_b, too."""
        robot, size = self.model.mechanism, self.source.size
        found = {name: x.astype(self.what.real) for name, x in self.source.drawn(shares[:, :size]).items()}
        shares = shares[:, size:]
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
