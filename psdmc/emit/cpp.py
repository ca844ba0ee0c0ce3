"""The C++17 class over the C functions: which members it has and how each calls C."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from psdmc.emit.kernel_view import FunctionView, KernelView
from psdmc.emit.prototypes import Prototype


@dataclass(frozen=True, slots=True)
class CppMethod:
    """One member function.

    parameters  on raw pointers
    call        of the C function, with the class's own theta_b where it takes one
    """

    name: str
    returns: str
    parameters: str
    call: str

    @property
    def can_fail(self) -> bool:
        return self.returns != "void"


@dataclass(frozen=True, slots=True)
class CppArrayMethod:
    """The same on std::array: the result is returned, or put beside a status."""

    name: str
    returns: str
    parameters: str
    arguments: str
    result_type: str
    output: str
    can_fail: bool


@dataclass(frozen=True, slots=True)
class CppClass:
    """A class: the functions that need no parameters, those with the robot's own, or with a user's.

    theta  whether it holds theta_b
    """

    name: str
    theta: bool
    methods: tuple[CppMethod, ...]
    array_methods: tuple[CppArrayMethod, ...]

    @property
    def qualifier(self) -> str:
        """Before a member function."""
        return "" if self.theta else "static "

    @property
    def suffix(self) -> str:
        """Behind a member function's parameters."""
        return " const noexcept" if self.theta else " noexcept"


def cpp_classes(functions: Iterable[FunctionView]) -> tuple[CppClass, CppClass, CppClass]:
    """Description, Robot and RobotWithParameters, in this order."""
    shown = tuple(functions)
    free = [f.kernels[0] for f in shown if not f.needs_parameters]
    own = [k for f in shown if f.needs_parameters for k in f.kernels if not k.theta]
    given = [k for f in shown if f.needs_parameters for k in f.kernels if k.theta]
    return _class("Description", free), _class("Robot", own), _class("RobotWithParameters", given, theta=True)


def _class(name: str, kernels: list[KernelView], theta: bool = False) -> CppClass:
    methods = [_method(k, p) for k in kernels for p in k.prototypes.values()]
    return CppClass(name, theta, tuple(methods), tuple(map(_array_method, kernels)))


def _method(kernel: KernelView, prototype: Prototype) -> CppMethod:
    words = [argument.rpartition(" ") for argument in prototype.arguments]
    names = [name.lstrip("*") for _, _, name in words]
    taken = [
        f"{_cpp_type(kind)} {name}"
        for (kind, _, name), bare in zip(words, names, strict=True)
        if bare != "theta_b"
    ]
    passed = ["theta_.data()" if name == "theta_b" else name for name in names]
    variant = next(key for key, value in kernel.prototypes.items() if value is prototype)
    suffix = "" if variant == "single" else f"_{variant}"
    return CppMethod(
        name=f"{kernel.name.removesuffix('_theta')}{suffix}",
        returns="std::size_t" if prototype.returns == "size_t" else prototype.returns,
        parameters=", ".join(taken),
        call=f"::{prototype.symbol}({', '.join(passed)})",
    )


def _cpp_type(kind: str) -> str:
    return {"size_t": "std::size_t", "const double": "const Real", "const float": "const Real"}.get(
        kind, "Real"
    )


def _array_method(kernel: KernelView) -> CppArrayMethod:
    """Of one state; a function that can fail leaves its result in its last parameter and returns the status."""
    inputs = [f"const Vector &{vector.name}" for vector in kernel.inputs]
    output = kernel.output.name
    can_fail = bool(kernel.pivot_order)
    result = f"std::array<Real, {kernel.output.size}>"
    return CppArrayMethod(
        name=kernel.name.removesuffix("_theta"),
        returns="int" if can_fail else result,
        parameters=", ".join([*inputs, f"{result} &{output}"] if can_fail else inputs),
        arguments=", ".join(f"{vector.name}.data()" for vector in (*kernel.inputs, kernel.output)),
        result_type=result,
        output=output,
        can_fail=can_fail,
    )
