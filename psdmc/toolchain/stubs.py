"""python -m psdmc.toolchain.stubs: writes call.pyi and model/answers.pyi, the methods of compiled robots and of models for
type checkers."""

from __future__ import annotations

import ast
from collections.abc import Iterable
from pathlib import Path

from psdmc.functions import SIGNATURES
from psdmc.program.signature import Quantity, Signature

STUB = Path(__file__).with_name("call.pyi")
MODEL = Path(__file__).parents[1] / "model"
ANSWERS = MODEL / "answers.pyi"

_HEAD = """# Written by python -m psdmc.toolchain.stubs from psdmc/functions.
from typing import Generic, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from typing_extensions import TypeVar

from psdmc.toolchain.compiled_functions import CompiledFunctions

RealT = TypeVar("RealT", bound=np.floating, default=np.float64)
"""


_ANSWERS_HEAD = """# Written by python -m psdmc.toolchain.stubs from psdmc/functions.
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from psdmc.toolchain.call import (
{imported})

class Provider(NamedTuple):
    names: Callable[[], Iterable[str]]
    bound: Callable[[Any, str], Callable[..., Any]]

def provide(provider: Callable[[], Provider]) -> None: ...
"""

_ANSWER = "    def _answer(self, name: str, *given: Any, **named: Any) -> NDArray[np.float64]: ..."


def arguments(function: Signature) -> tuple[str, ...]:
    """Names of a method's arguments."""
    return (*(quantity.name for quantity in function.inputs), *(("theta_b",) if function.theta else ()))


def documentation(function: Signature) -> str:
    """A method's docstring: the function's meaning, then the shapes of its inputs and outputs."""
    given = ", ".join(f"{q.name} {_shape(q)}" for q in function.inputs)
    theta = "; theta_b (l,) in place of the parameters compiled in" if function.theta else ""
    shapes = ", ".join(f"{output.name} {_shape(output)}" for output in function.outputs)
    failure = f"; NaN in states that have {function.positive.which}" if function.positive else ""
    written = "array" if len(function.outputs) == 1 else "tuple of arrays"
    return (
        f"{function.meaning}.\n\nTakes {given}{theta}.\nReturns {shapes}{failure}.\n"
        f"out: the {written} to write to. nq = nv = n if every joint has one coordinate."
    )


def stub(functions: Iterable[Signature]) -> str:
    """The text of call.pyi."""
    shown = tuple(functions)
    several = [line for function in shown if len(function.outputs) > 1 for line in _results(function)]
    methods = [line for function in shown for line in _method(function)]
    return (
        "\n".join([_HEAD, *several, "class CompiledRobot(CompiledFunctions, Generic[RealT]):", *methods])
        + "\n"
    )


def result_name(function: Signature) -> str:
    """The named tuple that a function with several outputs returns."""
    return "".join(word.capitalize() for word in function.name.split("_"))


def _results(function: Signature) -> list[str]:
    fields = [f"    {output.name}: NDArray[RealT]" for output in function.outputs]
    return [f"class {result_name(function)}(NamedTuple, Generic[RealT]):", *fields, ""]


def _method(function: Signature) -> list[str]:
    given = [f"{quantity.name}: ArrayLike" for quantity in function.inputs]
    given += ["theta_b: ArrayLike | None = None"] if function.theta else []
    one = "NDArray[RealT] | None" if len(function.outputs) == 1 else "tuple[NDArray[RealT], ...] | None"
    given = ["self", *given, "*", f"out: {one} = None"]
    returns = "NDArray" if len(function.outputs) == 1 else result_name(function)
    return [f"    def {function.name}({', '.join(given)}) -> {returns}[RealT]: ..."]


def _shape(quantity: Quantity) -> str:
    return f"({', '.join(('...', *quantity.axes))})"


def own_methods() -> set[str]:
    """Names of the model's own methods. Its source is read: nothing here imports it."""
    tree = ast.parse((MODEL / "dynamics_model.py").read_text(encoding="utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


def answers_stub(functions: Iterable[Signature]) -> str:
    """The text of answers.pyi: what models answer besides their own methods."""
    own = own_methods()
    shown = [function for function in functions if function.name not in own]
    several = sorted(result_name(function) for function in shown if len(function.outputs) > 1)
    imported = "".join(f"    {name},\n" for name in several)
    methods = [line.replace("[RealT]", "[np.float64]") for f in shown for line in _method(f)]
    return "\n".join([_ANSWERS_HEAD.format(imported=imported), "class Answers:", _ANSWER, *methods]) + "\n"


if __name__ == "__main__":
    STUB.write_text(stub(SIGNATURES.values()), encoding="utf-8")
    ANSWERS.write_text(answers_stub(SIGNATURES.values()), encoding="utf-8")
