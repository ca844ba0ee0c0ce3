"""The back end that writes CUDA packages: a header of `__device__` functions and kernels, and a host library.

The bodies of the functions are those of C packages for one state. A GPU computes one state per thread.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from psdmc.backends.c.back_end import licensed
from psdmc.backends.c.kernel_view import KernelView, VectorView
from psdmc.backends.c.make_kernel_view import is_long, sizes_of
from psdmc.backends.c.package import PackageView, package_view
from psdmc.backends.c.render import is_reserved, render
from psdmc.backends.c.self_test import SelfCheck
from psdmc.backends.describe import axis_lines, facts, option_items
from psdmc.backends.manifest import manifest
from psdmc.backends.protocol import BackEnd, Emission
from psdmc.backends.reference_states import given_name
from psdmc.backends.render import identifier_of
from psdmc.errors import InternalError
from psdmc.program.kernel import THETA_ROWS, Kernel
from psdmc.program.signature import Sizes
from psdmc.target.presets import SCALAR

LIBRARIES = frozenset(
    {"cuda", "cudart", "cudart_static", "cudadevrt", "culibos", "nvrtc", "nvptxcompiler_static"}
)
"""Libraries that nvcc and CMake link: a package's own library must not hide one of them."""


def symbol_of(robot: str, function: str) -> str:
    """Return the name of a function in CUDA, to which kernels add _states or _rows. NAME_theta_rows becomes NAME_thetas, as
    R_NAME_theta_rows is a kernel of NAME_theta."""
    stem = function.removesuffix(THETA_ROWS)
    return f"{robot}_{function if stem == function else f'{stem}_thetas'}"


def identifier(name: str) -> str:
    """Return an identifier for `name`, which is no name of C, C++ or CUDA."""
    return identifier_of(name, lambda word: word.lower() in LIBRARIES or is_reserved(word))


BLOCK = 128
"""Most threads of a block."""

TAKEN = frozenset({"state", "states", "status", "stream", "tile", "here", "first"})
"""Names of the CUDA code's own; no input or output may have one."""

ARRAYS = (
    "Arrays of one state: as in C, matrices row-major. A kernel computes one state per thread. Its arrays lie in the GPU's",
    "memory and must not overlap:",
    "  _states  entry i of the state s is at [i * states + s]; neighbouring threads read neighbouring numbers",
    "  _rows    one state after the other: entry i of the state s is at [s * size + i]",
    "  _theta   with the base parameters theta_b as an input, one theta_b for all states",
    "  _thetas  of functions NAME_theta_rows: thetas is an input like q, with one theta_b per state",
    "A function that returns int returns 0, or 1 + the number of the first pivot that is not positive. The outputs of such",
    "a state are NaN. Its kernels write these numbers into status, one per state; status may be null.",
    "Quaternions, and cosine and sine of an angle, are of length one.",
)


