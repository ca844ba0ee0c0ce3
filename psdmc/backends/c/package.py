"""The complete C package as data for the templates. It is made from the robot's metadata and the kernels (variants of
generated functions)."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from psdmc.backends.c.bodies import BodiesView, EstimatorView, PayloadView
from psdmc.backends.c.body import calls_of
from psdmc.backends.c.expressions import (
    LARGEST_FLOAT,
    CallView,
    CReal,
    c_real,
    call_views,
    rounded_out,
    suffix_of,
)
from psdmc.backends.c.friction import FrictionView
from psdmc.backends.c.header import CppClass, Pattern, Table, cpp_classes, description, patterns, tables
from psdmc.backends.c.kernel_view import FunctionView, KernelView
from psdmc.backends.c.lines import Shape
from psdmc.backends.c.make_kernel_view import function_views
from psdmc.backends.c.render import identifier
from psdmc.backends.c.self_test import ReferenceView, SelfTestView, reference_view
from psdmc.backends.c.vectors import VectorsView
from psdmc.backends.describe import uses_contacts, uses_frames
from psdmc.backends.info import EmitOptions, PackageInfo
from psdmc.backends.reference_states import ReferenceStates
from psdmc.errors import InputError
from psdmc.functions import RECIPES
from psdmc.program.kernel import Kernel
from psdmc.target.target import ARITHMETIC, GCC_ONLY, Target

ON_MANIFOLD = tuple(name for name, recipe in RECIPES.items() if recipe.default_where_wide)
"""Functions that lead from one q to another."""


@dataclass(frozen=True, slots=True)
class PackageView:
    """One C package as data for the templates.

    robot       identifier with which every C name starts
    references  inputs and expected results for the self-test; None: no self-test
    adapters    names of the other programs, such as CasADi, for which the package has files
    private     functions for one state that only adapters call; no header declares them
    estimator   the load estimator; None: no estimator
    """

    robot: str
    info: PackageInfo
    options: EmitOptions
    functions: tuple[FunctionView, ...]
    references: ReferenceView | None
    adapters: tuple[str, ...] = ()
    private: tuple[FunctionView, ...] = ()
    estimator: EstimatorView | None = None

    @property
    def alone(self) -> PackageView:
        """Return the same package without functions for many states."""
        target = replace(self.target, forms=self.target.forms[:1])
        return replace(self, options=replace(self.options, target=target))

    @property
    def adapter_libraries(self) -> dict[str, tuple[str, ...]]:
        """Return the adapters (files for other programs) whose C file becomes a separate shared library,
        lib<robot>_<name>. Each adapter has the C files that its library needs in addition. The files for CasADi already
        include the code of the package, and need none."""
        sources: dict[str, tuple[str, ...]] = dict.fromkeys(("casadi", "casadi_theta", "casadi_hessian"), ())
        sources |= dict.fromkeys(("fmu", "fmu2"), self.sources)
        return {name: sources[name] for name in self.adapters if name in sources}

    @property
    def fmus(self) -> dict[str, str]:
        """Return the adapters that make FMUs, each with the files that the build packs with the library."""
        named = {
            "fmu": "fmu/modelDescription.xml fmu/buildDescription.xml fmu/pack.py",
            "fmu2": "fmu2/modelDescription.xml fmu2/pack.py",
        }
        return {fmu: named[fmu] for fmu in self.adapters if fmu in named}

    @property
    def n(self) -> int:
        return self.info.n

    @property
    def dof(self) -> int:
        """Degrees of freedom: length of rates and torques."""
        return self.info.nv

    @property
    def size_macros(self) -> dict[str, int]:
        """Return the sizes that the C header defines in addition to the degrees of freedom, by name. They are joints,
        entries of q, rates, bodies, contacts, and the nonzero entries of matrices. A size is left out if the package
        does not need it."""
        wide = {"JOINTS": self.n, "NQ": self.info.nq, "NV": self.info.nv} if self.info.is_wide else {}
        wide |= {"BODIES": len(self.info.bodies.links)} if self.info.bodies else {}
        if uses_contacts(function.signature for function in self.functions):
            wide |= {"CONTACTS": self.info.sizes.contacts, "CONTACT_ROWS": self.info.sizes.contact_rows}
            wide |= {"LOOP_ROWS": self.info.sizes.loop_rows} if self.info.loops else {}
        return wide | {pattern.macro: len(pattern.places) for pattern in self.patterns}

    @property
    def patterns(self) -> tuple[Pattern, ...]:
        """Return the sparsity patterns (positions of nonzero entries) that the package lists. Listed are matrices that
        are stored without zeros. For a tree robot, all other matrices with zeros are listed, too."""
        found = patterns(self.functions)
        return tuple(each for each in found if each.is_packed or (self.info.is_tree and each.is_sparse))

    @property
    def l(self) -> int:  # noqa: E743
        return self.info.l

    @property
    def real(self) -> CReal:
        return c_real(self.options)

    @property
    def lanes(self) -> int:
        return self.options.lanes

    @property
    def target(self) -> Target:
        return self.options.target

    @property
    def arithmetic_flags(self) -> str:
        """Return the compiler flags for the arithmetic of the C code, which are equal on every machine."""
        return " ".join(ARITHMETIC)

    @property
    def gcc_flags(self) -> str:
        """Further flags for GCC alone."""
        return " ".join(GCC_ONLY)

    @property
    def suffix(self) -> str:
        """Suffix of constants and libm functions."""
        return suffix_of(self.real)

    @property
    def vectors(self) -> VectorsView:
        counts = tuple(count for function in self.functions for count in function.limbs)
        return VectorsView(self.robot, self.options, counts)

    @property
    def description(self) -> tuple[str, ...]:
        return description(self.info, self.options, self.functions, self.uses_frames)

    @property
    def tables(self) -> tuple[Table, ...]:
        own = tables(self.info, self.robot, self.real, self.uses_frames, self.target.texts)
        return (*own, *(pattern.table(self.robot) for pattern in self.patterns))

    @property
    def table_declarations(self) -> tuple[str, ...]:
        return tuple(f"extern {table.declaration}" for table in self.tables)

    @property
    def cpp_classes(self) -> tuple[CppClass, ...]:
        return cpp_classes(self.functions, self.dof)

    @property
    def cpp_sizes(self) -> dict[str, int]:
        """Constants of the C++ classes."""
        sizes = {"dof": self.dof, "base_parameters": self.l, "lanes": self.lanes}
        sizes |= {name.lower(): value for name, value in self.size_macros.items()}
        return sizes | ({"frames": len(self.info.frames)} if self.uses_frames else {})

    @property
    def sources(self) -> tuple[str, ...]:
        """C files of the library, relative to the package."""
        functions = (unit.name for function in self.functions for unit in function.units)
        names = ("tables", *functions, *self.further_functions)
        estimator = self.estimator.sources if self.estimator else ()
        return (*(f"src/{name}.c" for name in names), *estimator)

    @property
    def further_functions(self) -> tuple[str, ...]:
        """Return the names of the C files with functions for loads, bodies and friction, those that the package has."""
        own = {"payload": self.info.payload, "bodies": self.info.bodies, "friction": self.info.friction}
        return tuple(name for name, content in own.items() if content)

    @property
    def friction(self) -> FrictionView | None:
        """Return the data for the C function of the calibrated joint friction; None if there is no such function."""
        return FrictionView(self.info.friction, self.robot, self.real) if self.info.friction else None

    @property
    def payload(self) -> PayloadView | None:
        """Return the data for the C functions that add a load to theta_b; None if there are no such functions."""
        return PayloadView(self.robot, self.real, self.info.payload) if self.info.payload else None

    @property
    def bodies(self) -> BodiesView | None:
        """Return the data for the C function that computes theta_b (the base parameters) from all bodies; None if the
        package has no such function."""
        return BodiesView(self.robot, self.real, self.info.bodies) if self.info.bodies else None

    @property
    def version(self) -> str:
        """Return psdmc's version as three numbers, the form in which CMake and pkg-config compare versions."""
        found = re.match(r"(\d+)\.(\d+)(?:\.(\d+))?", self.info.psdmc_version)
        return ".".join(part or "0" for part in found.groups()) if found else "0.0.0"

    @property
    def pivot_size(self) -> int:
        """Return the number of pivots that must be positive, for functions with one output of this length."""
        found = (k.positive.size for k in self.kernels if k.positive and k.fails_alone)
        return next(found, self.n)

    @property
    def self_test(self) -> SelfTestView:
        own = self.references
        known = () if own is None else own.expected
        loads = 0 if own is None or own.load is None or self.payload is None else len(self.payload.prototypes)
        beside = loads + bool(self.info.friction) + bool(self.info.bodies)
        return SelfTestView(self.kernels, self.dof, self.options, known, beside)

    @property
    def kernels(self) -> tuple[KernelView, ...]:
        return tuple(kernel for function in self.functions for kernel in function.kernels)

    @property
    def _all_kernels(self) -> tuple[KernelView, ...]:
        """The kernels of all functions, with those that only adapters or the estimator call."""
        return (*self.kernels, *(kernel for function in self.undeclared for kernel in function.kernels))

    @property
    def undeclared(self) -> tuple[FunctionView, ...]:
        """Functions for one state that no header declares: those of adapters and of the estimator."""
        return (*self.private, *((self.estimator.momentum,) if self.estimator else ()))

    @property
    def is_mixed(self) -> bool:
        """Return whether a function of the package needs both kinds of storage. One output is then written straight
        into the array of the caller, and another is first collected in a block on the stack."""
        return any(kernel.is_mixed for kernel in self._all_kernels)

    @property
    def fails_in_several(self) -> bool:
        """Return whether a failed function sets several outputs to NaN, or one that is no vector with an entry per joint."""
        return any(k.positive and not (k.fails_alone and k.regions is None) for k in self._all_kernels)

    @property
    def products(self) -> tuple[Shape, ...]:
        """Return the sizes of all matrix products that follow straight-line code, without duplicates."""
        return tuple(sorted({p.shape for function in self.functions for p in function.products}))

    @property
    def has_parts(self) -> bool:
        """Whether some body is several functions."""
        return any(kernel.single_body.parts or kernel.lanes_body.parts for kernel in self._all_kernels)

    @property
    def has_calls_apart(self) -> bool:
        """Return whether the code calls static functions that must not be inlined. These are parts of long functions, or
        a second code for states that limbs (such as legs) in lanes cannot compute."""
        return self.has_parts or any(each.limbs and each.limbs.checked for each in self._all_kernels)

    @property
    def has_thin_products(self) -> bool:
        """Whether products follow some kernel's limbs."""
        return any(kernel.limbs and kernel.limbs.products for kernel in self.kernels)

    @property
    def has_clears(self) -> bool:
        """Whether some body clears runs of zeros."""
        return any(
            kernel.single_body.has_clears or kernel.lanes_body.has_clears for kernel in self._all_kernels
        )

    @property
    def calls(self) -> tuple[CallView, ...]:
        """Operations of some kernel that are macros."""
        bodies = [body for kernel in self._all_kernels for body in (kernel.single_body, kernel.lanes_body)]
        found = {op for body in bodies for op in body.calls}
        found |= {op for kernel in self.kernels if kernel.regions for op in kernel.regions.calls}
        return call_views(frozenset(found))

    def limb_calls(self, count: int) -> tuple[CallView, ...]:
        """Return the operations that code for `count` equal limbs, such as four legs, writes as C macros."""
        views = [kernel.limbs for kernel in self.kernels if kernel.limbs]
        stages = [stage for view in views for stage in view.stages if stage.count == count]
        return call_views(frozenset(op for stage in stages for op in stage.body.calls))

    @property
    def call_headers(self) -> tuple[str, ...]:
        """Headers that say what they mean."""
        return tuple(dict.fromkeys("operations.h" if call.has_header else "roots.h" for call in self.calls))

    @property
    def multiplies_lanes(self) -> bool:
        """Return whether batch functions of the package compute matrix products with one state per SIMD lane."""
        own = (kernel for kernel in self.kernels if kernel.single_body.products)
        return self.target.has_batches and any(not kernel.by_state for kernel in own)

    @property
    def leads_on(self) -> bool:
        """Return whether q has more entries than qd (quaternions), and the package has the functions that integrate q
        and compute differences of q."""
        names = {function.name for function in self.functions}
        return self.info.is_wide and all(recipe in names for recipe in ON_MANIFOLD)

    @property
    def failing(self) -> tuple[FunctionView, ...]:
        """Functions that can fail."""
        return tuple(function for function in self.functions if function.has_pivots)

    @property
    def uses_frames(self) -> bool:
        """Return whether a function of the package needs the named frames of the robot. It may have an input or output
        for frames, or add a load at a frame."""
        return uses_frames(function.signature for function in self.functions) or bool(self.info.payload)


