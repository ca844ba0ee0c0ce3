"""The arguments of `compile`, from which this or another process builds the same robot."""

from __future__ import annotations

import hashlib
import zlib
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal
from weakref import WeakValueDictionary

from psdmc.backends.c.package import PackageView
from psdmc.emission import EmitRequest, emit_options, package_of
from psdmc.errors import InputError
from psdmc.lower.kernels import Lowering, wanted
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.load import load_bytes
from psdmc.model.store import file_bytes
from psdmc.progress import Progress, silent
from psdmc.target.target import Real, Target, Trig
from psdmc.toolchain.call import CompiledRobot
from psdmc.toolchain.compile import compiled_once
from psdmc.toolchain.interface import Origin


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
