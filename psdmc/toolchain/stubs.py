"""python -m psdmc.toolchain.stubs: writes call.pyi, the compiled robot's methods for type checkers."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from psdmc.functions import SIGNATURES
from psdmc.program.signature import Quantity, Signature

STUB = Path(__file__).with_name("call.pyi")

_HEAD = """# Written by python -m psdmc.toolchain.stubs from psdmc/functions.
from typing import Any, NamedTuple

from numpy.typing import ArrayLike, NDArray

from psdmc.toolchain.compiled_functions import CompiledFunctions

Array = NDArray[Any]
"""


def arguments(function: Signature) -> tuple[str, ...]:
    """Names of a method's arguments."""
    return (*(quantity.name for quantity in function.inputs), *(("theta_b",) if function.theta else ()))


def documentation(function: Signature) -> str:
    """A method's docstring: the function's meaning, then the shapes of its outputs."""
    shapes = ", ".join(f"{output.name} {_shape(output)}" for output in function.outputs)
    inputs = "".join(f"; {q.name} {_shape(q)}" for q in function.inputs if len(q.axes) != 1)
    failure = f"; NaN in states that have {function.positive.which}" if function.positive else ""
    return f"{function.meaning}: {shapes}{inputs}{failure}."


def stub(functions: Iterable[Signature]) -> str:
    """The text of call.pyi."""
    shown = tuple(functions)
    several = [line for function in shown if len(function.outputs) > 1 for line in _results(function)]
    methods = [line for function in shown for line in _method(function)]
    return "\n".join([_HEAD, *several, "class CompiledRobot(CompiledFunctions):", *methods]) + "\n"


def result_name(function: Signature) -> str:
    """The named tuple that a function with several outputs returns."""
    return "".join(word.capitalize() for word in function.name.split("_"))


def _results(function: Signature) -> list[str]:
    fields = [f"    {output.name}: Array" for output in function.outputs]
    return [f"class {result_name(function)}(NamedTuple):", *fields, ""]


def _method(function: Signature) -> list[str]:
    given = [f"{quantity.name}: ArrayLike" for quantity in function.inputs]
    given += ["theta_b: ArrayLike | None = None"] if function.theta else []
    returns = "Array" if len(function.outputs) == 1 else result_name(function)
    return [f"    def {function.name}(self, {', '.join(given)}) -> {returns}: ..."]


def _shape(quantity: Quantity) -> str:
    words = {"nq": "n", "nv": "n"}
    return f"({', '.join(('...', *(words.get(axis, axis) for axis in quantity.axes)))})"


if __name__ == "__main__":
    STUB.write_text(stub(SIGNATURES.values()), encoding="utf-8")
