"""The functions of a compiled robot as functions of JAX, which can compile, batch and differentiate them.

psdmc registers two JAX primitives (basic operations) for all functions. The first calls a generated function. The
second computes its derivative along tangents, by the rules of differentiation.py. For reverse mode, JAX transposes the
second primitive, and psdmc then applies the rule's reverse mode. Both primitives accept any leading axes, so `vmap`
adds one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jax
import jax.extend
import jax.numpy as jnp
import numpy as np
from jax.interpreters import ad, batching, mlir

from psdmc.compiler import compile
from psdmc.errors import InputError
from psdmc.frameworks import xla
from psdmc.frameworks.coordinates import ON_COORDINATES, Coordinates
from psdmc.frameworks.differentiation import (
    ArgumentError,
    Arrays,
    Rule,
    refuse_constant,
    require_rule,
)
from psdmc.functions import SIGNATURES, no_function
from psdmc.lower.kernels import Lowering
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.load import model_of
from psdmc.program.kernel import GRAVITY, THETA_ROWS
from psdmc.program.signature import Q, Quantity, Signature, Sizes
from psdmc.target.target import Real, Target, Trig
from psdmc.toolchain.call import CompiledRobot
from psdmc.toolchain.call_arguments import bound_arguments
from psdmc.toolchain.compiled_functions import results
from psdmc.toolchain.stubs import documentation

Array = Any
"""A jax.Array, or what stands for one while JAX traces."""

_MADE: dict[str, JaxRobot] = {}
"""Robots of this process by their requests. They stay: programs that XLA compiled keep the addresses of their functions."""


def jax_robot(
    model: DynamicsModel | str | Path,
    lowering: Lowering,
    real: Real | None,
    trig: Trig | None,
    target: str | Target,
    gravity_input: bool,
) -> JaxRobot:
    """Return the robot of a model for JAX. Equal arguments give the same object; `psdmc.jax` explains them."""
    found = model_of(model)
    compiled = compile(found, lowering, real=real, trig=trig, target=target, gravity_input=gravity_input)
    if compiled.dtype == np.float64 and not jax.config.jax_enable_x64:
        raise InputError(
            f"{compiled.name}: the precision is float64, and JAX's option jax_enable_x64 is off",
            'call jax.config.update("jax_enable_x64", True) first, or give real="float32"',
        )
    options = (lowering, real, trig, target, gravity_input)
    key = repr((found.content_hash, *options))
    robot, chain = compiled, found.mechanism
    sizes = Sizes.of(chain, robot.l)
    made = JaxRobot(compiled, key, Coordinates.of(chain, jnp), sizes, (found, *options))
    return _MADE.setdefault(key, made)


class JaxRobot:
    """A robot whose methods, one for each generated function, are functions of JAX. `psdmc.jax` makes such robots.

    The methods have the arguments of the methods of a CompiledRobot, without `out`. Leading axes broadcast as in NumPy.
    If the mass matrix of a state is not positive definite, the results of this state are NaN. A method with several
    results returns a named tuple.

    The quaternions in q can have any length but zero: the methods normalize q first. A derivative by q is the
    derivative by its nq entries. In the direction of a quaternion, which only changes the length, the derivative is
    zero.
    """

    def __init__(
        self,
        compiled: CompiledRobot[Any],
        key: str,
        coordinates: Coordinates,
        sizes: Sizes,
        request: tuple[Any, ...],
    ) -> None:
        self.compiled = compiled
        """The same robot for NumPy arrays, with the names, sizes, limits and theta_b of the robot."""
        self._key = key
        self._coordinates, self._sizes, self._request = coordinates, sizes, request
        self._kernels: dict[tuple[str, bool, str, int], Kernel] = {}

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Callable[..., Any]: ...

    else:

        def __getattr__(self, name: str) -> Any:
            raise no_function(self, name)

    def __reduce__(self) -> tuple[Any, ...]:
        return jax_robot, self._request

    def __deepcopy__(self, memo: object) -> JaxRobot:
        return self

    def __repr__(self) -> str:
        return f"JaxRobot {self.compiled.name!r}: {self.compiled.n} joints, {self.compiled.dtype}"

    def call(
        self, function: Signature, inputs: Sequence[Any], theta_b: Any = None, gravity: Any = None
    ) -> Any:
        """Call a generated function of the robot; `function` is an entry of `psdmc.functions.SIGNATURES`."""
        made = results(function) if len(function.outputs) > 1 else None
        function, inputs = self.compiled.with_gravity(function, inputs, gravity)
        if not function.inputs:
            return jnp.asarray(getattr(self.compiled, function.name)())
        pairs = zip(function.inputs, inputs, strict=True)
        arrays = [self._checked(function, quantity, given) for quantity, given in pairs]
        own = None if theta_b is None else self._checked(function, THETA, theta_b)
        kernel = self._kernel(function, own is not None)
        given = kernel.given(arrays, own)
        if function.name in ON_COORDINATES:
            return getattr(self._coordinates, ON_COORDINATES[function.name])(*given)
        found = _call.bind(*given, kernel=kernel)
        return found[0] if made is None else made(*found)

    def _checked(self, function: Signature, quantity: Quantity, given: Any) -> Array:
        """An input as an array (..., *axes of one state), q with quaternions of length one."""
        what, dtype = f"{function.name}: {quantity.name}", self.compiled.dtype
        try:
            array = jnp.asarray(given) if hasattr(given, "dtype") else jnp.asarray(given, dtype)
        except (TypeError, ValueError) as error:
            raise ArgumentError(f"{what} is no array: {error}", "give an array of numbers") from None
        if jnp.issubdtype(array.dtype, jnp.integer):
            array = array.astype(dtype)
        if array.dtype != dtype:
            is_real = array.dtype in (jnp.float32, jnp.float64)
            is_narrow = is_real and not jax.config.jax_enable_x64
            switch = "set jax_enable_x64 to True with jax.config.update, " if is_narrow else ""
            other = f", or make the robot with psdmc.jax(model, real={str(array.dtype)!r})" if is_real else ""
            raise ArgumentError(
                f"{what} has dtype {array.dtype}, expected {dtype}", f"{switch}convert the array{other}"
            )
        tail = self._sizes.shape(quantity.axes)
        if array.shape[max(array.ndim - len(tail), 0) :] != tail:
            expected = ", ".join(("...", *map(str, tail)))
            raise ArgumentError(
                f"{what} has shape {array.shape}, expected ({expected})",
                f"the robot has {self.compiled.n} joints: {', '.join(self.compiled.joint_names)}",
            )
        is_wide = quantity.axes == Q.axes and not self._coordinates.are_plain
        return self._coordinates.normalized(array) if is_wide else array

    def _kernel(self, function: Signature, theta: bool, asked: str = "", order: int = 0) -> Kernel:
        """Return the kernel, which is the same object for the same function: JAX compares the parameters of its
        primitives."""
        asked = asked or function.name
        key = (function.name, theta, asked, order)
        return self._kernels.setdefault(key, Kernel(self, function, theta, asked, order))


THETA = Quantity("theta_b", ("l",))


def _method(function: Signature) -> Callable[..., Any]:
    def method(self: JaxRobot, *given: Any, **named: Any) -> Any:
        if "out" in named:
            raise TypeError(f"{function.name}(): a function of JAX has no argument 'out'")
        gravity = named.pop(GRAVITY.name, None)
        inputs, theta_b, _ = bound_arguments(function, given, named)
        return self.call(function, inputs, theta_b, gravity)

    method.__name__, method.__doc__ = function.name, documentation(function)
    method.__qualname__ = f"{JaxRobot.__name__}.{function.name}"
    return method


for _function in SIGNATURES.values():
    setattr(JaxRobot, _function.name, _method(_function))


@dataclass(frozen=True, eq=False)
class Kernel:
    """The generated function that JAX's primitives call.

    theta  whether theta_b is the last argument
    asked  name of the function that the user called: this one, or one of which JAX takes a derivative
    order  number of times that JAX has differentiated the user's function
    """

    robot: JaxRobot
    function: Signature
    theta: bool
    asked: str
    order: int

    def with_tail(self, lead: tuple[int, ...], quantity: Quantity) -> tuple[int, ...]:
        """Return the shape of an input or output: the leading axes `lead`, then the axes of one state."""
        return lead + self._sizes.shape(quantity.axes)

    def given(self, inputs: Sequence[Array], theta_b: Array | None) -> list[Array]:
        """Return all arguments of one call, broadcast to common leading axes, except a theta_b of shape (l,)."""
        named = [*zip(self.function.inputs, inputs, strict=True)]
        named += [] if theta_b is None else [(THETA, theta_b)]
        leads = [x.shape[: x.ndim - len(quantity.axes)] for quantity, x in named]
        try:
            lead = jnp.broadcast_shapes(*leads)
        except ValueError:
            shapes = ", ".join(f"{quantity.name} {x.shape}" for quantity, x in named)
            raise ArgumentError(
                f"{self.function.name}: shapes do not broadcast: {shapes}", "make leading axes equal or one"
            ) from None
        return [
            x if quantity is THETA and x.ndim == 1 else jnp.broadcast_to(x, self.with_tail(lead, quantity))
            for quantity, x in named
        ]

    def lead(self, first: Any) -> tuple[int, ...]:
        """Return the leading axes of the states, from the shape of the function's first argument."""
        return tuple(first.shape[: first.ndim - len(self.function.inputs[0].axes)])

    @cached_property
    def _sizes(self) -> Sizes:
        sizes, name = self.robot._sizes, self.function.name
        packed = any("nonzeros" in output.axes for output in self.function.outputs)
        return replace(sizes, nonzeros=len(self.robot.compiled.pattern(name)[0])) if packed else sizes

    @property
    def rule(self) -> Rule:
        """Return the rule that differentiates the function. Raises ArgumentError if psdmc has none."""
        has_gravity = GRAVITY in self.function.inputs
        return require_rule(self.function.name, has_gravity, asked=self.asked, order=self.order + 1)

    def number(self, by_rows: bool) -> int:
        """Return the number under which XLA finds the compiled function. If the function is not compiled yet, psdmc
        compiles it.

        by_rows  whether each state has its own theta_b
        """
        compiled, function = self.robot.compiled, self.function
        name = function.name + (THETA_ROWS if by_rows else "_theta" if self.theta else "")
        number = xla.number_of(f"{self.robot._key} {name}")
        given = (*function.inputs, *((THETA,) if self.theta else ()))
        xla.add(
            number,
            compiled.address_of(name),
            bool(function.factorises),
            compiled.dtype == np.float32,
            len(function.inputs) if self.theta and not by_rows else None,
            tuple(self._sizes.size(quantity) for quantity in (*given, *function.outputs)),
        )
        return number


