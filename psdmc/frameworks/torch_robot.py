"""A robot's generated functions as PyTorch operators on CPU tensors, with derivatives in forward and reverse mode.

psdmc registers each function as an operator of torch.library, so torch.compile keeps it in its graph. The operator
passes the memory of the tensors to the compiled C code. Its derivatives follow the rules of differentiation.py.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, ClassVar

import torch
from torch._functorch.utils import enable_single_level_autograd_function
from torch.autograd.function import _SingleLevelFunction

from psdmc.compiler import compile as compiled
from psdmc.frameworks.coordinates import ON_COORDINATES, Coordinates
from psdmc.frameworks.differentiation import (
    ArgumentError,
    Rule,
    no_derivatives,
    refuse_constant,
    require_rule,
    rule_of,
)
from psdmc.functions import SIGNATURES, no_function
from psdmc.lower.kernels import Lowering
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.load import model_of
from psdmc.model.parameter_checks import for_every_gravity
from psdmc.program.kernel import GRAVITY, THETA_ROWS, takes_gravity
from psdmc.program.signature import Q, Quantity, Signature, Sizes
from psdmc.target.presets import NATIVE
from psdmc.target.target import Real, Target, Trig
from psdmc.toolchain.call import CompiledRobot
from psdmc.toolchain.call_arguments import with_gravity
from psdmc.toolchain.compiled_functions import results
from psdmc.toolchain.stubs import arguments

Tensor = Any
"""A torch.Tensor. mypy sees no types of PyTorch, which is optional."""

REALS: dict[Any, Real] = {torch.float64: "float64", torch.float32: "float32"}
"""Precisions of the C code, by dtypes of tensors."""

ARRAYS = SimpleNamespace(**(vars(torch) | {"moveaxis": torch.movedim}))
"""PyTorch as rules need it: vmap does not know torch.moveaxis, another name of torch.movedim."""

THETA_B = Quantity("theta_b", ("l",))

_LIBRARY = torch.library.Library("psdmc", "FRAGMENT")
"""Operators are registered as long as this lives."""

_ASKED: ContextVar[str | None] = ContextVar("_ASKED", default=None)
"""While a rule calls an operator: the name of the function that the user called and that the rule differentiates."""

_ROBOTS: dict[str, TorchRobot] = {}
"""Robots of this process by their requests. They stay, because operators of PyTorch do."""


def torch_robot(
    model: DynamicsModel | str | Path,
    lowering: Lowering = "auto",
    trig: Trig | None = None,
    target: str | Target = NATIVE,
    gravity_input: bool = False,
) -> TorchRobot:
    """Return the robot of a model for PyTorch. Equal options give the same object; `psdmc.torch` explains the options."""
    found = model_of(model)
    options = (lowering, trig, target, gravity_input)
    key = hashlib.sha256(repr((found.content_hash, *options)).encode()).hexdigest()
    if key not in _ROBOTS:
        if gravity_input:
            for_every_gravity(found)  # raises InputError for a model without all parameters
        _ROBOTS[key] = TorchRobot(found, options, key)
    return _ROBOTS[key]


class TorchRobot:
    """A robot whose methods, one for each generated function, take and return CPU tensors. `psdmc.torch` makes such
    robots.

    The methods have the arguments of the methods of a CompiledRobot, without `out`. All tensors of a call are float64,
    or all are float32. Inputs with one number per state, such as a time step dt, can also be numbers of Python. Leading
    axes broadcast, those of theta_b too. If the mass matrix of a state is not positive definite, the results of this
    state are NaN. A method with several results returns a named tuple.

    The quaternions in q can have any length but zero: the methods normalize q first. A derivative by q is the
    derivative by its nq entries. In the direction of a quaternion, which only changes the length, the derivative is
    zero. Second derivatives are not available.
    """

    def __init__(self, model: DynamicsModel, options: tuple[Any, ...], key: str) -> None:
        self.model = model
        """The model, with the names, sizes and limits of the robot."""
        self.coordinates = Coordinates.of(model.mechanism, ARRAYS)
        self._options = options
        self._gravity = tuple(model.mechanism.gravity.tolist()) if options[-1] else None
        self._compiled: dict[Any, CompiledRobot[Any]] = {}
        self._operators = {
            name: _Operator(self, self.signature(function)).registered(f"{name}_{key[:16]}")
            for name, function in SIGNATURES.items()
            if function.inputs
        }

    def __reduce__(self) -> tuple[Any, ...]:
        return torch_robot, (self.model, *self._options)

    def __deepcopy__(self, memo: object) -> TorchRobot:
        return self

    def __repr__(self) -> str:
        return f"TorchRobot {self.model.mechanism.name!r}: {self.model.n} joints"

    def compiled(self, dtype: Any = torch.float64) -> CompiledRobot[Any]:
        """Return the CompiledRobot that the methods call for tensors of the given floating-point type."""
        if dtype not in self._compiled:
            lowering, trig, target, gravity_input = self._options
            self._compiled[dtype] = compiled(
                self.model,
                lowering,
                real=REALS[dtype],
                trig=trig,
                target=target,
                gravity_input=gravity_input,
            )
        return self._compiled[dtype]

    @property
    def theta_b(self) -> Tensor:
        """Return the model's base parameters as a new float64 tensor (l,), SI units; None if they are unknown."""
        known = self.compiled().theta_b
        return None if known is None else torch.tensor(known)

    def shape(self, quantity: Quantity) -> tuple[int, ...]:
        """Return the shape of a function's input or output for one state."""
        return Sizes.of(self.model.mechanism, self.model.l).shape(quantity.axes)

    def signature(self, function: Signature) -> Signature:
        """Return the signature of the function's operator, whose last input can be gravity."""
        return function if self._gravity is None else takes_gravity(function)

    def gravity_of(self, function: Signature, like: Tensor, gravity: Tensor | None) -> tuple[Tensor, ...]:
        """Return gravity as the operator's input, or no tensor if the operator has no such input. The default is the
        model's gravity. Raises InputError if gravity is given and no input."""
        own = None if self._gravity is None else like.new_tensor(self._gravity)
        return with_gravity(self.model.mechanism.name, function, (), gravity, own)[1]

    def operator(self, function: str) -> Any:
        """Return PyTorch's operator that calls a generated function on tensors, and theta_b or None."""
        return self._operators[function]

    def _on_coordinates(self, function: Signature, tensors: Sequence[Tensor]) -> Tensor:
        operator = _Operator(self, function)
        _, _, lead = operator.checked(tensors)
        states = [
            operator.normalized(quantity, tensor).expand(*lead, *self.shape(quantity))
            for quantity, tensor in zip(function.inputs, tensors, strict=True)
        ]
        return getattr(self.coordinates, ON_COORDINATES[function.name])(*states)

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Callable[..., Any]: ...

    else:

        def __getattr__(self, name: str) -> Any:
            raise no_function(self, name)


