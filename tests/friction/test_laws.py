"""Friction laws: formula, derivative and C of each; and that no other file knows one by its name."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from cffi import FFI

from psdmc.backends.c.friction import ScalarFunction, calls_in
from psdmc.backends.c.render import environment
from psdmc.friction.joints import Friction, ordered
from psdmc.friction.law import At, Term
from psdmc.friction.laws import LAWS
from psdmc.friction.terms import STATE_LAW, named, options_of, state_programs
from psdmc.program.interpret import interpret
from psdmc.program.program import Program, Slot
from psdmc.program.slopes import Block, jacobians
from psdmc.program.trace import Tracer
from psdmc.toolchain.compiler_command import find_compiler

sys.path.insert(0, str(Path(__file__).parents[2] / "docs"))
import friction_table

PACKAGE = Path(__file__).parents[2] / "psdmc"
SIGN_SPEED = 0.03

Formula = Callable[[Any, float, float], Any]
FORMULAS: dict[Term, Formula] = {
    Term(LAWS["coulomb"]): lambda v, s, load: s,
    Term(LAWS["viscous"], 1.0): lambda v, s, load: s * abs(v),
    Term(LAWS["viscous"], 0.5): lambda v, s, load: s * mpmath.sqrt(abs(v)),
    Term(LAWS["viscous"], 1.5): lambda v, s, load: s * abs(v) ** 1.5,
    Term(LAWS["viscous"], 0.7): lambda v, s, load: s * abs(v) ** 0.7,
    Term(LAWS["viscous"], 2.0): lambda v, s, load: s * v * v,
    Term(LAWS["offset"]): lambda v, s, load: mpmath.mpf(1),
    Term(LAWS["asymmetric"]): lambda v, s, load: abs(s),
    Term(LAWS["stribeck"], 0.15): lambda v, s, load: s * mpmath.exp(-((v / 0.15) ** 2)),
    Term(LAWS["load"]): lambda v, s, load: s * abs(mpmath.mpf(load)),
}
"""Torque per unit of each law's value, by mpmath: of the speed, its smooth sign and the load."""
TERMS = list(FORMULAS)
IDS = [term.names[0] for term in TERMS]
SPEEDS = [float(v) for v in np.concatenate([-np.geomspace(1e-4, 3.0, 15), np.geomspace(1e-4, 3.0, 15)])]


def exact(term: Term, v: float, load: float = -2.5) -> mpmath.mpf:
    at = mpmath.mpf(v)
    return FORMULAS[term](at, mpmath.tanh(at / mpmath.mpf(SIGN_SPEED)), load)


def test_every_law_has_a_formula_here():
    assert {term.law.name for term in TERMS} | {STATE_LAW.name} == set(LAWS)


@pytest.mark.parametrize("term", TERMS, ids=IDS)
def test_a_law_is_its_formula(term: Term):
    v = np.array(SPEEDS)
    (column,) = term.columns(At(v=v, sign=np.tanh(v / SIGN_SPEED), load=np.full_like(v, -2.5)))
    with mpmath.workdps(40):
        expected = np.array([float(exact(term, x)) for x in SPEEDS])
    assert np.allclose(np.broadcast_to(column, v.shape), expected, rtol=2e-15)


@pytest.mark.parametrize(
    "term", [t for t in TERMS if t.law.name != "load"], ids=[i for i in IDS if "load" not in i]
)
def test_its_derivative_by_the_speed_is_that_of_the_formula(term: Term):
    program = Friction((term,), np.ones((1, 1)), SIGN_SPEED).program()
    both = jacobians(program, [Block("slope", "tau", "v", 1, 1)], "forward")
    for v in SPEEDS:
        given = {"p": np.array([1.0]), "v": np.array([v]), "q": np.zeros(1)}
        found = interpret(both, given, {"tau": 1, "slope": 1})["slope"][0]
        with mpmath.workdps(40):
            expected = float(mpmath.diff(lambda x: exact(term, x), v, h=mpmath.mpf(10) ** -12))
        assert found == pytest.approx(expected, rel=1e-10, abs=1e-10)


