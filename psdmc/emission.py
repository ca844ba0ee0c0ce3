"""Makes what a back end receives, from a model and the options of `emit` and `compile`: kernels, facts, reference states.

A CompileRequest has the arguments of `compile`, from which this or another process builds the same robot.
"""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal
from weakref import WeakValueDictionary

from psdmc.backends.c.adapters import with_needed
from psdmc.backends.c.package import PackageView, package_view
from psdmc.backends.info import EmitOptions, package_info
from psdmc.backends.protocol import Emission
from psdmc.backends.reference_states import reference_load, reference_states
from psdmc.errors import InputError
from psdmc.friction.joints import FrictionInDynamics
from psdmc.garbage import collecting_rarely
from psdmc.lower.admitted import require, wanted
from psdmc.lower.kernels import Lowering, lower, lower_estimator
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.linear_friction import friction_in_dynamics
from psdmc.model.load import load_bytes
from psdmc.model.store import file_bytes
from psdmc.progress import Progress, silent
from psdmc.target.presets import NATIVE, preset
from psdmc.target.target import Real, Target, Trig
from psdmc.toolchain.call import CompiledRobot
from psdmc.toolchain.compile import compiled_once, lowered_once
from psdmc.toolchain.interface import Origin, interface_of

if TYPE_CHECKING:
    from psdmc.toolchain.cuda_robot import CudaRobot, CudaSource


@dataclass(frozen=True, slots=True)
class EmitRequest:
    """Describes what a package is to contain, by the options of `compiler.emit_c`, which explains them.

    options  precision, sines and target machine
    """

    lowering: Lowering
    functions: Sequence[str] | str | None
    options: EmitOptions
    name: str | None = None
    payload: bool = False
    adapters: Sequence[str] = ()
    friction: bool | Literal["in-dynamics"] = False
    bodies: bool = False
    estimator: str | None = None
    smoothing_speed: float | None = None
    gravity_input: bool = False


@collecting_rarely()
def package_of(model: DynamicsModel, asked: EmitRequest, progress: Progress) -> PackageView:
    """Return the C package of a model."""
    made = emission(model, asked, progress)
    return package_view(made.info, made.kernels, made.options, made.references, made.adapters)


def cuda_source(model: DynamicsModel, asked: EmitRequest, progress: Progress) -> CudaSource:
    """Return the CUDA source of a model's functions, for `compile` with the target "cuda"."""
    from psdmc.backends.c.render import render
    from psdmc.backends.cuda.back_end import cuda_package
    from psdmc.toolchain.cuda_robot import CudaSource  # it makes a method for each function, which takes time

    cuda = cuda_package(replace(emission(model, asked, progress), references=None))
    text = render("cuda/robot.cuh.jinja", cuda=cuda, package=cuda.package)
    failing = frozenset(kernel.view.name for kernel in cuda.kernels if kernel.view.positive)
    return CudaSource(text, cuda.package.robot, interface_of(cuda.package), failing)


def cuda_robot(
    model: DynamicsModel, asked: EmitRequest, progress: Progress, target: str, absent: Mapping[str, object]
) -> CudaRobot:
    """Return the robot of a target "cuda", the first GPU, or "cuda:N". Raises InputError if the caller chose one of the
    options that are absent there."""
    from psdmc.toolchain.cuda_libraries import Driver
    from psdmc.toolchain.cuda_robot import CudaRobot

    if refused := [name for name, given in absent.items() if given]:
        raise InputError(
            f"target {target!r} has no option {refused[0]}", "leave it out, or compile for the CPU"
        )
    number = target.partition(":")[2] or "0"
    if not number.isdecimal():
        raise InputError(f"target is {target!r}", 'write "cuda", or "cuda:1" for the second GPU')
    driver = Driver(int(number))

    def source(names: Sequence[str] | str | None) -> CudaSource:
        return cuda_source(model, replace(asked, functions=names), progress)

    made = source(asked.functions)
    progress("compiling")
    return CudaRobot(made, driver, source if asked.functions is None else None)


def emission(model: DynamicsModel, asked: EmitRequest, progress: Progress) -> Emission:
    """Return what a back end receives for a model: the kernels of its functions, facts and reference states. Raises
    InputError as `compiler.emit_c` does."""
    options, estimator, gravity_input = asked.options, asked.estimator, asked.gravity_input
    names = functions_of(model, asked.functions, asked.adapters, gravity_input)
    law = _friction_in_dynamics(model, asked.friction, asked.smoothing_speed)
    if estimator and law is not None:
        raise InputError(
            "an estimator cannot have friction in the dynamics: its torques contain no friction",
            "write --friction, and subtract the torques of R_friction from those of the motors",
        )
    _check_gravity_input(gravity_input, estimator)
    require(model, names)
    costs = options.target.costs
    key = (model.content_hash, asked.lowering, repr(costs), *names)
    key += (law.key,) if law else ()
    kernels = lowered_once(
        (*key, "gravity input") if gravity_input else key,
        lambda: lower(
            model, asked.lowering, names, progress, costs=costs, friction=law, gravity_input=gravity_input
        ),
        gravity_input,
    )
    shown: dict[str, str] = {"lowering": asked.lowering, "real": options.real, "trig": options.trig}
    if estimator:
        shown["estimator"] = estimator
    momenta = None if estimator is None else lower_estimator(model, estimator, costs)
    if law is not None:
        shown |= {"friction": "in-dynamics", "smoothing-speed": repr(law.friction.sign_speed)}
    if gravity_input:
        shown["gravity-input"] = "yes"
    own = None if law is None else law.friction
    info = package_info(model, asked.name, shown, asked.payload, asked.friction is True, asked.bodies, own)
    references = reference_states(model, names, friction=law, gravity_input=gravity_input)
    if asked.payload:
        references = replace(references, load=reference_load(model))
    return Emission(info, kernels, options, references, tuple(asked.adapters), momenta)