def _fault(names: Sequence[str], required: int, given: Sequence[object], named: Mapping[str, object]) -> str:
    """Return what is wrong with the arguments of a function that takes the arguments `names`, the first few required."""
    if len(given) > len(names):
        return f"{len(given)} tensors were given"
    if unknown := [name for name in named if name not in names]:
        return f"there is no argument {unknown[0]}"
    if twice := [name for name in names[: len(given)] if name in named]:
        return f"{twice[0]} was given twice"
    missing = [name for name in names[len(given) : required] if name not in named]
    return f"{' and '.join(missing)} {'was' if len(missing) == 1 else 'were'} not given"


def _method(function: Signature) -> Callable[..., Any]:
    names, result = arguments(function), results(function)
    required = len(function.inputs)
    scalars = [k for k, quantity in enumerate(function.inputs) if not quantity.axes]

    def method(self: TorchRobot, *given: Any, **named: Any) -> Any:
        gravity = named.pop(GRAVITY.name, None)
        missing = [name for name in names[len(given) : required] if name not in named]
        if missing or len(given) > len(names) or any(name not in names[len(given) :] for name in named):
            raise TypeError(f"{function.name}({', '.join(names)}): {_fault(names, required, given, named)}")
        tensors = [*given, *(named.get(name) for name in names[len(given) :])]
        for k in scalars:
            tensors[k] = _as_scalar(tensors[k], like=tensors[0])
        for name, tensor in zip(names, tensors, strict=True):
            _refuse_elsewhere(f"{function.name}: {name}", tensor, is_optional=name == "theta_b")
        _refuse_elsewhere(f"{function.name}: {GRAVITY.name}", gravity, is_optional=True)
        if function.name in ON_COORDINATES:
            return self._on_coordinates(function, tensors)
        tensors[required:required] = self.gravity_of(function, tensors[0], gravity)
        found = self.operator(function.name)(*tensors)
        return result(*found) if len(function.outputs) > 1 else found

    method.__name__, method.__qualname__ = function.name, f"{TorchRobot.__name__}.{function.name}"
    method.__doc__ = f"{function.summary}\n\nSee `psdmc.CompiledRobot.{function.name}` for shapes and units."
    return method