@dataclass(frozen=True)
class _Rules:
    """JAX as the rules of differentiation.py see it.

    kernel   the function that is differentiated
    theta_b  (l,) or (..., l); None: the robot's own
    gravity  (..., 3), for functions with this input; None: zero, where its effects cancel
    """

    kernel: Kernel
    theta_b: Array | None
    gravity: Array | None = None
    arrays: Any = jnp

    def under(self, gravity: Array) -> _Rules:
        return replace(self, gravity=gravity)

    def call(self, name: str, *inputs: Array) -> Arrays:
        robot, asked, order = self.kernel.robot, self.kernel.asked, self.kernel.order + 1
        function, inputs = robot.compiled.with_gravity(SIGNATURES[name], inputs)
        if GRAVITY in function.inputs:
            own_gravity = jnp.zeros(3, inputs[0].dtype) if self.gravity is None else self.gravity
            inputs = (*inputs[:-1], own_gravity)
        kernel = robot._kernel(function, self.theta_b is not None and function.theta, asked, order)
        own = self.theta_b if kernel.theta else None
        return tuple(_call.bind(*kernel.given(inputs, own), kernel=kernel))


# The call of a generated function: all inputs (..., *axes) with the same leading axes, then theta_b, (l,) or (..., l).
_call = jax.extend.core.Primitive("psdmc_call")
_call.multiple_results = True


