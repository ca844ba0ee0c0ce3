"""Random states for the benchmark, in the memory layout that each library reads."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal
from zlib import crc32

import numpy as np

from psdmc.functions import RECIPES
from psdmc.model.random_states import on_joints
from psdmc.program.signature import Quantity, Sizes
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.robot.mechanism import Array, Mechanism
from psdmc.robot.mujoco_reading import force_from_mujoco, to_mujoco

COUNT = 65_536
"""States per trial: with a thousand, the branch predictor learns the path of each sincos in glibc."""

Convention = Literal["psdmc", "MuJoCo"]
"""Of a floating base's position, rates and efforts: psdmc's are Pinocchio's."""

CACHE_LINE = 64
"""Alignment in bytes of every contestant's arrays, as a careful user's; malloc's own alignment varies."""


def at_cache_line(size: int) -> Array:
    """Return (size,) zeros whose memory begins at a cache line."""
    spare = CACHE_LINE // 8
    memory = np.zeros(size + spare)
    first = -memory.ctypes.data // 8 % spare
    return memory[first : first + size]


def _further(function: str) -> tuple[Quantity, ...]:
    """The quantities that a function reads after its third input; the loops pass on one such."""
    return RECIPES[function].signature.inputs[3:]


def output_sizes(function: str, sizes: Sizes) -> tuple[int, ...]:
    """Return the number of values per state of each output array of a function."""
    return tuple(sizes.size(output) for output in RECIPES[function].signature.outputs)


def moved(array: Array) -> Array:
    """Return a copy of an array at another place in memory."""
    copy = at_cache_line(len(array))
    copy[:] = array
    return copy


@dataclass(frozen=True, eq=False)
class States:
    """`count` random states of a robot.

    q        (count, nq), quaternions of length one
    qd, qdd  (count, nv)
    """

    chain: Mechanism
    q: Array
    qd: Array
    qdd: Array
    _layouts: dict[tuple[str, int, Convention], Array] = field(default_factory=dict, repr=False)

    @staticmethod
    def random(chain: Mechanism, count: int, seed: int) -> States:
        """Uniform within an ordinary arm's limits."""
        rng = np.random.default_rng(seed)
        own = [chain.types[i] for i in chain.own_joints]
        ranges = np.array([joint.ordinary for joint in own])
        lengths = [[joint.nq for joint in own], *2 * [[joint.nv for joint in own]]]
        q, qd, qdd = (
            rng.uniform(-1.0, 1.0, (count, sum(each))) * np.repeat(ranges[:, k], each)
            for k, each in enumerate(lengths)
        )
        return States(chain, on_joints(chain, q), qd, qdd)

    @property
    def count(self) -> int:
        return len(self.q)

    @property
    def nq(self) -> int:
        return self.chain.nq

    @property
    def nv(self) -> int:
        return self.chain.nv

    @cached_property
    def sizes(self) -> Sizes:
        return Sizes.of(self.chain)

    @cached_property
    def tau(self) -> Array:
        """(count, nv) torques at these states."""
        return self._robot.torques(self.q, self.qd, self.qdd, self._robot.base_acceleration)

    @cached_property
    def condition(self) -> float:
        """The largest condition number of the mass matrix at these states."""
        masses = self.expected("mass_matrix").reshape(self.count, self.nv, self.nv)
        return float(np.max(np.linalg.cond(masses)))

    @cached_property
    def _robot(self) -> RobotOnArrays:
        return RobotOnArrays(self.chain, self.chain.parameters.reshape(-1), np.zeros((0, 0)))

    def expected(self, function: str) -> Array:
        """Return the expected outputs of a function, (number of states, output values per state), from psdmc's
        Newton-Euler recursion in NumPy.

        For a regressor, return the torques instead. The regressor of each library, times the parameters of that
        library, must equal the torques.
        """
        if RECIPES[function].times_theta:
            return self.tau
        given = {"q": self.q, "qd": self.qd, "qdd": self.qdd, "tau": self.tau}
        given |= {quantity.name: self._shaped(quantity) for quantity in _further(function)}
        blocks = RECIPES[function].reference(self._robot, given).values()
        return np.hstack([values.reshape(self.count, -1) for values in blocks])

    def inputs(self, function: str, lanes: int = 1, convention: Convention = "psdmc") -> tuple[Array, ...]:
        """Return the inputs of a function as flat arrays: q, qd, the third input (qdd or tau), then further inputs. If
        `lanes` is more than 1, states are stored in blocks [entry of the input][state] of `lanes` states."""
        x = next((q.name for q in RECIPES[function].signature.inputs[2:]), "qdd")
        given = self.mujocos if convention == "MuJoCo" else {n: getattr(self, n) for n in ("q", "qd", x)}
        first = [self._laid_out(name, given[name], lanes, convention) for name in ("q", "qd", x)]
        return (
            *first,
            *(self._laid_out(q.name, self._drawn(q), lanes, convention) for q in _further(function)),
        )

    @cached_property
    def mujocos(self) -> dict[str, Array]:
        """Return q, qd and qdd of all states, converted to MuJoCo's convention for a floating base. The conversion is
        made before the timing starts."""
        states = (self.q, self.qd, self.qdd)
        converted = to_mujoco(*states) if self.has_floating_base else states
        return dict(zip(("q", "qd", "qdd"), converted, strict=True))

    def from_mujoco(self, tau: Array) -> Array:
        """Convert (count, nv) torques from MuJoCo's convention to psdmc's."""
        return force_from_mujoco(self.mujocos["q"], tau) if self.has_floating_base else tau

    @property
    def has_floating_base(self) -> bool:
        return self.chain.has_floating_base

    def more(self, function: str) -> int:
        """Return the number of values per state of the function's inputs after the third one; 0 if there are none."""
        return sum(self.sizes.size(quantity) for quantity in _further(function))

    def move(self) -> None:
        """Move all input arrays to other places in memory between rounds of timing. The places decide which cache lines
        collide, which changes the time of a batch call by up to a fifth. The spread of the times over several rounds
        then shows this effect."""
        for key, array in self._layouts.items():
            self._layouts[key] = moved(array)

    def _shaped(self, quantity: Quantity) -> Array:
        """(count, ...) values of a further input."""
        shape = self.sizes.shape(quantity.axes)
        return self._drawn(quantity).reshape(self.count, *shape)

    def _drawn(self, quantity: Quantity) -> Array:
        """(count, size) values within plus and minus its largest, the same for the same name."""
        size = self.sizes.size(quantity)
        rng = np.random.default_rng(crc32(quantity.name.encode()))
        return np.asarray(quantity.drawn(rng.uniform(-1.0, 1.0, (self.count, size))))

    def _laid_out(self, name: str, rows: Array, lanes: int, convention: Convention) -> Array:
        """The values in one layout, shared by all contestants, so that caches are equally warm for each."""
        key = name, lanes, convention
        if key not in self._layouts:
            blocks = rows.reshape(-1, lanes, rows.shape[1]).transpose(0, 2, 1)
            flat = at_cache_line(rows.size)
            flat[:] = blocks.ravel()
            self._layouts[key] = flat
        return self._layouts[key]