def _as_scalar(given: Any, like: Any) -> Any:
    """A number as a tensor () of the type of `like`; anything else as it is."""
    is_number = isinstance(given, (int, float)) and isinstance(like, torch.Tensor)
    return torch.full((), given, dtype=like.dtype) if is_number else given


def _refuse_elsewhere(what: str, tensor: Any, is_optional: bool) -> None:
    """TypeError for what is no tensor, ArgumentError for tensors that are not in the CPU's memory."""
    if tensor is None and is_optional:
        return
    if not isinstance(tensor, torch.Tensor):
        raise TypeError(f"{what} is a {type(tensor).__name__}, expected a torch.Tensor")
    if tensor.device.type != "cpu" or tensor.layout != torch.strided:
        where = f"on the device {tensor.device}" if tensor.device.type != "cpu" else f"{tensor.layout}"
        remedy = "to_dense()" if tensor.device.type == "cpu" else "to('cpu')"
        raise ArgumentError(
            f"{what} is {where}; psdmc computes on the CPU with dense tensors", f"call {remedy} on the tensor"
        )


def _constant(function: Signature) -> Callable[..., Any]:
    def method(self: TorchRobot, dtype: Any = torch.float64) -> Tensor:
        return torch.tensor(getattr(self.compiled(dtype), function.name)())

    method.__name__, method.__doc__ = function.name, function.summary
    return method


for _function in SIGNATURES.values():
    setattr(TorchRobot, _function.name, (_method if _function.inputs else _constant)(_function))


@dataclass(frozen=True, slots=True)
class _Calls:
    """The functions that rules call: operators of one robot, with the caller's theta_b, for the function that the user
    asked for."""

    robot: TorchRobot
    asked: str
    theta_b: Tensor
    gravity: Tensor | None = None
    arrays: ClassVar[Any] = ARRAYS

    def under(self, gravity: Tensor) -> _Calls:
        return replace(self, gravity=gravity)

    def call(self, function: str, *inputs: Tensor) -> tuple[Tensor, ...]:
        signature = self.robot.signature(SIGNATURES[function])
        none = (
            inputs[0].new_zeros(3) if self.gravity is None else self.gravity
        )  # zero where its effects cancel
        gravity = (none,) if GRAVITY in signature.inputs else ()
        theta = (self.theta_b,) if SIGNATURES[function].theta else ()
        token = _ASKED.set(self.asked)
        try:
            found = self.robot.operator(function)(*inputs, *gravity, *theta)
        finally:
            _ASKED.reset(token)
        return found if isinstance(found, tuple) else (found,)


