"""CasADi's external functions: the emitted functions under its calling convention, with exact Jacobians.

The convention is CasADi's documented one (user guide, "Using the generated code"; Function::jacobian): beside f itself a
library exports what f_n_in, f_sparsity_out and so on return, and jac_f: inputs of f, then its outputs (not read: empty
patterns), to one block per output and input. Matrices are column by column, nonzeros only.

CasADi differentiates by the entries of q, psdmc's derivatives are along the tangent. Where q is longer than the rates the
two differ in size: such robots' functions have no Jacobians here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import prod

from psdmc.backends.c.kernel_view import KernelView, OutputView, VectorView
from psdmc.backends.c.package import PackageView
from psdmc.backends.c.render import render
from psdmc.errors import InputError
from psdmc.functions import RECIPES
from psdmc.robot.mechanism import Mechanism

DERIVATIVES, GRADIENT = "_derivatives", "_vjp"
"""Endings of function names: a function that puts out d output / d input as d<output>_d<input>, and one that reads a
cotangent last and puts out grad_<input>."""


@dataclass(frozen=True, slots=True)
class Pattern:
    """Sparsity in CasADi's form: rows, columns, then 1 (dense), or starts of columns and rows of the nonzeros."""

    name: str
    numbers: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Argument:
    """An input or output in CasADi's order; `at` is its place among the called function's outputs, in reals."""

    name: str
    pattern: str
    at: int = 0


@dataclass(frozen=True, slots=True)
class External:
    """One external function.

    name     that CasADi looks for
    inputs   all of them
    read     numbers of those that are passed on to the called function
    called   the emitted function
    starts   place of each output among the called function's outputs, in reals
    work     number of reals for those
    fails    whether it returns a status
    """

    name: str
    inputs: tuple[Argument, ...]
    outputs: tuple[Argument, ...]
    called: str
    read: tuple[int, ...]
    starts: tuple[int, ...]
    work: int
    fails: bool


@dataclass(frozen=True, slots=True)
class CasadiView:
    """What templates/adapters/casadi.c.jinja prints.

    robot    identifier that every symbol starts with
    hidden   emitted functions whose names CasADi's take: they are compiled under others
    wide     whether q is longer than the rates, so that there are no Jacobians
    zeros    length of the longest input: what is not given to a function is zero
    """

    robot: str
    externals: tuple[External, ...]
    patterns: tuple[Pattern, ...]
    hidden: tuple[str, ...]
    sources: tuple[str, ...]
    zeros: int
    wide: bool


def needed(functions: Sequence[str], wide: bool) -> list[str]:
    """Functions that compute derivatives of these; none where q is longer than the rates."""
    return [name + DERIVATIVES for name in functions if not wide and _has_blocks(name)]


def _has_blocks(name: str) -> bool:
    """Whether some function computes all derivatives of this one."""
    other = RECIPES.get(name + DERIVATIVES)
    if other is None:
        return False
    own = RECIPES[name].signature
    names = [output.name for output in other.signature.outputs]
    return all(f"d{o.name}_d{i.name}" in names for o in own.outputs for i in own.inputs)


def files(package: PackageView) -> dict[str, str]:
    """The adapter's C file; InputError where CasADi cannot call the package. It includes the library's sources and becomes
    a shared library of its own."""
    robot, wide = package.robot, package.info.nq > package.info.nv
    view = casadi_view(robot, package.real, package.kernels, wide)
    return {f"casadi/{robot}_casadi.c": render("adapters/casadi.c.jinja", view=view)}


def lacking(robot: Mechanism) -> str | None:
    """Why CasADi gets no derivatives of this robot's functions; None where it gets them."""
    if robot.nq == robot.nv:
        return None
    wide = next(joint for joint in robot.joints if joint.type.nq > joint.type.nv)
    what = (
        "a floating base" if robot.has_free_root else f"joint {wide.name!r}, whose q is longer than its rates"
    )
    return f"CasADi derivatives are not available for {what}"


def casadi_view(robot: str, real: str, every: Sequence[KernelView], wide: bool) -> CasadiView:
    """What CasADi's adapter prints of these kernels. InputError for float, and where theta_b is unknown."""
    if real != "double":
        raise InputError("CasADi's numbers are double, the package's float", "leave out --real float32")
    kernels = {kernel.name: kernel for kernel in every if not kernel.theta}
    if not kernels:
        raise InputError(
            "CasADi needs the base parameters, and this model's are unknown",
            "calibrate the model first, or leave out --with casadi",
        )
    patterns = _Patterns()
    others = {} if wide else kernels
    externals = [one for kernel in kernels.values() for one in _externals(kernel, others, patterns)]
    used = {external.called for external in externals}
    return CasadiView(
        robot=robot,
        externals=tuple(externals),
        patterns=patterns.all,
        hidden=tuple(sorted(used)),
        sources=tuple(f"{kernel.function.name}.c" for kernel in kernels.values()),
        zeros=max((vector.size for kernel in kernels.values() for vector in kernel.inputs), default=1),
        wide=wide,
    )


