"""python -m psdmc.bench.demo MODEL: print the operations, errors and times of a model's generated functions."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from psdmc import compiler
from psdmc.bench.case import Case
from psdmc.bench.results import BenchResult, CaseResult, Measurement
from psdmc.bench.run import Settings, relative_error, run
from psdmc.errors import exit_status_of
from psdmc.functions import RECIPES
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.load import load
from psdmc.model.random_states import states_of
from psdmc.program.signature import Sizes
from psdmc.progress import Progress
from psdmc.robot.reference import reference
from psdmc.toolchain.call import CompiledRobot
from psdmc.verification.check import source_of

OURS, THEIRS = "psdmc factored", "Pinocchio"
SETTINGS = Settings(rounds=3, rivals=(OURS, THEIRS))
"""Fewer trials than `make bench`: a quick estimate."""

STATES = 1000
SEED = 2021


def demo(model: DynamicsModel, progress: Progress) -> str:
    """The table as text."""
    case = Case(model.mechanism.name, model)
    functions = tuple(name for name in case.functions if not RECIPES[name].times_theta)
    progress("compiling, and comparing with Pinocchio")
    errors = errors_against_pinocchio(model, compiler.compile(model, "factored", functions), functions)
    result = run([case], replace(SETTINGS, functions=functions), progress)
    return "\n".join(_lines(model, errors, result))


def errors_against_pinocchio(
    model: DynamicsModel, robot: CompiledRobot, functions: Sequence[str]
) -> dict[str, float]:
    """Return, for each compiled function, the largest difference from Pinocchio's results at random states. The
    difference of each output array is divided by the largest value of the array."""
    pinocchio = reference(source_of(model))
    rng, sizes = np.random.default_rng(SEED), Sizes.of(model.mechanism, model.l)
    q, qd, qdd = states_of(model.mechanism, rng, STATES)
    given = {"q": q, "qd": qd, "qdd": qdd, "tau": pinocchio.inverse_dynamics(q, qd, qdd)}
    for quantity in (quantity for name in functions for quantity in RECIPES[name].signature.inputs):
        if quantity.name not in given:
            drawn = rng.uniform(-1.0, 1.0, (STATES, *sizes.shape(quantity.axes)))
            given[quantity.name] = quantity.drawn(drawn)
    errors: dict[str, float] = {}
    for name in functions:
        signature = RECIPES[name].signature
        found = robot.call(signature, [given[quantity.name] for quantity in signature.inputs])
        expected = RECIPES[name].pinocchio(pinocchio, given).values()
        pairs = zip(found if len(signature.outputs) > 1 else (found,), expected, strict=True)
        errors[name] = max(relative_error(*(v.reshape(STATES, -1) for v in pair)) for pair in pairs)
    return errors


def _lines(model: DynamicsModel, errors: dict[str, float], result: BenchResult) -> Iterator[str]:
    case, machine = result.cases[0], result.machine
    p = "not expanded" if model.p is None else str(model.p)
    yield ""
    yield f"{model.mechanism.name}: {model.n} joints, p = {p} monomials, l = {model.l} base parameters"
    yield f"{machine.processor}, {machine.compiler}, {machine.flags}"
    yield ""
    yield (
        f"{'':<30}{'operations':>14}{'largest error':>16}{'psdmc':>12}{'psdmc batch':>13}{'Pinocchio C++':>15}{'':>8}"
    )
    yield f"{'':<30}{'mul + add':>14}{'to Pinocchio':>16}{'ns/call':>12}{'ns/state':>13}{'ns/call':>15}{'faster':>8}"
    for name, error in errors.items():
        yield _row(case, name, error)
    yield ""
    if not case.idle:
        yield "The machine was busy with other work meanwhile: times are not reliable."
    for missing in (*case.unavailable, *case.wrong):
        yield f"not measured: {missing.rival}: {missing.reason}"


def _row(case: CaseResult, name: str, error: float) -> str:
    ours, rows, theirs = (case.best(OURS, name), case.best(OURS, name, "rows"), case.best(THEIRS, name))
    operations = "{} + {}".format(*ours.operations) if ours and ours.operations else "-"
    ratio = f"{theirs.ns / ours.ns:.1f}x" if ours and theirs else "-"
    label = name.replace("_", " ")
    return (
        f"{label:<30}{operations:>14}{error:>16.1e}{_ns(ours):>12}{_ns(rows):>13}{_ns(theirs):>15}{ratio:>8}"
    )


def _ns(measured: Measurement | None) -> str:
    return f"{measured.ns:.1f}" if measured else "-"


def main() -> int:
    """Print the table of functions for the model that the command line names."""
    parser = argparse.ArgumentParser(prog="python -m psdmc.bench.demo", description=__doc__)
    parser.add_argument("model", type=Path, help="model file made by psdmc derive (.npz)")
    options = parser.parse_args()
    return exit_status_of(lambda: print(demo(load(options.model), _tell)))


def _tell(step: str) -> None:
    print(step, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
