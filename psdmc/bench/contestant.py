"""One compared function of the benchmark: a library's code for one robot, called by rivals/loops.hpp."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Literal

import numpy as np

from psdmc.bench.states import Convention, States, at_cache_line, moved
from psdmc.functions import RECIPES
from psdmc.robot.mechanism import Array

Layout = Literal["state", "rows", "lanes"]
"""One state a call; many states as rows; many states lane by lane."""

RING_BYTES = 1 << 18
"""Size of the ring buffer of outputs: within any L2 cache, so that the code is measured and not the memory."""

BLOCK = 1024
"""States per timed block: some 50 us, long compared with reading the clock, short compared with the scheduler's slices.
Batch calls take what the ring holds."""

SEVERAL_SHARE = 4
"""Functions with several outputs, which take rivals microseconds, are timed over this part of the states, so that `make
bench` takes minutes; these are still far more than a branch predictor remembers."""

LATENCY_SHARE = 4
"""Latency is measured over this part of the states: still far more than a branch predictor remembers."""

TAIL_BLOCK = 64
"""Calls per block for the worst case: single calls are too short for the clock."""


@dataclass(frozen=True, slots=True)
class Unavailable:
    """A library that could not be built or run on this machine, and the reason, which the tables show."""

    rival: str
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class Contestant:
    """The code of one library for one function and one robot, with all data that are needed to call and time the code.

    rival         name of the library in tables: 'psdmc factored', 'Pinocchio' ...
    function      name in psdmc/functions
    library       shared library that exports the C functions `symbol`_throughput and so on
    outputs       number of output values per state
    variant       name of the algorithm if the library has several for the function, else ''
    layout        how states are passed: 'state' (one per call), 'rows' (one after the other) or 'lanes' (blocks of
                  states)
    lanes         states per block if the layout is 'lanes'
    sections      number of values per state of each output array of a batch call; () if there is one array
    convention    convention for the states of a floating base: psdmc's or MuJoCo's
    robot         text from which the library makes the robot; None if the robot is compiled in
    weights       only for regressors: the parameters by which a row of the regressor is multiplied to get a torque
    operations    (multiplications, additions), None if unknown
    instructions  number per state on x86-64-v3, None if not counted
    code_bytes    size of the machine code for one state, None if the library does not provide it
    """

    rival: str
    function: str
    library: Path
    symbol: str
    outputs: int
    variant: str = ""
    layout: Layout = "state"
    lanes: int = 1
    sections: tuple[int, ...] = ()
    convention: Convention = "psdmc"
    robot: str | None = None
    weights: Array | None = None
    operations: tuple[int, int] | None = None
    instructions: float | None = None
    code_bytes: int | None = None

    @property
    def label(self) -> str:
        return f"{self.rival} {self.variant}".strip()


class Work(ctypes.Structure):
    """bench::Work of loops.hpp."""

    _fields_ = [
        ("count", ctypes.c_size_t),
        ("nq", ctypes.c_size_t),
        ("nv", ctypes.c_size_t),
        ("outputs", ctypes.c_size_t),
        ("ring", ctypes.c_size_t),
        ("q", ctypes.c_void_p),
        ("qd", ctypes.c_void_p),
        ("x", ctypes.c_void_p),
        ("output", ctypes.c_void_p),
        ("more", ctypes.c_size_t),
        ("y", ctypes.c_void_p),
    ]


class Runner:
    """A loaded library with input states in the memory layout of the library, ready to time one function repeatedly."""

    def __init__(self, contestant: Contestant, states: States) -> None:
        self.contestant = contestant
        self._library = ctypes.CDLL(str(contestant.library))
        one_a_call = contestant.layout == "state"
        room = max(1 if one_a_call else TAIL_BLOCK, RING_BYTES // (8 * contestant.outputs))
        ring = min(states.count, 1 << int(np.log2(room)))
        self._output = at_cache_line(ring * contestant.outputs)
        self._block = min(BLOCK, states.count) if one_a_call else ring
        self._states = states
        several = len(RECIPES[contestant.function].signature.outputs) > 1
        self._count = max(self._block, states.count // (SEVERAL_SHARE if several else 1))
        self.setup()

    def move(self) -> None:
        """Move the output array to another place in memory between trials. The place decides which cache lines collide,
        and so changes the time of a call."""
        self._output = moved(self._output)

    def setup(self) -> None:
        """Pass the robot to the library. A library holds one robot at a time."""
        if self.contestant.robot is not None:
            self._library.setup(self.contestant.robot.encode())

    def throughput(self) -> Array:
        """Measure the time per state in ns if the states are independent. Returns one time for each block of states.
        Other work on the machine hardly affects the median of these times."""
        return self._timed("throughput", self._output, self._block)

    def latency(self) -> Array:
        """Measure the time per state in ns, for each block, if each state depends on the result before it."""
        return self._timed("latency", self._output, self._block, self._count // LATENCY_SHARE)

    def tail(self) -> Array:
        """Measure the time per call in ns, without the time of reading the clock. Returns one time for each block of 64
        calls, from which the slowest calls are found."""
        return self._timed("throughput", self._output, TAIL_BLOCK) - self._clock_cost() / TAIL_BLOCK

    def cold(self, calls: int, memory: Array) -> Array:
        """Measure the times of single calls with empty caches, in ns, without the time of reading the clock. The array
        `memory`, which is larger than the caches, is read between two calls.

        calls  number of calls
        """
        seconds = np.zeros(min(calls, self._states.count))
        loop = getattr(self._library, f"{self.contestant.symbol}_cold")
        work, sizes = self._work(self._output, len(seconds)), (len(seconds), memory.size)
        count, reals = map(ctypes.c_size_t, sizes)
        loop(ctypes.byref(work), count, _pointer(memory), reals, _pointer(seconds))
        return seconds * 1e9 - self._clock_cost()

    def outputs(self) -> Array:
        """Compute the function at every state and return the outputs, (number of states, values per state)."""
        count, size = self._states.count, self.contestant.outputs
        output = np.full(count * size, np.nan)
        self._copy_matrices(True)
        self._timed("throughput", output, count, count)
        self._copy_matrices(False)
        lanes, arrays = self.contestant.lanes, np.split(output, np.cumsum(self._sections)[:-1] * count)
        return np.hstack([_as_rows(array, lanes, count) for array in arrays])

    def _timed(self, kind: str, output: Array, block: int, count: int | None = None) -> Array:
        """Seconds of each block from the library's loop over `count` states (its share), as ns per state."""
        work = self._work(output, max(block, count or self._count))
        seconds = np.zeros(work.count // block)
        loop = getattr(self._library, f"{self.contestant.symbol}_{kind}")
        loop(ctypes.byref(work), ctypes.c_size_t(block), _pointer(seconds))
        return seconds * (1e9 / block)

    def _work(self, output: Array, count: int) -> Work:
        """Return the arrays that a loop over `count` states reads and writes."""
        states, function = self._states, self.contestant.function
        inputs = states.inputs(function, self.contestant.lanes, self.contestant.convention)
        q, qd, x, *others = (vector.ctypes.data for vector in inputs)
        ring = len(output) // self.contestant.outputs
        y = others[0] if others else None
        return Work(
            count,
            states.nq,
            states.nv,
            self.contestant.outputs,
            ring,
            q,
            qd,
            x,
            output.ctypes.data,
            states.more(function),
            y,
        )

    @property
    def _sections(self) -> tuple[int, ...]:
        return self.contestant.sections or (self.contestant.outputs,)

    def _clock_cost(self) -> float:
        """ns for an empty block."""
        seconds = np.zeros(1024)
        self._library.clock_cost(ctypes.c_size_t(len(seconds)), ctypes.c_void_p(seconds.ctypes.data))
        return 1e9 * float(np.median(seconds))

    def _copy_matrices(self, yes: bool) -> None:
        if hasattr(self._library, "copy_matrices"):
            self._library.copy_matrices(int(yes))


def _pointer(array: Array) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _as_rows(array: Array, lanes: int, count: int) -> Array:
    """(count, size) from one array of a call: blocks of lanes, or rows already."""
    size = len(array) // count
    return array.reshape(count // lanes, size, lanes).transpose(0, 2, 1).reshape(count, size)


def source(name: str) -> str:
    """Return the text of a C++ file of the benchmark."""
    return files("psdmc.bench.rivals").joinpath(name).read_text()