class _Patterns:
    """Every sparsity pattern once."""

    def __init__(self) -> None:
        self._names: dict[tuple[int, ...], str] = {}

    def of(self, shape: Sequence[int], zero: Iterable[int] = ()) -> str:
        """The name of a pattern for a row-major array whose entries `zero` are always zero."""
        return self._named(_numbers(shape, frozenset(zero)))

    def unread(self, shape: Sequence[int]) -> str:
        rows, columns = _matrix(shape)
        return self._named((rows, columns, *[0] * (columns + 1)))

    def _named(self, numbers: tuple[int, ...]) -> str:
        return self._names.setdefault(numbers, f"pattern_{len(self._names)}")

    @property
    def all(self) -> tuple[Pattern, ...]:
        return tuple(Pattern(name, numbers) for numbers, name in self._names.items())


def _matrix(shape: Sequence[int]) -> tuple[int, int]:
    """Rows and columns: the last axis is that of columns, a vector is a column."""
    return (prod(shape[:-1]), shape[-1]) if len(shape) > 1 else (prod(shape), 1)


def _numbers(shape: Sequence[int], zero: frozenset[int]) -> tuple[int, ...]:
    rows, columns = _matrix(shape)
    if not zero:
        return (rows, columns, 1)
    kept = [[row for row in range(rows) if row * columns + column not in zero] for column in range(columns)]
    starts = [sum(len(column) for column in kept[:k]) for k in range(columns + 1)]
    return (rows, columns, *starts, *(row for column in kept for row in column))


def _externals(
    kernel: KernelView, kernels: Mapping[str, KernelView], patterns: _Patterns
) -> Iterable[External]:
    """A function, and its Jacobian and its reverse mode where `kernels` have them."""
    outputs = {output.name: output for output in kernel.outputs}
    own = [(name, name, patterns.of(output.shape)) for name, output in outputs.items()]
    yield _external("", kernel, _given(kernel, patterns), own, kernel)
    other = kernels.get(kernel.name + DERIVATIVES)
    blocks = {} if other is None else {output.name: output for output in other.outputs}
    named = {f"jac_{o}_{i.name}": f"d{o}_d{i.name}" for o in outputs for i in kernel.inputs}
    if other is not None and all(block in blocks for block in named.values()):
        unread = tuple(Argument(f"out_{o.name}", patterns.unread(o.shape)) for o in outputs.values())
        shown = [(name, block, _block(blocks[block], patterns)) for name, block in named.items()]
        yield _external("jac_", kernel, (*_given(kernel, patterns), *unread), shown, other)
    gradient = kernels.get(kernel.name + GRADIENT)
    if gradient is not None and len(outputs) == 1:
        yield _reverse(kernel, gradient, patterns)


def _reverse(kernel: KernelView, gradient: KernelView, patterns: _Patterns) -> External:
    """The function that takes one cotangent to the gradients by all inputs. CasADi adds them up."""
    (output,) = kernel.outputs
    unread = Argument(f"out_{output.name}", patterns.unread(output.shape))
    seed = Argument(f"adj_{output.name}", patterns.of(output.shape))
    sizes = {one.name: one.shape for one in gradient.outputs}
    shown = [(f"adj_{i.name}", f"grad_{i.name}", patterns.of(sizes[f"grad_{i.name}"])) for i in kernel.inputs]
    return _external("adj1_", kernel, (*_given(kernel, patterns), unread, seed), shown, gradient)


def _given(kernel: KernelView, patterns: _Patterns) -> tuple[Argument, ...]:
    """The inputs. A matrix has one column per row of ours, so that the numbers have the same order in memory."""
    return tuple(Argument(i.name, patterns.of(tuple(reversed(_matrix(i.shape))) if len(i.shape) > 1 else (i.size,)))
                 for i in kernel.inputs)  # fmt: skip


def _block(output: OutputView, patterns: _Patterns) -> str:
    return patterns.of(output.shape, output.zero)


def _external(
    prefix: str,
    kernel: KernelView,
    inputs: tuple[Argument, ...],
    shown: Sequence[tuple[str, str, str]],
    called: KernelView,
) -> External:
    """prefix: of CasADi's name; shown: name for CasADi, name among the called kernel's outputs, pattern."""
    starts = _starts(called.outputs)
    count = len(kernel.inputs)
    last = (len(inputs) - 1,) if len(called.inputs) > count else ()
    return External(
        name=prefix + kernel.prototypes["single"].symbol,
        inputs=inputs,
        outputs=tuple(Argument(label, pattern, starts[output]) for label, output, pattern in shown),
        called=called.prototypes["single"].symbol,
        read=(*range(count), *last),
        starts=tuple(starts.values()),
        work=sum(output.size for output in called.outputs),
        fails=called.positive is not None,
    )


def _starts(outputs: Sequence[VectorView]) -> dict[str, int]:
    return {output.name: sum(one.size for one in outputs[:k]) for k, output in enumerate(outputs)}