@dataclass(frozen=True, slots=True)
class DeviceFunction:
    """One `__device__` function, and the two kernels that call it, as C text.

    robot  identifier of the robot, with which all names begin
    """

    view: KernelView
    robot: str

    @property
    def symbol(self) -> str:
        """Name of the function; the names of its kernels end in _states and _rows."""
        return symbol_of(self.robot, self.view.name)

    @property
    def inlined(self) -> str:
        """Return the qualifier of a function that becomes part of its kernels. Arrays of the thread are then registers."""
        return "" if self.view.regions or self.view.single_body.parts else "__forceinline__ "

    @property
    def returns(self) -> str:
        return "int" if self.view.positive else "void"

    @property
    def vectors(self) -> tuple[VectorView, ...]:
        """Inputs and outputs of which each state has its own."""
        return (*self.view.inputs, *self.view.outputs)

    @property
    def parameters(self) -> str:
        """Parameters of the `__device__` function."""
        return ", ".join(self._arrays("real", ""))

    @property
    def kernel_parameters(self) -> str:
        return ", ".join([*self._arrays("real", "__restrict__ "), *self._status, "long long states"])

    @property
    def launch_parameters(self) -> str:
        """Parameters of the host function that starts a kernel."""
        arrays = self._arrays(f"{self.robot}_real", "")
        return ", ".join([*arrays, *self._status, "long long states, cudaStream_t stream"])

    @property
    def launch_arguments(self) -> str:
        """Addresses of the kernel's arguments."""
        names = [*self._names(""), *(["status"] if self.view.positive else []), "states"]
        return ", ".join(f"&{name}" for name in names)

    @property
    def call(self) -> str:
        """Call with arrays of the thread's own."""
        call = f"{self.symbol}({', '.join(self._names('own_'))})"
        return f"const int failed = {call}" if self.view.positive else call

    def _names(self, before: str) -> list[str]:
        inputs, outputs = (
            [before + vector.name for vector in vectors] for vectors in (self.view.inputs, self.view.outputs)
        )
        return [*inputs, *(["theta_b"] if self.view.theta else []), *outputs]

    def _arrays(self, real: str, qualifier: str) -> list[str]:
        inputs = [*(vector.name for vector in self.view.inputs), *(["theta_b"] if self.view.theta else [])]
        outputs = (f"{real} *{qualifier}{vector.name}" for vector in self.view.outputs)
        return [*(f"const {real} *{qualifier}{name}" for name in inputs), *outputs]

    @property
    def _status(self) -> list[str]:
        return ["int *status"] if self.view.positive else []

    @property
    def pivots(self) -> tuple[tuple[str, int], ...]:
        """Pivots and their numbers, the last one first: of several that fail, the first one counts."""
        order = reversed(self.view.pivot_order)
        return tuple((f"{self.view.positive.name}[{k}]", k + 1) for k in order) if self.view.positive else ()


@dataclass(frozen=True, slots=True)
class Trial:
    """One comparison of the self-test: the launch of a function's kernels, of which one output is compared.

    symbol     name of the function
    arrays     C text that makes each of its arrays
    compared   number of the array that is compared
    arguments  C text of the arguments
    """

    check: SelfCheck
    symbol: str
    arrays: tuple[str, ...]
    compared: int
    arguments: str


@dataclass(frozen=True, slots=True)
class CudaPackage:
    """One CUDA package. `package` is what the C back end would write for a plain processor."""

    package: PackageView
    description: tuple[str, ...]
    block: int = BLOCK

    @property
    def functions(self) -> tuple[tuple[str, tuple[DeviceFunction, ...]], ...]:
        """Descriptions of the functions, and their variants."""
        robot = self.package.robot
        return tuple(
            (
                f"{each.meaning}; {each.shape}",
                tuple(DeviceFunction(kernel, robot) for kernel in each.kernels),
            )
            for each in self.package.functions
        )

    @property
    def kernels(self) -> tuple[DeviceFunction, ...]:
        return tuple(kernel for _, kernels in self.functions for kernel in kernels)

    @property
    def macros(self) -> tuple[str, ...]:
        """Macros of the bodies, which the header undefines at its end."""
        names = ["real", "V", "LOAD", "STORE", "STORE_ZERO", "STORE_ZEROS", "CLEAR", "SPLAT"]
        names += ["SINCOS", "PART", "NOT_INLINE", "spoil", "KEPT", "KEEP", "NAME"]
        names += [f"MINUS_PRODUCT_{shape.zero}" for shape in self.package.products]
        return (*names, *(call.macro for call in self.package.calls))

    @property
    def trials(self) -> tuple[Trial, ...]:
        """Return what the self-test compares."""
        kernels = {kernel.view.name: kernel for kernel in self.kernels}
        return tuple(self._trial(check, kernels[check.kernel]) for check in self.package.self_test.checks)

    def _trial(self, check: SelfCheck, kernel: DeviceFunction) -> Trial:
        view = kernel.view
        given = ((given_name(vector.name, view.variant), vector.size) for vector in view.inputs)
        arrays = [f"given({name}_given[0], {size}, by_entry)" for name, size in given]
        arrays += ["(real *)on_device(theta_b_given, sizeof theta_b_given)"] if view.theta else []
        names = [view.function.label(output, view.theta) for output in view.function.outputs]
        compared = len(arrays) + names.index(check.name)
        arrays += [f"place({output.size})" for output in view.outputs]
        arguments = [f"arrays[{k}]" for k in range(len(arrays))]
        arguments += ["numbers"] if view.positive else []
        return Trial(check, kernel.symbol, tuple(arrays), compared, ", ".join(arguments))


