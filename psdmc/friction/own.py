"""Friction laws that users define in Python files, and how model files store these laws.

A model file holds no Python code. It stores the torque of a law as the text of a PROGRAM (a list of operations). psdmc
runs Python code only from a file to which the user's log description or simulated robot refers.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from psdmc.errors import InputError
from psdmc.files import read_file
from psdmc.friction.law import At, Law, Scalar, Value
from psdmc.friction.laws import LAWS
from psdmc.program.program import Program, Slot
from psdmc.program.text import parse, show
from psdmc.program.trace import Tracer

HINT = "docs/how-to/springs-and-friction.md shows a friction law"
LARGEST_FILE = 1 << 20
"""Bytes of a law's file."""
MOST_LAWS, MOST_VALUES, MOST_INSTRUCTIONS = 16, 16, 400
LONGEST = 300
"""Characters of a sentence or formula."""
NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")
READ = ("q", "v", "sign", "load")
"""What a linear law may read of At."""
STATES, ROUNDED = 5, 1e-9
"""Random states and values at which a law must be linear in its values, and the share by which rounding may spoil that."""


def read_law(path: Path) -> dict[str, Any]:
    """Run a user's Python file and return the friction law LAW that it defines, as plain values (numbers, texts,
    lists). Raises InputError if the file defines no LAW, or if psdmc cannot fit this law to data."""
    source = read_file(path, LARGEST_FILE, "a friction law is a few lines of Python")
    names: dict[str, Any] = {"__name__": path.stem, "__file__": str(path)}
    try:
        exec(compile(source, str(path), "exec"), names)  # the user's own code, which they named
        law = names.get("LAW")
        if not isinstance(law, Law):
            raise ValueError("it defines no LAW = Law(...)")
        data = data_of(law)
        law_of(data)
    except Exception as error:
        raise InputError(f"{path}: {_where(error, path)}", HINT) from error
    return data


def _where(error: Exception, path: Path) -> str:
    """Say what went wrong in a file, with the line if there is one."""
    line, trace = getattr(error, "lineno", None), error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == str(path):
            line = trace.tb_lineno
        trace = trace.tb_next
    said = " ".join(str(error).split()) or "no reason given"
    if isinstance(error, ValueError) and line is None:
        return said
    return f"{f'line {line}: ' if line else ''}{type(error).__name__}: {said}"


def data_of(law: Law) -> dict[str, Any]:
    """Return a user's friction law as plain values (numbers, texts, lists), from which `law_of` makes an equal law."""
    if law.number is not None or law.state is not None or law.word:
        raise ValueError("a law of your own has no `number`, `state` or `word`")
    _require_linear(law)
    tracer = Tracer()
    p = tracer.symbols("p", len(law.values))
    torque = law.torque(p, At(*(tracer.symbol(Slot(name, 0)) for name in READ)))
    return {
        "name": law.name,
        "about": law.about,
        "formula": law.formula,
        "against": law.against,
        "values": [
            {
                "name": value.name,
                "unit": value.unit,
                "signed": value.low < 0.0,
                "start": float(value.start),
                "within": value.within,
            }
            for value in law.values
        ],
        "program": show(tracer.finish([(Slot("torque", 0), torque)])),
    }


def _require_linear(law: Law) -> None:
    """ValueError where the torque of a sum of values is not the sum of the torques."""
    rng = np.random.default_rng(0)
    at = At(*(rng.normal(size=STATES) for _ in READ))
    one, other = rng.uniform(0.5, 2.0, (2, len(law.values), STATES))
    torques = [
        np.asarray(law.torque(list(p), at)) + np.zeros(STATES) for p in (one, other, 3.0 * one - other)
    ]
    size = np.abs(torques).max()
    if not np.isfinite(size):
        raise ValueError("`torque` is not finite at an ordinary state")
    if np.abs(torques[2] - (3.0 * torques[0] - torques[1])).max() > ROUNDED * max(size, 1e-300):
        raise ValueError("`torque` is not linear in the values p, as a fit needs")