@pytest.mark.parametrize("term", TERMS, ids=IDS)
def test_names_lead_back_to_the_term(term: Term):
    assert [named(name, LAWS) for name in term.names] == [(term, 0)]
    assert len(term.units("N")) == len(term.units()) == 1
    assert term.units("N")[0] == term.units()[0].replace("Nm", "N").replace("rad", "m")


@pytest.mark.parametrize(
    "name", ["", "viscous^1", "viscous^", "viscous^9", "stribeck_", "stribeck_1e-3", "Coulomb"]
)
def test_other_names_are_no_terms(name: str):
    assert named(name, LAWS) is None


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("coulomb viscous offset", ((1.0,), True)),
        ("viscous^0.5 coulomb viscous", ((1.0, 0.5), False)),
        ("coulomb viscous^1", "found 'viscous^1', expected coulomb, viscous, viscous^EXPONENT (above 0, to 8), offset"),
        ("coulomb stribeck_0.1", "found 'stribeck_0.1'"),
        ("viscous", "no coulomb, expected it among the terms"),
        ("coulomb coulomb", "a term twice"),
        ("coulomb viscous^2", "viscous^EXPONENT without viscous"),
        ("coulomb viscous viscous^2 viscous^3 viscous^4 viscous^5", "5 viscous terms, expected at most 4"),
    ],
)  # fmt: skip
def test_words_of_the_command_line(words: str, expected: object):
    found = options_of(words.split())
    assert found == expected or (isinstance(found, str) and found.startswith(str(expected)))


def compiled(functions: Sequence[ScalarFunction], folder: Path) -> Any:
    """The functions in C as a library, each with the name of its own."""
    texts = environment().from_string(
        '{% from "scalar_functions.jinja" import scalar_functions %}#include <math.h>\n'
        "{{ scalar_functions(functions, calls, 'double', '') }}"
    )
    source = texts.render(functions=functions, calls=calls_in(functions))
    wrappers, declared = [], []
    for one in functions:
        arguments = ", ".join(("const double *p", *(f"double {name}" for name in one.taken)))
        declared.append(f"double of_{one.name}({arguments});")
        wrappers.append(
            f"double of_{one.name}({arguments}) {{ return {one.name}({', '.join(('p', *one.taken))}); }}"
        )
    (folder / "law.c").write_text("\n".join([source, *declared, *wrappers]), encoding="utf-8")
    words = [
        *find_compiler().command,
        "-std=c99",
        "-Wall",
        "-Wextra",
        "-Wconversion",
        "-Werror",
        "-O1",
        "-fPIC",
    ]
    subprocess.run([*words, "-shared", "law.c", "-o", "law.so", "-lm"], cwd=folder, check=True)
    ffi = FFI()
    ffi.cdef("\n".join(declared))
    return ffi.dlopen(str(folder / "law.so")), ffi


def traced(term: Term) -> Program:
    tracer = Tracer()
    at = At(*(tracer.symbol(Slot(name, 0)) for name in ("q", "v", "sign", "load")))
    return tracer.finish([(Slot("out", 0), term.torque(tracer.symbols("p", len(term.names)), at))])


def test_c_of_every_law_is_its_program(tmp_path: Path):
    inputs = ("v", "sign", "load")
    functions = [ScalarFunction(f"law_{k}", traced(term), inputs, "") for k, term in enumerate(TERMS)]
    functions += [ScalarFunction(name, *found, "") for name, found in state_programs(STATE_LAW).items()]
    library, ffi = compiled(functions, tmp_path)
    rng = np.random.default_rng(2)
    seven = np.array([9.6, 12.5, 0.0144, 23.7, 0.61, 288e3, 22.8])
    for one in functions:
        p = seven if one.name in state_programs(STATE_LAW) else np.array([1.7])
        for _ in range(50):
            state = dict(
                zip(
                    one.taken, (rng.choice([-1, 1], 4) * 10.0 ** rng.uniform(-3, 0, 4)).tolist(), strict=False
                )
            )
            state |= {"z": 3e-5, "dt": abs(state["dt"])} if "dt" in state else {}
            given = {name: np.array([value]) for name, value in state.items()}
            expected = interpret(one.program, {"p": p, **given}, {"out": 1})["out"][0]
            found = getattr(library, f"of_{one.name}")(ffi.from_buffer("double[]", p), *state.values())
            assert found == pytest.approx(expected, rel=1e-12, abs=1e-15), (one.name, state)


