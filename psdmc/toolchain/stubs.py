"""Writes call.pyi and model/answers.pyi, which give type checkers the methods of compiled robots and of models. Run it
as python -m psdmc.toolchain.stubs."""

from __future__ import annotations

import ast
import textwrap
from collections.abc import Iterable
from pathlib import Path

from psdmc.functions import OF_FILE_MASSES, SIGNATURES
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
    """Return the names of a method's arguments."""
    return (*(quantity.name for quantity in function.inputs), *(("theta_b",) if function.theta else ()))


def documentation(function: Signature) -> str:
    """Return the docstring of the method for a generated function: what it computes, arguments and results, when
    results are NaN, and the lengths of axes."""
    several = len(function.outputs) > 1
    lead = ("...",) if function.inputs else ()
    given = [
        (q.name, f"{_shape(q)} {q.means}" + ("" if q.default is None else f"; default {q.default:g}"))
        for q in function.inputs
    ]
    theta = (
        "(l,) base parameters for all states, or (..., l) for one set per state. Base parameters are combinations of masses "
        "and inertias, in SI units. Without theta_b, the function uses those of the model. If these are unknown, give "
        "theta_b"
    )
    given += [("theta_b", theta)] if function.theta else []
    written = (
        "tuple of arrays into which psdmc writes the results"
        if several
        else "array into which psdmc writes the result"
    )
    given += [("out", f"{written}; optional")]
    made = [(q.name, f"{_shape(q, lead)} {q.means}") for q in function.outputs]
    axes = {axis for q in (*function.inputs, *function.outputs) for axis in q.axes}
    axes |= {"l"} if function.theta else set()
    axes |= {"contact_rows", "loop_rows"} if "constraint_rows" in axes else set()
    returned = f"Returns {'a named tuple' if several else 'an array'}:"
    lengths = [(size, meaning) for size, meaning in _SIZES.items() if size in {*axes, *lead}]
    parts = [
        _rows(given),
        returned,
        _rows(made),
        *([_filled(function.note)] if function.note else []),
        *([_filled(_FIXED_MASSES)] if function.name in OF_FILE_MASSES else []),
        *_failures(function),
        "In these shapes:",
        _rows(lengths),
    ]
    return "\n\n".join([function.summary, *parts])


_SIZES = {
    "...": "batch axes, if the call computes many states; none for one state",
    "nq": "length of q, which is the number of joints if every joint has one coordinate",
    "nv": "number of joint rates",
    "nx": "2 nv: nv for the displacement of the joints, then nv for the change of qd",
    "nxa": "3 nv: nv for q, nv for qd and nv for qdd",
    "nxu": "3 nv: nv for q, nv for qd and nv for tau",
    "l": "number of base parameters, the entries of theta_b",
    "frames": "number of named frames, which are links or tools chosen when the model was derived; `frame_names` lists them",
    "contacts": "number of contacts: links or frames that can touch the world; `contacts` lists them",
    "contact_rows": "number of rows of all contacts (links or frames that can touch the world): 3 for each contact point, "
    "6 for each contact surface, in the order of `contacts`",
    "loop_rows": "number of directions that all closed loops block, in the order of `loops`; 0 without closed loops",
    "constraint_rows": "contact_rows + loop_rows: first the rows of all contacts, then those of all closed loops",
    "nonzeros": "number of matrix entries that can differ from zero at some state",
}

_FIXED_MASSES = (
    "The masses and inertias of the links are those of the robot file, with loads that `DynamicsModel.with_payload` added. "
    "The function does not use theta_b, because base parameters do not determine its results."
)
"""A paragraph on functions without theta_b that need masses."""


def _failures(function: Signature) -> list[str]:
    """Return paragraphs on what happens if a matrix is not positive definite."""
    found = []
    for matrix in function.factorises:
        if matrix.error:
            cases = "\n".join(_filled(case, "- ") for case in matrix.failure.split("\n"))
            found.append(f"Raises InputError in each of these cases:\n\n{cases}")
        else:
            found.append(_filled(f"If {matrix.failure}, the results of that state are NaN."))
    return found


def _rows(named: list[tuple[str, str]]) -> str:
    width = max(len(name) for name, _ in named)
    return "\n".join(_filled(text, f"{name:{width}}  ") for name, text in named)


def _filled(text: str, lead: str = "") -> str:
    """The text after a lead, in lines of equal indent."""
    return textwrap.fill(
        text, 118, initial_indent=lead, subsequent_indent=" " * len(lead), break_on_hyphens=False
    )


def stub(functions: Iterable[Signature]) -> str:
    """Return the text of call.pyi."""
    shown = tuple(functions)
    several = [line for function in shown if len(function.outputs) > 1 for line in _results(function)]
    methods = [line for function in shown for line in _method(function, function.depends_on_gravity)]
    return (
        "\n".join([_HEAD, *several, "class CompiledRobot(CompiledFunctions, Generic[RealT]):", *methods])
        + "\n"
    )


def result_name(function: Signature) -> str:
    """Return the name of the named tuple that the method of a function with several outputs returns."""
    return "".join(word.capitalize() for word in function.name.split("_"))


def _results(function: Signature) -> list[str]:
    fields = [f"    {output.name}: NDArray[RealT]" for output in function.outputs]
    return [f"class {result_name(function)}(NamedTuple, Generic[RealT]):", *fields, ""]


def _method(function: Signature, with_gravity: bool = False) -> list[str]:
    given = [
        f"{q.name}: ArrayLike" + ("" if q.default is None else f" = {q.default}") for q in function.inputs
    ]
    given += ["theta_b: ArrayLike | None = None"] if function.theta else []
    one = "NDArray[RealT] | None" if len(function.outputs) == 1 else "tuple[NDArray[RealT], ...] | None"
    gravity = ["gravity: ArrayLike | None = None"] if with_gravity else []
    given = ["self", *given, "*", *gravity, f"out: {one} = None"]
    returns = "NDArray" if len(function.outputs) == 1 else result_name(function)
    return [f"    def {function.name}({', '.join(given)}) -> {returns}[RealT]: ..."]


def _shape(quantity: Quantity, lead: tuple[str, ...] = ("...",)) -> str:
    return f"({', '.join((*lead, *quantity.axes))}{'' if lead else ','})"


def own_methods() -> set[str]:
    """Return the names of the methods that the class of models defines itself. They are read from the source file of
    the class, which is not imported."""
    tree = ast.parse((MODEL / "dynamics_model.py").read_text(encoding="utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


def answers_stub(functions: Iterable[Signature]) -> str:
    """Return the text of answers.pyi, which declares generated functions as methods of models. Methods that the class
    of models defines itself are left out."""
    own = own_methods()
    shown = [function for function in functions if function.name not in own]
    several = sorted(result_name(function) for function in shown if len(function.outputs) > 1)
    imported = "".join(f"    {name},\n" for name in several)
    methods = [line.replace("[RealT]", "[np.float64]") for f in shown for line in _method(f)]
    return "\n".join([_ANSWERS_HEAD.format(imported=imported), "class Answers:", _ANSWER, *methods]) + "\n"


if __name__ == "__main__":
    STUB.write_text(stub(SIGNATURES.values()), encoding="utf-8")
    ANSWERS.write_text(answers_stub(SIGNATURES.values()), encoding="utf-8")
