"""The C++17 class that wraps the C functions: its members, and how each member calls C."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from psdmc.backends.c.kernel_view import FunctionView, KernelView, Prototype


@dataclass(frozen=True, slots=True)
class CppMethod:
    """One member function of the C++ class, which takes raw pointers.

    parameters  C++ text of the parameters
    call        C++ text of the call of the C function; if the C function takes theta_b, that of the class is passed
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
    """A member function that takes and returns std::array.

    output  the output that is returned, of type result_type; '' if all outputs are parameters. Outputs are parameters
            if there are several, or if the C function returns a status
    called  name of the member that it calls; with the name of the class if a parameter has the member's name
    """

    name: str
    returns: str
    parameters: str
    arguments: str
    result_type: str
    output: str
    called: str


@dataclass(frozen=True, slots=True)
class CppClass:
    """One C++ class with generated functions as members. There are three classes: for functions without base
    parameters, for the base parameters of the robot file, and for base parameters that the user passes.

    theta  whether the class stores theta_b, the base parameters of the user
    """

    name: str
    theta: bool
    methods: tuple[CppMethod, ...]
    array_methods: tuple[CppArrayMethod, ...]

    @property
    def qualifier(self) -> str:
        """Qualifier before a member function."""
        return "" if self.theta else "static "

    @property
    def suffix(self) -> str:
        """Text after a member function's parameters."""
        return " const noexcept" if self.theta else " noexcept"


def cpp_classes(functions: Iterable[FunctionView], n: int) -> tuple[CppClass, CppClass, CppClass]:
    """Description, Robot and RobotWithParameters, in this order."""
    shown = tuple(functions)
    free = [f.kernels[0] for f in shown if not f.needs_parameters]
    own = [k for f in shown if f.needs_parameters for k in f.kernels if not k.theta]
    given = [k for f in shown if f.needs_parameters for k in f.kernels if k.theta]
    return (
        _class("Description", free, n),
        _class("Robot", own, n),
        _class("RobotWithParameters", given, n, theta=True),
    )


def _class(name: str, kernels: list[KernelView], n: int, theta: bool = False) -> CppClass:
    methods = [_method(k, p) for k in kernels for p in k.prototypes.values()]
    return CppClass(name, theta, tuple(methods), tuple(_array_method(k, n, name) for k in kernels))


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


def _array_method(kernel: KernelView, n: int, owner: str) -> CppArrayMethod:
    """The member function for one state; several results, or one with a status, are written to the last parameters."""
    inputs = [f"const {_array(vector.size, n)} &{vector.name}" for vector in kernel.inputs]
    outputs = [f"{_array(output.size)} &{output.name}" for output in kernel.outputs]
    status = "int" if kernel.positive else "void"
    returned = kernel.outputs[0] if status == "void" and len(outputs) == 1 else None
    result = _array(returned.size) if returned else ""
    name = kernel.name.removesuffix("_theta")
    is_hidden = name in (vector.name for vector in kernel.inputs)
    return CppArrayMethod(
        name=name,
        returns=result or status,
        parameters=", ".join(inputs if returned else [*inputs, *outputs]),
        arguments=", ".join(f"{vector.name}.data()" for vector in (*kernel.inputs, *kernel.outputs)),
        result_type=result,
        output=returned.name if returned else "",
        called=f"{owner}::{name}" if is_hidden else name,
    )


def _array(size: int, n: int | None = None) -> str:
    return "Vector" if size == n else f"std::array<Real, {size}>"