def _shapes(*given: Any, kernel: Kernel) -> list[Any]:
    return [_like(given[0], kernel, output) for output in kernel.function.outputs]


def _like(first: Any, kernel: Kernel, output: Quantity) -> Any:
    """The abstract value of an output, whose leading axes lie on devices as those of the first argument."""
    lead, spec = kernel.lead(first), first.sharding.spec
    shape = kernel.with_tail(lead, output)
    own = jax.sharding.PartitionSpec(*spec[: len(lead)], *[None] * (len(shape) - len(lead)))
    return first.update(shape=shape, weak_type=False, sharding=first.sharding.update(spec=own))


def _called(*given: Array, kernel: Kernel) -> list[Array]:
    lead = kernel.lead(given[0])
    shapes = [
        jax.ShapeDtypeStruct(kernel.with_tail(lead, output), given[0].dtype)
        for output in kernel.function.outputs
    ]
    number = kernel.number(by_rows=kernel.theta and given[-1].ndim > 1)
    return list(jax.ffi.ffi_call(xla.TARGET, shapes)(*given, function=np.int64(number)))


_call.def_abstract_eval(_shapes)
_call.def_impl(_called)
mlir.register_lowering(_call, mlir.lower_fun(_called, multiple_results=True), platform="cpu")


def _batched(primitive: Any) -> Callable[..., Any]:
    """The rule of `vmap`: one more leading axis. An array without it is broadcast, except a shared theta_b."""

    def rule(given: Sequence[Array], axes: Sequence[int | None], *, kernel: Kernel, **more: Any) -> Any:
        size = next(x.shape[axis] for x, axis in zip(given, axes, strict=True) if axis is not None)
        thetas = _places_of_theta(kernel, len(given), **more)
        found: list[Array] = []
        for k, (x, axis) in enumerate(zip(given, axes, strict=True)):
            moved = x if axis is None else jnp.moveaxis(x, axis, 0)
            is_shared = k in thetas and moved.ndim - (axis is not None) == 1
            if axis is None and not is_shared:
                moved = jnp.broadcast_to(moved, (size, *moved.shape))
            elif axis is not None and is_shared:
                lead = kernel.lead(found[0])
                moved = moved.reshape(size, *(1,) * (len(lead) - 1), -1)
                moved = jnp.broadcast_to(moved, (*lead, moved.shape[-1]))
            found.append(moved)
        outs = primitive.bind(*found, kernel=kernel, **more)
        return outs, [0] * len(outs)

    return rule