def _check_gravity_input(gravity_input: object, estimator: str | None) -> None:
    """InputError where gravity cannot be an input."""
    if not isinstance(gravity_input, bool):
        raise InputError(
            f"gravity_input is {gravity_input!r}, expected True or False", "the default is False"
        )
    if gravity_input and estimator:
        raise InputError(
            "an estimator cannot have gravity as an input: its own functions give none",
            "leave --gravity-input out, or write two packages",
        )


def _friction_in_dynamics(
    model: DynamicsModel, friction: bool | str, speed: float | None
) -> FrictionInDynamics | None:
    """The friction that motor torques contain, None without the option."""
    if friction == "in-dynamics":
        return friction_in_dynamics(model, speed)
    if friction not in (True, False):
        raise InputError(f"friction is {friction!r}", "choose --friction or --friction=in-dynamics")
    if speed is not None:
        raise InputError("a smoothing speed without friction in the dynamics", "add --friction=in-dynamics")
    return None


def functions_of(
    model: DynamicsModel, functions: Sequence[str] | str | None, adapters: Sequence[str], gravity_input: bool
) -> tuple[str, ...]:
    """Return the functions of a package, with those that its adapters need."""
    named = wanted(functions, model.mechanism)
    return wanted(with_needed(named, adapters, model.nq > model.nv, gravity_input), model.mechanism)


def emit_options(
    lowering: str, real: Real | None = None, trig: Trig | None = None, target: str | Target = NATIVE
) -> EmitOptions:
    """Return the options; precision and sines are the target's by default. Raises InputError for an unknown choice."""
    machine = preset(target) if isinstance(target, str) else target
    real, trig = real or machine.real, trig or machine.trig
    _choose("lowering", lowering, ("auto", "expanded", "factored"))
    _choose("real", real, ("float64", "float32"))
    _choose("trig", trig, ("inline", "libm", "freestanding"))
    return EmitOptions(real, trig, machine)


def listed(given: Sequence[str] | str) -> Sequence[str]:
    """Return a sequence of names, from such a sequence or one name."""
    return (given,) if isinstance(given, str) else given


def _choose(option: str, value: str, allowed: Sequence[str]) -> None:
    if value not in allowed:
        raise InputError(f"{option} is {value!r}", f"choose one of {', '.join(allowed)}")


@dataclass(frozen=True, slots=True, eq=False)
class CompileRequest:
    """The arguments of `compile`. Instead of a compiled robot, they go to other processes, which open the library from
    their cache or compile it.

    model       the model, or its file's content, compressed, which is read only if psdmc compiles
    model_hash  the model's content hash
    names       of the functions to compile at once
    """

    model: DynamicsModel | bytes
    model_hash: str
    names: tuple[str, ...]
    lowering: Lowering
    functions: tuple[str, ...] | None
    real: Real | None
    trig: Trig | None
    target: str | Target
    friction: Literal[False, "in-dynamics"]
    smoothing_speed: float | None
    gravity_input: bool = False

    def __reduce__(self) -> tuple[Any, ...]:
        filed = self.model if isinstance(self.model, bytes) else zlib.compress(file_bytes(self.model))
        _, *others = (getattr(self, field.name) for field in fields(self))
        return CompileRequest, (filed, *others)

    @property
    def key(self) -> str:
        """A text that is equal for two calls of `compile` with equal results: a hash of the model and of all options."""
        parts = [getattr(self, field.name) for field in fields(self) if field.name not in ("model", "names")]
        return hashlib.sha256(repr(parts).encode()).hexdigest()

    def compiled(self, progress: Progress = silent) -> CompiledRobot[Any]:
        """Compile the robot that this request describes, or get it from the cache."""
        options = emit_options(self.lowering, self.real, self.trig, self.target)
        machine = options.target
        if not machine.has_batches:
            raise InputError(
                f"target {machine.name} has no functions for many states, which Python calls",
                "emit a package for it: psdmc emit-c --target",
            )

        def make() -> PackageView:
            asked = EmitRequest(
                self.lowering,
                self.functions,
                options,
                friction=self.friction,
                smoothing_speed=self.smoothing_speed,
                gravity_input=self.gravity_input,
            )
            package = package_of(self.opened(), asked, progress)
            progress("compiling")
            return package

        parts = (self.model_hash, self.lowering, options.real, options.trig, *self.names)
        law = (self.friction, self.smoothing_speed)
        parts += (f"friction {law}",) if self.friction or self.smoothing_speed is not None else ()
        parts += (f"gravity input {self.gravity_input!r}",) if self.gravity_input is not False else ()

        def more(function: str) -> CompiledRobot[Any]:
            return replace(self, functions=(function,), names=wanted((function,))).compiled(progress)

        interface, library = compiled_once(parts, make, machine)
        origin = Origin(_again, self, self.key)
        robot: CompiledRobot[Any] = CompiledRobot(
            interface, library, more if self.functions is None else None, origin
        )
        _ROBOTS[self.key] = robot
        return robot

    def opened(self) -> DynamicsModel:
        """Return the model of this request, which a pickled request stores as compressed bytes."""
        if isinstance(self.model, bytes):
            return load_bytes(zlib.decompress(self.model), Path("(model of a pickled robot)"))
        return self.model


_ROBOTS: WeakValueDictionary[str, CompiledRobot[Any]] = WeakValueDictionary()
"""Robots of this process by their requests' keys: what comes from another process is compared with them first."""


def _again(request: CompileRequest) -> CompiledRobot[Any]:
    """The robot of a request that was pickled, here or in another process."""
    return _ROBOTS.get(request.key) or request.compiled()
