"""Writes generated functions as external functions of CasADi: arguments, sparsity patterns, and the C that calls them.

casadi.py describes CasADi's calling convention.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import prod

from psdmc.backends.c.adapters.casadi_kernels import (
    ADJOINT,
    JACOBIAN,
    SECOND,
    THETA,
    matrix_of,
    shape_of_input,
)
from psdmc.backends.c.kernel_view import KernelView, OutputView, VectorView
from psdmc.backends.info import PackageInfo
from psdmc.functions import RECIPES
from psdmc.program.kernel import GRAVITY
from psdmc.program.signature import Q, Signature
from psdmc.recipes.recipe import Polynomials

DERIVATIVES, GRADIENT, DIRECTION = "_derivatives", "_vjp", "_jvp"
"""Endings of function names: a function that puts out d output / d input as d<output>_d<input>; one that reads a
cotangent last and puts out grad_<input>; and one that reads d<input> after all inputs and puts out d<output>."""

PARAMETERS = "_parameters"
"""What follows GRADIENT where the gradient by theta_b, the last output, is among them."""

LINEAR = (Polynomials.TORQUE, Polynomials.GRAVITY, Polynomials.SOLVED)
"""Torques that are the regressor times theta_b, and accelerations of such torques."""

MAP, REGRESSOR = "tangent_map", "regressor"
"""Functions that derivatives by the entries of q, and by theta_b, need."""


@dataclass(frozen=True, slots=True)
class Pattern:
    """A sparsity pattern in CasADi's form: number of rows, number of columns, then the positions of the nonzero
    entries.

    The positions are an offset for the start of each column, and then the row of each nonzero. For a dense matrix,
    CasADi expects the single number 1 in place of the positions.
    """

    name: str
    numbers: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Argument:
    """An input or output of a CasADi function: its name and its sparsity pattern. For an output, `at` is where the
    result begins in the work vector, as an index of real numbers."""

    name: str
    pattern: str
    at: int = 0


@dataclass(frozen=True, slots=True)
class External:
    """One external function of CasADi, with the C text of its definition.

    name      the name by which CasADi finds the function
    inputs    all inputs of the CasADi function
    outputs   all outputs of the CasADi function
    called    the generated function that computes the results
    given     C text of the arguments of the call of `called`
    work      number of real numbers in the work vector, which holds results and intermediate values
    fails     whether `called` returns a status
    restored  positions q that are normalized before the call: C text of q, and of the place for the normalized q
    before    C statements before the call
    after     C statements after the call
    symbols   all generated functions that the CasADi function calls, `called` first
    """

    name: str
    inputs: tuple[Argument, ...]
    outputs: tuple[Argument, ...]
    called: str
    given: str
    work: int
    fails: bool
    restored: tuple[tuple[str, str], ...]
    before: tuple[str, ...]
    after: tuple[str, ...]
    symbols: tuple[str, ...]


def has_blocks(own: Signature) -> bool:
    """Whether some function computes all derivatives of this one. Its outputs are vectors: CasADi numbers the entries of a
    matrix column by column, the blocks row by row. No function has derivatives by the input gravity."""
    other = RECIPES.get(own.name + DERIVATIVES)
    if other is None:
        return False
    names = [output.name for output in other.signature.outputs]
    return all(len(o.axes) == 1 and f"d{o.name}_d{i.name}" in names for o in own.outputs for i in own.inputs)


def nonzeros(output: OutputView) -> list[int]:
    """Return the indices of the entries of an output that can be other than zero."""
    zero = frozenset(output.zero)
    return [k for k in range(output.size) if k not in zero]


class _Patterns:
    """Every sparsity pattern once."""

    def __init__(self) -> None:
        self._names: dict[tuple[int, ...], str] = {}

    def of(self, shape: Sequence[int], zero: Iterable[int] = ()) -> str:
        """Return the C name of the sparsity pattern of an array stored by rows; `zero` are the indices of zero entries."""
        return self._named(_numbers(shape, frozenset(zero)))

    def unread(self, shape: Sequence[int]) -> str:
        rows, columns = matrix_of(shape)
        return self._named((rows, columns, *[0] * (columns + 1)))

    def _named(self, numbers: tuple[int, ...]) -> str:
        return self._names.setdefault(numbers, f"pattern_{len(self._names)}")

    @property
    def all(self) -> tuple[Pattern, ...]:
        return tuple(Pattern(name, numbers) for numbers, name in self._names.items())


def _numbers(shape: Sequence[int], zero: frozenset[int]) -> tuple[int, ...]:
    rows, columns = matrix_of(shape)
    if not zero:
        return (rows, columns, 1)
    kept = [[row for row in range(rows) if row * columns + column not in zero] for column in range(columns)]
    starts = [sum(len(column) for column in kept[:k]) for k in range(columns + 1)]
    return (rows, columns, *starts, *(row for column in kept for row in column))


class Externals:
    """The external functions of kernels, by the names of their functions."""

    def __init__(self, kernels: Mapping[str, KernelView], info: PackageInfo) -> None:
        self.kernels, self.info = kernels, info
        self.patterns = _Patterns()
        self.helpers: set[str] = set()

    def of(self, kernel: KernelView) -> Iterable[External]:
        """Yield the CasADi functions for one generated function. These are the function itself and, if the package has
        code for them, its Jacobian, reverse derivative and forward derivative."""
        patterns, name, call = self.patterns, kernel.function.name, _Call(kernel, kernel, self)
        own = [(output.name, call.at(output.name), patterns.of(output.shape)) for output in kernel.outputs]
        yield call.external("", self._inputs(kernel), own)
        other, by_program = (self.kernels.get(name + ending) for ending in (DERIVATIVES, JACOBIAN))
        is_known = not kernel.theta or RECIPES[name].polynomials in LINEAR
        if by_program is not None:
            yield self._by_program("jac_", kernel, by_program)
        elif other is not None and has_blocks(kernel.function) and is_known:
            yield self._jacobian(kernel, other)
        gradient = self.kernels.get(name + GRADIENT + PARAMETERS * kernel.theta)
        adjoint, second = (self.kernels.get(name + ending) for ending in (ADJOINT, SECOND))
        is_one = len(kernel.outputs) == 1 and GRAVITY not in kernel.function.inputs
        if gradient is not None and is_one:
            yield self._reverse(kernel, gradient)
        elif adjoint is not None:
            yield self._by_program("adj1_", kernel, adjoint)
        if second is not None:
            yield self._by_program("jac_adj1_", kernel, second)
        direction = self.kernels.get(name + DIRECTION)
        if direction is not None and is_one and self.info.units and not kernel.theta:
            yield self._forward(kernel, direction)

    def _inputs(self, kernel: KernelView) -> tuple[Argument, ...]:
        found = [Argument(i.name, self.patterns.of(shape_of_input(i.shape))) for i in kernel.inputs]
        return (*found, *([Argument(THETA, self.patterns.of((self.info.l,)))] if kernel.theta else []))

    def _inputs_and_outputs(self, kernel: KernelView) -> tuple[Argument, ...]:
        """The inputs, and the outputs, which are not read."""
        unread = [Argument(f"out_{one.name}", self.patterns.unread(one.shape)) for one in kernel.outputs]
        return (*self._inputs(kernel), *unread)

    def _jacobian(self, kernel: KernelView, other: KernelView) -> External:
        call, inputs = _Call(kernel, other, self), self._inputs_and_outputs(kernel)
        shown: list[tuple[str, int, str]] = []
        for output in kernel.outputs:
            for k, vector in enumerate(kernel.inputs):
                block = next(one for one in other.outputs if one.name == f"d{output.name}_d{vector.name}")
                at, zero = call.at(block.name), frozenset(block.zero)
                shape: tuple[int, ...] = (output.size, vector.size)
                if call.is_wide(k):
                    at, shape, zero = call.by_entries(block, k)
                shown.append((f"jac_{output.name}_{vector.name}", at, self.patterns.of(shape, zero)))
            if kernel.theta:
                at, shape = call.by_theta()
                shown.append((f"jac_{output.name}_{THETA}", at, self.patterns.of(shape)))
        return call.external("jac_", inputs, shown)

    def _by_program(self, prefix: str, kernel: KernelView, called: KernelView) -> External:
        """Return the external function of a derivative that one kernel computes in the form that CasADi expects."""
        inputs, call = self._inputs_and_outputs(kernel), _Call(kernel, called, self)
        seeds = [
            Argument(f"adj_{one.name}", self.patterns.of(one.shape))
            for one in kernel.outputs
            if prefix != "jac_"
        ]
        given = [f"given(arg[{len(inputs) + k}])" for k in range(len(seeds))]
        zero = {one.name: one.zero if prefix != "adj1_" else () for one in called.outputs}
        shown = [
            (one.name, call.at(one.name), self.patterns.of(one.shape, zero[one.name]))
            for one in called.outputs
        ]
        if prefix == "jac_adj1_":
            shown, seeds = self._with_unread(kernel, shown, seeds)
        return call.external(prefix, (*inputs, *seeds), shown, given)

    def _with_unread(
        self, kernel: KernelView, shown: list[tuple[str, int, str]], seeds: list[Argument]
    ) -> tuple[list[tuple[str, int, str]], list[Argument]]:
        """Insert what CasADi expects but nobody reads: blocks for the function's outputs, and the gradients as inputs.

        shown  the blocks of the gradients' Jacobian, by inputs and weights
        seeds  the weights
        """
        found, blocks = [], iter(shown)
        for one in kernel.inputs:
            found += [next(blocks) for _ in kernel.inputs]
            found += [
                (f"jac_adj_{one.name}_out_{output.name}", 0, self.patterns.unread((one.size, output.size)))
                for output in kernel.outputs
            ]
            found += [next(blocks) for _ in seeds]
        unread = (
            Argument(f"out_adj_{i.name}", self.patterns.unread(shape_of_input(i.shape)))
            for i in kernel.inputs
        )
        return found, [*seeds, *unread]

    def _reverse(self, kernel: KernelView, gradient: KernelView) -> External:
        """The function that takes one cotangent to the gradients by all inputs. CasADi adds them up."""
        (output,), inputs = kernel.outputs, self._inputs_and_outputs(kernel)
        call, shown = _Call(kernel, gradient, self), []
        seed = Argument(f"adj_{output.name}", self.patterns.of(output.shape))
        for k, name in enumerate([*(vector.name for vector in kernel.inputs), *[THETA] * kernel.theta]):
            found = next(one for one in gradient.outputs if one.name == f"grad_{name}")
            at = call.by_entries(found, k)[0] if call.is_wide(k) else call.at(found.name)
            if len(found.shape) > 1:
                at = call.turned(found)
            shown.append((f"adj_{name}", at, inputs[k].pattern))
        return call.external("adj1_", (*inputs, seed), shown, [f"given(arg[{len(inputs)}])"])

    def _forward(self, kernel: KernelView, direction: KernelView) -> External:
        """The function that takes one direction of all inputs to that of the output."""
        (output,), inputs = kernel.outputs, self._inputs_and_outputs(kernel)
        call = _Call(kernel, direction, self)
        directions = tuple(Argument(f"fwd_{one.name}", one.pattern) for one in self._inputs(kernel))
        seeds = [call.direction(k, f"given(arg[{len(inputs) + k}])") for k in range(len(directions))]
        shown = [(f"fwd_{output.name}", call.at(f"d{output.name}"), self.patterns.of(output.shape))]
        return call.external("fwd1_", (*inputs, *directions), shown, seeds)


class _Call:
    """A call of an emitted function, and what comes before and behind it. Results, in order, are first in `w`."""

    def __init__(self, kernel: KernelView, called: KernelView, of: Externals) -> None:
        self.kernel, self.called, self.of = kernel, called, of
        self.starts = _starts(called.outputs)
        self.work = sum(output.size for output in called.outputs)
        self.before: list[str] = []
        self.after: list[str] = []
        self.symbols = [called.prototypes["single"].symbol]
        self.maps: dict[int, str] = {}
        self.restored = {k: self._room(of.info.nq) for k in range(len(kernel.inputs)) if self.is_wide(k)}
        if self.restored:
            of.helpers.add("restore")

    def is_wide(self, k: int) -> bool:
        """Return whether input k of the function is a vector q that contains quaternions."""
        inputs = self.kernel.function.inputs
        return bool(self.of.info.units) and k < len(inputs) and inputs[k].axes == Q.axes

    def read(self, k: int) -> str:
        """Return C text of input k, as the argument of the generated function. If q must be normalized before the call,
        the text names the normalized copy."""
        if k in self.restored and not self.called.function.normalizes:
            return self.restored[k]
        return f"given(arg[{k}])"

    def at(self, output: str) -> int:
        return self.starts[output]

    def by_entries(self, block: OutputView, k: int) -> tuple[int, tuple[int, ...], frozenset[int]]:
        """Add C statements that convert derivatives by the rates to derivatives by the entries of input k, a vector q.

        block  output of the generated function with the derivatives by the rates

        Returns where the result begins in the work vector, the shape of the result, and its entries that are always
        zero.
        """
        info, place = self.of.info, self._map(k)
        rows = prod(block.shape[:-1])
        to = self._room(rows * info.nq)
        self.after.append(f"by_entries({rows}, w + {self.at(block.name)}, {place}, {to});")
        self.of.helpers.add("by_entries")
        zero = frozenset(block.zero)
        left = {(row, i) for row in range(rows) for i in range(info.nv) if row * info.nv + i not in zero}
        entries = [divmod(one, info.nq) for one in nonzeros(self.of.kernels[MAP].outputs[0])]
        kept = {row * info.nq + j for row in range(rows) for i, j in entries if (row, i) in left}
        return _offset(to), (*block.shape[:-1], info.nq), frozenset(range(rows * info.nq)) - kept

    def turned(self, block: OutputView) -> int:
        """Where the transpose of a matrix is put: inputs have a column per row of ours."""
        to = self._room(block.size)
        self.after.append(f"give({self.of.patterns.of(block.shape)}, w + {self.at(block.name)}, {to});")
        return _offset(to)

    def by_theta(self) -> tuple[int, tuple[int, ...]]:
        """Add the C call that computes derivatives of the function by theta_b (the base parameters). Returns where the
        result begins in the work vector, and the shape of the result. The derivative of torques by theta_b is the
        regressor."""
        info, regressor = self.of.info, self.of.kernels[REGRESSOR]
        names = {vector.name: self.read(k) for k, vector in enumerate(self.kernel.inputs)}
        names |= {output.name: f"w + {self.at(output.name)}" for output in self.called.outputs}
        read = [names.get(vector.name, "given(0)") for vector in regressor.inputs]
        found = self._room(info.nv * info.l)
        self.symbols.append(regressor.prototypes["single"].symbol)
        self.after.append(f"{self.symbols[-1]}({', '.join([*read, found])});")
        if RECIPES[self.kernel.function.name].polynomials is Polynomials.SOLVED:
            inverse = next(one for one in self.called.outputs if one.name.endswith("_dtau"))
            to = self._room(info.nv * info.l)
            sizes = f"{info.nv}, {info.nv}, {info.l}"
            self.of.helpers.add("multiply")
            self.after.append(f"multiply({sizes}, -1.0, w + {self.at(inverse.name)}, {found}, {to});")
            found = to
        return _offset(found), (info.nv, info.l)

    def direction(self, k: int, given: str) -> str:
        """Return C text of a direction vector for a derivative along input k. If input k is a vector q with
        quaternions, the direction is converted from changes of q to rates.

        given  C text of the direction that CasADi passes
        """
        if not self.is_wide(k):
            return given
        place, to = self._map(k), self._room(self.of.info.nv)
        self.of.helpers.add("along_tangent")
        self.before.append(f"along_tangent({place}, {given}, {to});")
        return to

    def external(
        self,
        prefix: str,
        inputs: tuple[Argument, ...],
        shown: Sequence[tuple[str, int, str]],
        seeds: Sequence[str] = (),
    ) -> External:
        """Return the external function of CasADi that makes the C call of this object.

        prefix  beginning of CasADi's name for the function, such as jac_
        inputs  all inputs of the CasADi function
        shown   of each output: name, place in the work vector, and name of the sparsity pattern
        seeds   C text of further arguments after the inputs of the generated function
        """
        own = [self.read(k) for k in range(len(self.kernel.inputs))]
        theta = [f"given(arg[{len(own)}])"] * self.called.theta
        results = [f"w + {start}" for start in self.starts.values()]
        return External(
            name=prefix + self.kernel.prototypes["single"].symbol,
            inputs=inputs,
            outputs=tuple(Argument(label, pattern, at) for label, at, pattern in shown),
            called=self.symbols[0],
            given=", ".join([*own, *seeds, *theta, *results]),
            work=self.work,
            fails=self.called.positive is not None,
            restored=tuple((f"given(arg[{k}])", to) for k, to in self.restored.items()),
            before=tuple(self.before),
            after=tuple(self.after),
            symbols=tuple(dict.fromkeys(self.symbols)),
        )

    def _room(self, size: int) -> str:
        """C of the next so many reals of the work vector."""
        self.work += size
        return f"w + {self.work - size}"

    def _map(self, k: int) -> str:
        """C of d tangent / dq of input k."""
        if k not in self.maps:
            self.symbols.append(self.of.kernels[MAP].prototypes["single"].symbol)
            self.maps[k] = self._room(self.of.info.nv * self.of.info.nq)
            self.before.append(f"{self.symbols[-1]}(given(arg[{k}]), {self.maps[k]});")
        return self.maps[k]


def _offset(place: str) -> int:
    """The number in C of a place in the work vector."""
    return int(place.removeprefix("w + "))


def _starts(outputs: Sequence[VectorView]) -> dict[str, int]:
    return {output.name: sum(one.size for one in outputs[:k]) for k, output in enumerate(outputs)}