def _places_of_theta(kernel: Kernel, count: int, by_theta: bool = False) -> tuple[int, ...]:
    """Return the positions of theta_b and of its tangent in the arguments of a primitive."""
    own = (len(kernel.function.inputs),) if kernel.theta else ()
    return (*own, count - 1) if by_theta else own


batching.primitive_batchers[_call] = _batched(_call)


def _differentiated(
    primals: Sequence[Array], tangents: Sequence[Any], *, kernel: Kernel
) -> tuple[list[Array], list[Any]]:
    """The outputs of a call and their tangents."""
    outs = _call.bind(*primals, kernel=kernel)
    moves = [type(tangent) is not ad.Zero for tangent in tangents]
    if not any(moves):
        return outs, [ad.Zero.from_primal_value(out) for out in outs]
    function, coordinates = kernel.function, kernel.robot._coordinates
    rule = kernel.rule
    count = len(function.inputs)
    linear = []
    for quantity, q, tangent, moved in zip(function.inputs, primals, tangents, moves, strict=False):
        if quantity.name in rule.constant:
            if moved:
                raise refuse_constant(kernel.asked, quantity.name)
            continue
        along = ad.instantiate_zeros(tangent)
        is_wide = quantity.axes == Q.axes and not coordinates.are_plain
        linear.append(coordinates.tangent(q, along) if is_wide else along)
    by_theta = kernel.theta and moves[count]
    if by_theta and not rule.parameters:
        raise refuse_constant(kernel.asked, THETA.name)
    linear += [tangents[count]] if by_theta else []
    found = _linear.bind(*primals, *linear, kernel=kernel, by_theta=by_theta)
    return outs, [
        coordinates.rates(out, along) if quantity.axes == Q.axes and not coordinates.are_plain else along
        for quantity, out, along in zip(function.outputs, outs, found, strict=True)
    ]