@dataclass(frozen=True, slots=True)
class _Operator:
    """One function as an operator: its kernel, and its rules for autograd, for vmap and for tensors without values.

    The operator's arguments are the function's inputs and, if it takes parameters, theta_b or None.
    """

    robot: TorchRobot
    function: Signature

    def registered(self, name: str) -> Any:
        """Register this generated function with PyTorch as an operator of the given name, and return the operator."""
        given = [f"Tensor {quantity.name}" for quantity in self.function.inputs]
        given += ["Tensor? theta_b=None"] if self.function.theta else []
        returned = ", ".join(["Tensor"] * len(self.function.outputs))
        schema = f"({', '.join(given)}) -> ({returned})"
        torch.library.define(f"psdmc::{name}", schema, lib=_LIBRARY, tags=(torch.Tag.pt2_compliant_tag,))
        operator = getattr(torch.ops.psdmc, name).default
        for key, kernel in (("CPU", self.compute), ("Autograd", self.differentiable(operator))):
            torch.library.impl(f"psdmc::{name}", key, kernel, lib=_LIBRARY)
        torch.library.register_fake(f"psdmc::{name}", self.without_values, lib=_LIBRARY)
        torch.library.register_vmap(f"psdmc::{name}", self.over_batches(operator), lib=_LIBRARY)
        return operator

    def compute(self, *given: Tensor) -> Any:
        """Compute the results by a call of the C function on the memory of the tensors. A tensor is copied only if its
        entries are not contiguous for each state."""
        inputs, theta_b, lead = self.checked(given)
        made = self._results(inputs[0], lead, theta_b is not None)
        named = list(
            zip(self.function.inputs, map(self.normalized, self.function.inputs, inputs), strict=True)
        )
        kernel, own = self.function.name, []
        if theta_b is not None and theta_b.numel() == theta_b.shape[-1]:
            kernel, own = f"{kernel}_theta", [theta_b.contiguous()]
        elif theta_b is not None:
            kernel, named = f"{kernel}{THETA_ROWS}", [*named, (THETA_B, theta_b)]
        rows = [
            tensor.expand((*lead, *self.robot.shape(quantity))).contiguous() for quantity, tensor in named
        ]
        places = [tensor.data_ptr() for tensor in (*rows, *own, *made)]
        self.robot.compiled(inputs[0].dtype).call_at(kernel, math.prod(lead), places)
        return made[0] if len(made) == 1 else tuple(made)

    def without_values(self, *given: Tensor) -> Any:
        """Return tensors with the results' shapes but no values, which torch.compile needs for its trace."""
        inputs, theta_b, lead = self.checked(given)
        made = self._results(inputs[0], lead, theta_b is not None)
        return made[0] if len(made) == 1 else tuple(made)

    def differentiable(self, operator: Any) -> Callable[..., Any]:
        """Return the function that PyTorch calls for differentiable arguments. It calls the operator, and saves the
        values that the differentiation rule needs.

        PyTorch's custom_op has no forward mode, and torch.compile cannot trace an autograd.Function with forward mode.
        An autograd.Function within the operator's kernel (the function that PyTorch runs) has neither limit (decision
        0156).
        """

        def forward(*given: Tensor) -> Any:
            with torch._C._AutoDispatchBelowAutograd():
                return operator(*given)

        parts = {"forward": forward, "setup_context": self._keep, "backward": self._back, "jvp": self._along}
        made = {name: staticmethod(part) for name, part in parts.items()}
        function: Any = type(self.function.name, (_SingleLevelFunction,), made)

        def kernel(*given: Tensor) -> Any:
            with enable_single_level_autograd_function():
                return function.apply(*given, *(None,) * (len(arguments(self.function)) - len(given)))

        return kernel

    def over_batches(self, operator: Any) -> Callable[..., Any]:
        """Return the function by which torch.func.vmap calls the operator: the batch axis becomes the first leading one."""
        quantities = (*self.function.inputs, THETA_B)

        def rule(info: Any, dims: Sequence[int | None], *given: Tensor) -> Any:
            pairs = list(zip(quantities, given, dims, strict=False))
            ranks = [x.ndim - len(q.axes) - (dim is not None) for q, x, dim in pairs if x is not None]
            moved = []
            for quantity, tensor, dim in pairs:
                if dim is not None:
                    tensor = tensor.movedim(dim, 0)
                    missing = max(ranks) - (tensor.ndim - len(quantity.axes) - 1)
                    tensor = tensor.reshape(tensor.shape[0], *[1] * missing, *tensor.shape[1:])
                moved.append(tensor)
            found = operator(*moved)
            return found, (0,) * len(found) if isinstance(found, tuple) else 0

        return rule

    def _keep(self, context: Any, inputs: tuple[Tensor, ...], output: Any) -> None:
        """Keep the inputs, and positions among the outputs of a robot with quaternions."""
        outputs = output if isinstance(output, tuple) else (output,)
        pairs = list(zip(self.function.outputs, outputs, strict=True))
        kept = (*inputs, *(tensor for quantity, tensor in pairs if self._is_wide(quantity)))
        context.save_for_backward(*kept)
        context.save_for_forward(*kept)
        context.set_materialize_grads(False)
        context.shapes = [tensor.shape for tensor in outputs]
        context.asked = _ASKED.get() or self.function.name

    def _back(self, context: Any, *cotangents: Tensor) -> Any:
        """Return the gradients by the operator's arguments."""
        needed, coordinates = context.needs_input_grad, self.robot.coordinates
        if all(cotangent is None for cotangent in cotangents):
            return (None,) * len(needed)
        rule = self._rule(needed, context.asked)
        inputs, theta_b, positions = self._kept(context)
        weights = []
        for quantity, cotangent, shape in zip(self.function.outputs, cotangents, context.shapes, strict=True):
            weight = inputs[0].new_zeros(shape) if cotangent is None else cotangent
            if self._is_wide(quantity):
                weight = coordinates.pulled_back(positions.pop(0), weight)
            weights.append(weight)
        by_theta = theta_b is not None and needed[-1]
        found, theta = rule.back(
            _Calls(self.robot, context.asked, theta_b), tuple(inputs), tuple(weights), by_theta
        )
        gradients = [
            coordinates.gradient(tensor, gradient) if self._is_wide(quantity) else gradient
            for quantity, tensor, gradient in zip(self.function.inputs, inputs, found, strict=True)
        ]
        pairs = zip((*inputs, theta_b), (*gradients, theta), needed, strict=False)
        return tuple(gradient.sum_to_size(tensor.shape) if need else None for tensor, gradient, need in pairs)

    def _along(self, context: Any, *tangents: Tensor) -> Any:
        """Return the results' derivatives along tangents of the operator's arguments."""
        coordinates, moves = self.robot.coordinates, [tangent is not None for tangent in tangents]
        rule = self._rule(moves, context.asked)
        inputs, theta_b, positions = self._kept(context)
        along = []
        for quantity, tensor, tangent in zip(self.function.inputs, inputs, tangents, strict=False):
            moved = torch.zeros_like(tensor) if tangent is None else tangent
            along.append(coordinates.tangent(tensor, moved) if self._is_wide(quantity) else moved)
        dtheta = tangents[-1] if self.function.theta else None
        found = rule.along(_Calls(self.robot, context.asked, theta_b), tuple(inputs), tuple(along), dtheta)
        made = tuple(
            coordinates.rates(positions.pop(0), tangent) if self._is_wide(quantity) else tangent
            for quantity, tangent in zip(self.function.outputs, found, strict=True)
        )
        return made[0] if len(made) == 1 else made

    def _rule(self, moves: Sequence[bool], asked: str) -> Rule:
        """Return the function's rule; ArgumentError if it has none, or none by an argument that is differentiated."""
        name = self.function.name
        if rule_of(name) is None and asked != name:
            error = no_derivatives(asked, 2)
            raise ArgumentError(error.message, f"leave out create_graph=True, or {error.hint}")
        gravity = [moved for each, moved in zip(self.function.inputs, moves, strict=False) if each is GRAVITY]
        rule = require_rule(name, bool(gravity), any(gravity))
        for given, moved in zip(arguments(self.function), moves, strict=True):
            if moved and (given in rule.constant or (given == THETA_B.name and not rule.parameters)):
                raise refuse_constant(name, given)
        return rule

    def _kept(self, context: Any) -> tuple[list[Tensor], Tensor, list[Tensor]]:
        """Inputs, theta_b, and positions among the outputs."""
        count, saved = len(self.function.inputs), list(context.saved_tensors)
        end = count + self.function.theta
        return saved[:count], saved[count] if self.function.theta else None, saved[end:]

    def checked(self, given: Sequence[Tensor]) -> tuple[list[Tensor], Tensor, tuple[int, ...]]:
        """Return the tensors of the inputs, theta_b or None, and the leading axes to which they broadcast.

        Raises TypeError if a tensor has another dtype, ArgumentError if a tensor has another shape.
        """
        count, name = len(self.function.inputs), self.function.name
        pairs = [
            pair for pair in zip((*self.function.inputs, THETA_B), given, strict=False) if pair[1] is not None
        ]
        leads = []
        for quantity, tensor in pairs:
            what, tail = f"{name}: {quantity.name}", self.robot.shape(quantity)
            wanted = (given[0].dtype,) if given[0].dtype in REALS else tuple(REALS)
            if tensor.dtype not in wanted:
                raise TypeError(f"{what} is {tensor.dtype}, expected {' or '.join(map(str, wanted))}")
            lead = tensor.shape[: tensor.ndim - len(tail)]
            if tensor.ndim < len(tail) or tuple(tensor.shape[len(lead) :]) != tail:
                expected = ", ".join(("...", *map(str, tail)))
                raise ArgumentError(
                    f"{what} has shape {tuple(tensor.shape)}, expected ({expected})",
                    f"the robot has nq = {self.robot.model.nq}, nv = {self.robot.model.nv}, l = {self.robot.model.l}",
                )
            leads.append(lead)
        try:
            lead = torch.broadcast_shapes(*leads)
        except RuntimeError:
            shapes = ", ".join(f"{quantity.name} {tuple(tensor.shape)}" for quantity, tensor in pairs)
            raise ArgumentError(
                f"{name}: shapes do not broadcast: {shapes}", "make leading axes equal or one"
            ) from None
        return list(given[:count]), pairs[-1][1] if len(pairs) > count else None, tuple(lead)

    def _results(self, like: Tensor, lead: tuple[int, ...], theta: bool) -> list[Tensor]:
        """Empty tensors for the outputs."""
        if any("nonzeros" in quantity.axes for quantity in self.function.outputs):
            tails = self.robot.compiled(like.dtype).tails(self.function.name + ("_theta" if theta else ""))
        else:
            tails = tuple(map(self.robot.shape, self.function.outputs))
        return [like.new_empty(lead + tail) for tail in tails]

    def normalized(self, quantity: Quantity, tensor: Tensor) -> Tensor:
        return self.robot.coordinates.normalized(tensor) if self._is_wide(quantity) else tensor

    def _is_wide(self, quantity: Quantity) -> bool:
        """Whether it is a position whose entries are not its tangent's."""
        return quantity.axes == Q.axes and not self.robot.coordinates.are_plain
