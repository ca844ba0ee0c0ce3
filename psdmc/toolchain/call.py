"""A compiled robot called from Python: a method for each function of psdmc/functions.

Type checkers and editors read the methods' types from call.pyi, which `python -m psdmc.toolchain.stubs` writes.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from psdmc.functions import SIGNATURES
from psdmc.program.signature import Signature
from psdmc.toolchain.compiled_functions import CompiledFunctions
from psdmc.toolchain.stubs import arguments, documentation


class CompiledRobot(CompiledFunctions):
    """The functions of a compiled package on NumPy arrays: q, qd and the like are (..., n).

    Leading axes broadcast; results are float64 or float32 as the package was compiled, several of them a named tuple.
    Calls release the GIL and may run in several threads. `theta_b` (l,), where a function takes it, replaces the
    parameters compiled in.
    """


def _method(function: Signature) -> Callable[..., Any]:
    names = inspect.Signature(
        [
            inspect.Parameter(
                name,
                inspect.Parameter.POSITIONAL_OR_KEYWORD,
                default=None if name == "theta_b" else inspect.Parameter.empty,
            )
            for name in ("self", *arguments(function))
        ]
    )

    count = len(function.inputs)

    def method(self: CompiledRobot, *given: Any, **named: Any) -> Any:
        if not named and len(given) == count:
            return self.call(function, given)
        try:
            bound = names.bind(self, *given, **named)
        except TypeError as error:
            raise TypeError(f"{function.name}(): {error}") from None
        bound.apply_defaults()
        _, *values = bound.arguments.values()
        return self.call(function, values[:count], *values[count:])

    method.__name__, method.__doc__ = function.name, documentation(function)
    method.__qualname__ = f"{CompiledRobot.__name__}.{function.name}"
    method.__signature__ = names  # type: ignore[attr-defined]
    return method


for _function in SIGNATURES.values():
    setattr(CompiledRobot, _function.name, _method(_function))