ad.primitive_jvps[_call] = _differentiated


# The tangents of a function's outputs, from those of its inputs: the arguments of the call, then the tangents of the inputs
# that are not constant, along the tangent of q, and of theta_b if `by_theta`.
_linear = jax.extend.core.Primitive("psdmc_linear")
_linear.multiple_results = True


def _shapes_of_tangents(*given: Any, kernel: Kernel, by_theta: bool) -> list[Any]:
    outputs = kernel.function.outputs
    along = (replace(output, axes=("nv",)) if output.axes == Q.axes else output for output in outputs)
    return [_like(given[0], kernel, output) for output in along]


@dataclass(frozen=True)
class _Parts:
    """The arguments of the linear primitive. `places`: which argument is the tangent of each input; None: constant."""

    rules: _Rules
    inputs: Arrays
    places: tuple[int | None, ...]

    @classmethod
    def of(cls, given: Sequence[Any], kernel: Kernel) -> _Parts:
        count = len(kernel.function.inputs)
        constant = kernel.rule.constant
        at = iter(range(count + kernel.theta, len(given)))
        places = tuple(None if quantity.name in constant else next(at) for quantity in kernel.function.inputs)
        theta_b = given[count] if kernel.theta else None
        return cls(_Rules(kernel, theta_b), tuple(given[:count]), places)


def _tangents(*given: Array, kernel: Kernel, by_theta: bool) -> list[Array]:
    parts, rule = _Parts.of(given, kernel), kernel.rule
    tangents = tuple(None if at is None else given[at] for at in parts.places)
    return list(rule.along(parts.rules, parts.inputs, tangents, given[-1] if by_theta else None))


def _transposed(cotangents: Sequence[Any], *given: Any, kernel: Kernel, by_theta: bool) -> list[Any]:
    """Gradients, by the linear arguments; None for the others."""
    parts, rule = _Parts.of(given, kernel), kernel.rule
    weights = tuple(map(ad.instantiate_zeros, cotangents))
    gradients, theta = rule.back(parts.rules, parts.inputs, weights, by_theta)
    found: list[Any] = [None] * len(given)
    for at, gradient in zip(parts.places, gradients, strict=True):
        if at is not None and ad.is_undefined_primal(given[at]):
            found[at] = gradient
    if by_theta and theta is not None and ad.is_undefined_primal(given[-1]):
        rank = given[-1].aval.ndim
        found[-1] = theta.sum(tuple(range(theta.ndim - 1))) if rank == 1 else theta
    return found


def _second(primals: Sequence[Array], tangents: Sequence[Any], *, kernel: Kernel, by_theta: bool) -> Any:
    """The derivative of the linear primitive; by other arguments if the rule's functions have one."""
    first = len(kernel.function.inputs) + kernel.theta
    linear = [ad.instantiate_zeros(tangent) for tangent in tangents[first:]]
    found: list[Any] = _linear.bind(*primals[:first], *linear, kernel=kernel, by_theta=by_theta)
    if any(type(tangent) is not ad.Zero for tangent in tangents[:first]):

        def tangents_of(*given: Array) -> list[Array]:
            return _tangents(*given, *primals[first:], kernel=kernel, by_theta=by_theta)

        _, more = jax.jvp(
            tangents_of, tuple(primals[:first]), tuple(map(ad.instantiate_zeros, tangents[:first]))
        )
        found = [a + b for a, b in zip(found, more, strict=True)]
    return _linear.bind(*primals, kernel=kernel, by_theta=by_theta), found


_linear.def_abstract_eval(_shapes_of_tangents)
_linear.def_impl(_tangents)
mlir.register_lowering(_linear, mlir.lower_fun(_tangents, multiple_results=True))
batching.primitive_batchers[_linear] = _batched(_linear)
ad.primitive_jvps[_linear] = _second
ad.primitive_transposes[_linear] = _transposed
