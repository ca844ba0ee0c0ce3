"""The adapter that makes the generated functions external functions of CasADi, with exact derivatives.

The calling convention is in CasADi's user guide ("Using the generated code") and in the reference of
Function::jacobian. For a function f, the library exports f, and helper functions such as f_n_in and f_sparsity_out.

The library also exports jac_f, which computes one matrix of derivatives for each pair of an output and an input. The
inputs of jac_f are the inputs and then the outputs of f. The outputs of f are not read, and CasADi is informed of this
by empty sparsity patterns. Matrices are stored column by column, without their zeros.

CasADi differentiates by the entries of q. If q contains quaternions, CasADi's f normalizes them before it calls the
generated function. The generated derivative is by the rates (the tangent vector). The adapter multiplies this
derivative by d tangent / dq.

casadi_externals.py writes the external functions. casadi_kernels.py makes the derivatives that no generated function
computes from PROGRAMs: Jacobians of other functions, and second derivatives. For these, CasADi looks for jac_adj1_f, the
Jacobian of the gradient adj1_f.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from psdmc.backends.c.adapters.casadi_externals import (
    DERIVATIVES,
    DIRECTION,
    GRADIENT,
    LINEAR,
    MAP,
    PARAMETERS,
    REGRESSOR,
    External,
    Externals,
    Pattern,
    has_blocks,
    nonzeros,
)
from psdmc.backends.c.adapters.casadi_kernels import (
    ADJOINT,
    JACOBIAN,
    SECOND,
    Derived,
    has_small_jacobian,
)
from psdmc.backends.c.kernel_view import KernelView
from psdmc.backends.c.package import PackageView
from psdmc.backends.c.render import render
from psdmc.backends.info import PackageInfo
from psdmc.errors import InputError
from psdmc.functions import RECIPES
from psdmc.program.kernel import Kernel
from psdmc.program.signature import Signature, Sizes
from psdmc.robot.mechanism import Mechanism
from psdmc.target.target import Costs

FIRST, BY_THETA, HESSIANS = "casadi", "casadi_theta", "casadi_hessian"
"""The adapters: functions with first derivatives; the same with theta_b as an input; and with second derivatives."""


@dataclass(frozen=True, slots=True)
class CasadiView:
    """The data that the template adapters/casadi.c.jinja prints.

    robot    identifier with which every C name starts
    library  ending of the library's name
    hidden   generated functions that have the same name as a CasADi function; they are compiled under other names
    zeros    length of the longest input: CasADi may omit an input, which is then read as this many zeros
    units    index ranges (start, end) of q that must have length one (quaternions)
    nq       length of q
    nv       number of rates, the length of qd
    map      (row, column) of each entry of d tangent / dq (from dq to the rates) that may differ from zero
    spoils   whether all results become NaN if a generated function fails
    helpers  C functions of casadi_calls.h.jinja that are called
    """

    robot: str
    library: str
    externals: tuple[External, ...]
    patterns: tuple[Pattern, ...]
    hidden: tuple[str, ...]
    sources: tuple[str, ...]
    zeros: int
    units: tuple[tuple[int, int], ...]
    nq: int
    nv: int
    map: tuple[tuple[int, int], ...]
    spoils: bool
    helpers: frozenset[str]


def needed(functions: Sequence[Signature], wide: bool, theta: bool = False) -> list[str]:
    """Return the names of the functions that the derivatives of the given functions need in the package.

    wide   whether q has more entries than qd (quaternions)
    theta  whether derivatives by theta_b (the base parameters) are needed, too
    """
    found = [function.name + DERIVATIVES for function in functions if has_blocks(function)]
    return found + [MAP] * wide + [REGRESSOR] * (theta and bool(found))


def _is_by_program(function: Signature, sizes: Sizes, theta: bool = False) -> bool:
    """True if psdmc makes the Jacobian of a function from its PROGRAM: no function computes it, and it is not too large."""
    if not _is_differentiated(function.name):
        return False
    is_known = has_blocks(function) and (not theta or RECIPES[function.name].polynomials in LINEAR)
    return not is_known and has_small_jacobian(function, sizes, theta)


def _is_differentiated(name: str) -> bool:
    """True if a function has inputs, and does not compute derivatives or the tangent map."""
    ending = (DERIVATIVES, GRADIENT, PARAMETERS, DIRECTION, MAP)
    return name in RECIPES and bool(RECIPES[name].signature.inputs) and not name.endswith(ending)


def own_kernels(
    kernels: Mapping[str, Kernel], adapters: Sequence[str], info: PackageInfo, costs: Costs
) -> list[Kernel]:
    """Return the kernels of derivatives that these adapters need in addition to the functions of the package."""
    found: list[Kernel] = []
    for kernel in kernels.values():
        name, derived = kernel.function.name, Derived(kernel, info, costs)
        if kernel.is_loop_of_calls or not any(_is_of(adapter, kernel) for adapter in adapters):
            continue
        if _is_by_program(kernel.function, info.sizes, kernel.theta):
            found.append(derived.jacobian)
        if HESSIANS in adapters and not kernel.theta and _is_differentiated(name):
            found += [derived.adjoint, derived.second]
    return found


def _is_of(adapter: str, kernel: Kernel | KernelView) -> bool:
    """True if the library of an adapter has this variant of a function."""
    wants = kernel.theta == (adapter == BY_THETA and kernel.function.theta)
    return adapter in (FIRST, BY_THETA, HESSIANS) and wants


def files(package: PackageView, adapter: str = FIRST) -> dict[str, str]:
    """Return the C file of an adapter, as a mapping from its path to its text.

    The file includes the C files of the package and is compiled to a separate shared library. Raises InputError if
    CasADi cannot call the functions of the package.
    """
    path = f"{adapter}/{package.robot}_{adapter}.c"
    return {path: render("adapters/casadi.c.jinja", view=_view(package, adapter))}


def remark(robot: Mechanism, functions: Sequence[str], l: int) -> str | None:
    """Return a text for users that says how the CasADi functions of this robot treat quaternions and which lack
    derivatives. Return None if q has exactly one entry for each rate.

    l  number of base parameters
    """
    if robot.nq == robot.nv:
        return None
    wide = next(joint for joint in robot.joints if joint.type.nq > joint.type.nv)
    whose = "a floating base" if robot.has_floating_base else f"joint {wide.name!r}"
    sizes = Sizes.of(robot, l)
    known = {name: RECIPES[name].signature for name in functions if name in RECIPES}
    without = [name for name, own in known.items() if not (has_blocks(own) or _is_by_program(own, sizes))]
    rest = f"; without derivatives: {', '.join(without)}" if without else ""
    return f"CasADi functions normalize the q of {whose} and differentiate by each of its entries{rest}"


def _view(package: PackageView, adapter: str) -> CasadiView:
    """Describe a package for the template of a CasADi adapter. Raises InputError if the package computes in float, or if the
    base parameters are unknown and not an input."""
    info, theta = package.info, adapter == BY_THETA
    if package.real != "double":
        raise InputError("CasADi's numbers are double, the package's float", "leave out --real float32")
    endings = (JACOBIAN, ADJOINT, SECOND) if adapter == HESSIANS else (JACOBIAN,)
    units = {
        unit.name: kernel
        for function in (*package.functions, *package.private)
        for unit in function.units
        for kernel in unit.kernels
        if _is_of(adapter, kernel)
        and (function in package.functions or function.signature.name.endswith(endings))
    }
    kernels = {kernel.function.name: kernel for kernel in units.values()}
    if not kernels:
        raise InputError(
            "CasADi needs the base parameters, and this model's are unknown",
            "calibrate the model first, or write --with casadi_theta, which takes theta_b as an input",
        )
    made = Externals(kernels, info)
    own = {function.name for function in package.functions}
    externals = tuple(one for name, kernel in kernels.items() if name in own for one in made.of(kernel))
    tangent = kernels[MAP].outputs[0] if info.units else None
    longest = (vector.size for kernel in kernels.values() for vector in kernel.inputs)
    return CasadiView(
        robot=package.robot,
        library=adapter,
        externals=externals,
        patterns=made.patterns.all,
        hidden=tuple(sorted({symbol for external in externals for symbol in external.symbols})),
        sources=tuple(f"{unit}.c" for unit in units),
        zeros=max((*longest, info.l if theta else 0), default=1),
        units=info.units,
        nq=info.nq,
        nv=info.nv,
        map=tuple(divmod(k, info.nq) for k in nonzeros(tangent)) if tangent else (),
        spoils=theta or bool(info.units),
        helpers=frozenset(made.helpers),
    )