def laws_of(content: object) -> dict[str, Law]:
    """Return friction laws by name from plain values that `data_of` made. Raises ValueError if the values are damaged,
    or if two laws or two values have one name."""
    if not isinstance(content, list | tuple) or len(content) > MOST_LAWS:
        raise ValueError(f"laws: expected a list of at most {MOST_LAWS}")
    laws = [law_of(data) for data in content]
    for names in ([law.name for law in laws], [name for law in laws for name in law.parameters]):
        if len(set(names)) < len(names):
            raise ValueError(f"two friction laws or values have the same name, among {', '.join(names)}")
    return {law.name: law for law in laws}


def law_of(data: object) -> Law:
    """Return the friction law that `data_of` converted to plain values. Raises ValueError if the values are damaged."""
    if not isinstance(data, Mapping):
        raise ValueError("a friction law is no table")
    values = data.get("values")
    if not isinstance(values, list) or not 0 < len(values) <= MOST_VALUES:
        raise ValueError(f"values: expected 1 to {MOST_VALUES}")
    found = tuple(_value(value) for value in values)
    names = [str(value.name) for value in found]
    known = {name for law in LAWS.values() for name in _names(law)} | set(LAWS)
    name = _name(data.get("name"), known)
    if len(set(names)) < len(names) or known & set(names):
        raise ValueError(
            f"values are called {', '.join(names)}: expected other names than psdmc's, each once"
        )
    if any(value.within and value.within not in {*names, *known} for value in found):
        raise ValueError("`within` is no value of a friction law")
    return Law(
        name=name,
        about=_text(data, "about"),
        formula=_text(data, "formula"),
        values=found,
        torque=_torque(data.get("program"), len(found)),
        against=data.get("against") is True,
    )


def _names(law: Law) -> tuple[str, ...]:
    """Names of values of psdmc's laws; of those with a number, what they begin with."""
    return tuple(value.name if isinstance(value.name, str) else law.name for value in law.values)


def _name(value: object, known: set[str]) -> str:
    if not isinstance(value, str) or not NAME.fullmatch(value) or value in known or value == "laws":
        raise ValueError(
            f"name {str(value)[:60]!r}: expected a word of small letters that no friction law of psdmc has"
        )
    return value


def _value(data: object) -> Value:
    if not isinstance(data, Mapping) or not isinstance(data.get("name"), str):
        raise ValueError("a value has no name")
    name, start = data["name"], data.get("start", 0.0)
    if not NAME.fullmatch(name):
        raise ValueError(f"value {name[:60]!r}: expected a word of small letters")
    if isinstance(start, bool) or not isinstance(start, int | float) or not math.isfinite(start):
        raise ValueError(f"value {name}: start: expected a number")
    within = data.get("within", "")
    low = -math.inf if data.get("signed") is True else 0.0
    return Value(name, _text(data, "unit"), low, start=float(start), within=str(within))


def _text(data: Mapping[str, Any], key: str) -> str:
    value = data.get(key)
    if not isinstance(value, str) or not value.isprintable() or not 0 < len(value) <= LONGEST:
        raise ValueError(f"{key}: expected a text of at most {LONGEST} characters")
    return value


def _torque(text: object, count: int) -> Callable[[Sequence[Scalar], At], Scalar]:
    """A law's own function, of the text of its PROGRAM."""
    if not isinstance(text, str) or text.count("\n") > MOST_INSTRUCTIONS:
        raise ValueError(f"program: expected a text of at most {MOST_INSTRUCTIONS} lines")
    program = parse(text)
    known = {Slot("p", k) for k in range(count)} | {Slot(name, 0) for name in READ}
    if set(program.inputs()) - known or [slot for slot, _ in program.outputs] != [Slot("torque", 0)]:
        raise ValueError("program: reads or gives something else than a friction law does")
    return _of_program(program)


def _of_program(program: Program) -> Callable[[Sequence[Scalar], At], Scalar]:
    def torque(p: Sequence[Scalar], at: At) -> Scalar:
        values: list[Scalar] = []
        for instr in program:
            if instr.slot is not None:
                vector, index = instr.slot
                values.append(p[index] if vector == "p" else getattr(at, vector))
            else:
                value = instr.value
                values.append(instr.op(*(values[a] for a in instr.args)) if value is None else value)
        return values[program.outputs[0][1]]

    return torque