def package_view(
    info: PackageInfo,
    kernels: Mapping[str, Kernel],
    options: EmitOptions,
    references: ReferenceStates | None = None,
    adapters: Sequence[str] = (),
) -> PackageView:
    """Return the C package as data for the templates.

    Raises InputError if there are no functions, or if an adapter (files for another program) is not possible for this
    package.
    """
    if not kernels:
        raise InputError(f"{info.name}: no functions to emit", "choose at least one with --functions")
    if info.l == 0:
        raise InputError(f"{info.name}: the model has no base parameters", "give its links inertia")
    _check_range(info, kernels, c_real(options))
    if (info.friction or info.in_dynamics) and options.trig == "freestanding":
        raise InputError(
            f"{info.name}: friction needs tanh, which is libm's, and the package is freestanding",
            "emit it with --trig inline, or leave --friction out",
        )
    _check_calls(info, kernels, options)
    robot = identifier(info.name)
    functions = function_views(kernels, info.sizes, robot, options, info.base_frame)
    package = PackageView(robot, info, options, functions, None, tuple(adapters))
    if references is None:
        return package
    view = reference_view(references, c_real(options), package.kernels, package.dof)
    return replace(package, references=view)


def _check_calls(info: PackageInfo, kernels: Mapping[str, Kernel], options: EmitOptions) -> None:
    """InputError where a freestanding package would call the C library."""
    for kernel in kernels.values() if options.trig == "freestanding" else ():
        for call in call_views(calls_of(kernel.single)):
            if call.is_library:
                raise InputError(
                    f"{info.name}: {kernel.name} needs {call.op}, which is libm's, and the package is freestanding",
                    "emit it with --trig inline, or leave the function out",
                )


def _check_range(info: PackageInfo, kernels: Mapping[str, Kernel], real: str) -> None:
    """InputError if a base parameter, gravity or a constant in the generated code is too large for the C type `real`.

    Joint limits are not checked. A limit that is too large for `real` is no limit, and is written as infinite.
    """
    found = [("gravity", value) for value in info.gravity]
    found += [
        (f"base parameter {parameter.equation!r}", parameter.value)
        for parameter in info.parameters
        if parameter.value is not None
    ]
    found += [
        (f"a constant of {name}", value) for name, kernel in kernels.items() for value in _constants(kernel)
    ]
    for what, value in found:
        if math.isinf(rounded_out(value, real)):
            raise InputError(
                f"{info.name}: {what} is {value:.6g}, more than float32's {LARGEST_FLOAT:.6g}",
                "emit it with --real float64, or check the robot's units",
            )


def _constants(kernel: Kernel) -> Iterable[float]:
    stages = kernel.limbs.stages if kernel.limbs else ()
    for program in (kernel.single, kernel.batch, *(stage.program for stage in stages)):
        for instr in program:
            if instr.value is not None:
                yield instr.value
    for group in kernel.limbs.groups if kernel.limbs else ():
        yield from (value for row in group.constants for value in row)