def cuda_package(given: Emission) -> CudaPackage:
    """Return the data of a CUDA package. Raises InputError if there are no functions."""
    info = replace(given.info, name=identifier(given.info.name))
    plain = replace(SCALAR, forms=SCALAR.forms[:1])
    options = replace(given.options, target=plain)
    kernels = {name: _one_form(kernel, info.sizes) for name, kernel in given.kernels.items()}
    package = package_view(info, kernels, options, given.references)
    package = replace(package, info=given.info)
    signatures = [function.signature for function in package.functions]
    for kernel in package.kernels:
        if wrong := TAKEN.intersection(vector.name for vector in (*kernel.inputs, *kernel.outputs)):
            raise InternalError(f"{kernel.name}: CUDA takes {min(wrong)!r} for something else")
    description = (
        *facts(given.info, given.options),
        *ARRAYS,
        *axis_lines(given.info, signatures, package.uses_frames),
    )
    return CudaPackage(package, description)


def _one_form(kernel: Kernel, sizes: Sizes) -> Kernel:
    """The kernel in one form, for one state: straight-line code unless that is long and there is another form."""
    kernel, own = replace(kernel, batch=kernel.single, limbs=None), sizes_of(kernel, sizes)
    outputs = {q.name: own.size(q) for q in kernel.function.outputs}
    is_other = kernel.is_loop_of_calls or is_long(kernel.single, outputs)
    return kernel if is_other else replace(kernel, before=None, regions=None)


def _files(given: Emission) -> dict[str, str]:
    cuda = cuda_package(given)
    robot = cuda.package.robot
    named = {
        f"include/{robot}/{robot}.cuh": "cuda/robot.cuh.jinja",
        f"include/{robot}/{robot}.h": "cuda/robot.h.jinja",
        f"src/{robot}.cu": "cuda/robot.cu.jinja",
        "CMakeLists.txt": "cuda/CMakeLists.txt.jinja",
        "README.md": "cuda/README.md.jinja",
        "LICENSE": "LICENSE.jinja",
    }
    if given.references is not None:
        named |= {"test/self_test.cu": "cuda/self_test.cu.jinja"}
        named |= {f"test/{name}.h": f"{name}.h.jinja" for name in ("reference", "compare")}
    files = {
        path: licensed(path, render(template, cuda=cuda, package=cuda.package))
        for path, template in named.items()
    }
    options = {key: value for key, value in option_items(given.info, given.options).items() if key != "trig"}
    functions = [
        {
            "name": each.name,
            "kernels": [{"name": kernel.name, "cost": kernel.cost} for kernel in each.kernels],
        }
        for each in cuda.package.functions
    ]
    own = {"backend": "cuda", "real": cuda.package.real}
    files["manifest.json"] = manifest(robot, given.info, options, own, functions, files)
    return files


BACK_END = BackEnd(
    "CUDA",
    "prefix of CUDA names",
    _files,
    identifier,
    lambda robot: (f"include/{robot}/{robot}.cuh", f"the header, #include <{robot}/{robot}.cuh>"),
    lambda folder: f"cmake -S {folder} -B {folder}/build && cmake --build {folder}/build",
    ("trig", "target", "payload", "friction", "bodies", "estimator", "with"),
)
