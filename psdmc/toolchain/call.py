"""The class CompiledRobot, which has a Python method for each generated function of psdmc/functions.

Type checkers and editors read the types of the methods from call.pyi, which `python -m psdmc.toolchain.stubs` writes.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from types import GenericAlias, MethodType
from typing import Any

import numpy as np

from psdmc.functions import SIGNATURES
from psdmc.program.signature import Q, Signature
from psdmc.toolchain.call_arguments import bound_arguments, signature_of
from psdmc.toolchain.compiled_functions import CompiledFunctions, results
from psdmc.toolchain.direct_calls import MOST_ARRAYS, MOST_UNITS, direct_calls
from psdmc.toolchain.stubs import documentation


class CompiledRobot(CompiledFunctions):
    """A compiled robot has one method for each generated function. The methods take and return NumPy arrays.

    `psdmc.compile` makes compiled robots. One call computes one state or many. Joint positions q have the shape (..., nq).
    Rates, accelerations and torques have the shape (..., nv). The dots (...) are batch axes, with one entry per state.
    They broadcast as in NumPy. All numbers are in SI units.

    Results have the NumPy type that the attribute `dtype` names. A method with several results returns a named tuple.
    During a call for many states, other Python threads can run.

    All methods have the argument `out`. Methods whose results depend on masses have the argument `theta_b`:

    theta_b  base parameters, which are combinations of masses and inertias: (l,) for all states, or (..., l) for one set
             per state. Without theta_b, the method uses the base parameters of the model. If these are unknown, give
             theta_b
    gravity  acceleration of gravity in m/s^2 along the axes of the base frame: (3,) for all states, or (..., 3) for one per
             state. Only robots compiled with `gravity_input=True` have this argument, in the methods whose results depend
             on gravity. Without gravity, the method uses that of the model. A call takes about 10 us longer
    out      array into which psdmc writes the result, or a tuple of arrays for several results; optional. Each array needs
             the shape and dtype of the result, and may be an input array

    Several results, such as velocities, are in the base frame. If the robot has a floating base, they are in the world
    frame instead.

    In addition to the arithmetic, a call takes about 0.3 us if all input arrays are contiguous and have the robot's dtype
    and the same batch axes (...). With other input arrays, or if Python's C headers are not installed, it takes about 10 us.
    """

    def _bind(self, compiled: CompiledFunctions) -> None:
        """Put a direct call in the place of each method whose kernel this library has."""
        make = direct_calls().make
        for name in compiled.functions if make is not None else ():
            if name in SIGNATURES and self._interface.gravity_input and SIGNATURES[name].depends_on_gravity:
                continue
            if name not in SIGNATURES or not is_direct(SIGNATURES[name], self._units):
                continue
            self.__dict__[name] = make(*self._bound(SIGNATURES[name], compiled))

    def _bound(self, function: Signature, compiled: CompiledFunctions) -> tuple[Any, ...]:
        """The arguments of DirectCall for one function."""
        with_theta = f"{function.name}_theta"
        arrays = len(function.inputs) + 1 + len(function.outputs)
        takes_theta = with_theta in compiled._kernels and arrays <= MOST_ARRAYS
        return (
            MethodType(getattr(type(self), function.name), self),
            compiled.address_of(function.name) if function.name in compiled._kernels else 0,
            bool(function.factorises) + function.raises,
            self.dtype == np.float32,
            tuple(self._sizes.shape(quantity.axes) for quantity in function.inputs),
            compiled._tails_of(function.name),
            results(function) if len(function.outputs) > 1 else None,
            self._units_of(function),
            compiled.address_of(with_theta) if takes_theta else 0,
            self._sizes.l,
        )

    __class_getitem__ = classmethod(GenericAlias)
    """For annotations such as CompiledRobot[np.float32]; call.pyi says what the argument is."""

    def _units_of(self, function: Signature) -> tuple[tuple[int, int, int], ...]:
        """Parts of inputs that must be of length one: the input's number, from an entry to before another."""
        positions = [k for k, quantity in enumerate(function.inputs) if quantity.axes == Q.axes]
        return () if function.normalizes else tuple((k, *part) for k in positions for part in self._units)


def is_direct(function: Signature, units: Sequence[tuple[int, int]]) -> bool:
    """Return whether the extension module (direct_calls.py) can call a function. The function needs inputs, and not too
    many arrays or quaternions."""
    arrays = len(function.inputs) + len(function.outputs)
    return bool(function.inputs) and arrays <= MOST_ARRAYS and len(function.inputs) * len(units) <= MOST_UNITS


def with_gravity(function: Signature) -> inspect.Signature:
    """Return the method's signature for a generated function, with `gravity` if it depends on gravity."""
    found = signature_of(function)
    if not function.depends_on_gravity:
        return found
    *others, out = found.parameters.values()
    gravity = inspect.Parameter("gravity", inspect.Parameter.KEYWORD_ONLY, default=None)
    return found.replace(parameters=[*others, gravity, out])


def _method(function: Signature) -> Callable[..., Any]:
    count, depends = len(function.inputs), function.depends_on_gravity

    def method(self: CompiledRobot, *given: Any, **named: Any) -> Any:
        if not named and len(given) == count:
            return self.call(function, given)
        gravity = named.pop("gravity", None) if depends else None
        inputs, theta_b, out = bound_arguments(function, given, named)
        return self.call(function, inputs, theta_b, out, gravity)

    method.__name__, method.__doc__ = function.name, documentation(function)
    method.__qualname__ = f"{CompiledRobot.__name__}.{function.name}"
    method.__signature__ = with_gravity(function)  # type: ignore[attr-defined]
    return method


for _function in SIGNATURES.values():
    setattr(CompiledRobot, _function.name, _method(_function))