def test_the_sum_is_the_formula_of_earlier_packages():
    """s (coulomb + viscous |v| + peak exp(-(v / v_s)^2)) + |s| asymmetry + offset, in doubles, to 1e-15 of its terms."""
    terms = [
        Term(LAWS["coulomb"]),
        Term(LAWS["viscous"], 1.0),
        Term(LAWS["viscous"], 1.5),
        Term(LAWS["stribeck"], 0.15),
    ]
    terms += [Term(LAWS["asymmetric"]), Term(LAWS["offset"])]
    values = np.array([[3.0, 0.8, 0.2, 0.6, 0.5, -0.4]])
    friction = Friction(ordered(terms), values, SIGN_SPEED)
    v = np.array(SPEEDS)[:, None]
    size = 3.0 + (0.8 * np.abs(v) ** 1.0 + 0.2 * np.abs(v) ** 1.5) + 0.6 * np.exp(-((v / 0.15) ** 2))
    sign = np.tanh(v / SIGN_SPEED)
    before = sign * size + np.abs(sign) * 0.5 - 0.4
    error = np.abs(friction.torque(v) - before)
    assert (error <= 1e-15 * (np.abs(sign * size) + np.abs(sign) * 0.5 + 0.4)).all()


NAMES = re.compile(r"coulomb|viscous|stribeck|lugre|asymmetr|load_friction", re.IGNORECASE)
MAY_NAME_LAWS = {
    "calibration/identify/friction.py": "the paper's own search for the values of the law with bristles",
    "calibration/identify/steps.py": "public options of that search",
    "calibration/identify/four_steps.py": "public options of that search",
    "report/calibrate_demo.py": "public options of that search",
    "report/truth.py": "the numbers that the paper printed, and the page that compares with them",
    "cli/calibrating.py": "help of --friction, which must not load laws",
}

PAPER = "calibration_truth.html.jinja"
"""The page that compares with the paper."""


def words_of(path: Path) -> Iterator[str]:
    """Names and strings of a module, docstrings aside."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    documents = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documents:
            yield node.value
        elif isinstance(node, ast.Name | ast.Attribute | ast.arg | ast.keyword | ast.alias):
            yield str(
                getattr(node, "id", None) or getattr(node, "attr", None) or getattr(node, "arg", None) or ""
            )


def test_no_file_but_the_laws_knows_a_law_by_name():
    """Offsets and loads are too ordinary words to look for."""
    files = [path for path in PACKAGE.rglob("*.py") if path.relative_to(PACKAGE).parts[0] != "friction"]
    found = {str(path.relative_to(PACKAGE)) for path in files if any(map(NAMES.search, words_of(path)))}
    templates = [path for path in (PACKAGE.parent / "templates").rglob("*.jinja") if path.name != PAPER]
    assert found == set(MAY_NAME_LAWS)
    assert [path.name for path in templates if NAMES.search(path.read_text(encoding="utf-8"))] == []


def test_the_page_has_the_laws_table():
    text = friction_table.PAGE.read_text(encoding="utf-8")
    assert friction_table.with_table(text) == text, "run python docs/friction_table.py"
    example = Path(__file__).parents[2] / "examples" / "friction_laws" / "ripple.py"
    law = example.read_text(encoding="utf-8").partition("LAW = ")[2].replace("WAVES", "5.0")
    assert law in text
