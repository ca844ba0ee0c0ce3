"""The accuracy that the README promises, on every robot at hand: E, P and theta_b in NumPy, the interpreted PROGRAM and the
compiled C against Pinocchio.

`pytest tests/end_to_end/test_accuracy_table.py -rP` prints the largest error of each function on each robot;
`make test-accuracy` takes all of them and compiles them as psdmc.compile does, `make test` one of each kind, and C of few.
"""

from __future__ import annotations

import os
from collections.abc import Mapping

import pytest
from answers import Questions, compiled_answers, errors, numpy_answers, program_answers, too_large
from lowered import lowered
from robots_at_hand import BUNDLED, FOREIGN, GENERIC, NAMES, loaded, subject
from slow_cases import slow_but_for
from unoptimised import compiled as library

from psdmc.backends.c.package import package_view
from psdmc.backends.info import EmitOptions, package_info
from psdmc.derivation.derive import provenance_of
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program.kernel import Kernel
from psdmc.toolchain.call import CompiledRobot
from psdmc.toolchain.interface import interface_of

FEW = 100
"""States at which generic robots' other functions are evaluated from E and P: theirs are the largest."""

WHOLE = os.environ.get("PSDMC_ACCURACY") == "whole"
LIKE_ANOTHER = ("UR10", "Z1", "Kinova", "Panda", "denso_floor", *GENERIC)
"""Robots that differ from UR5, kr6, lbr7 and denso_wall in lengths, gravity or their count of joints alone; chains with
oblique axes are in tests/derivation/test_derived_torques.py."""

SHOWN = NAMES if WHOLE else tuple(name for name in NAMES if name not in LIKE_ANOTHER)
IN_C = NAMES if WHOLE else ("two_link", "scara", "rounded_arm", "kr6")
"""Two joints, a sliding one, numbers that are rounded, a whole arm."""
OPTIMISED = NAMES if WHOLE else ("two_link", "scara")
"""Robots whose C is compiled with optimisation. What the C of the others says is compiled without, in a fifth of the
time."""


def told(label: str, found: dict[str, float]) -> dict[str, float]:
    print(label, *(f"{name:<36} {error:.1e}" for name, error in found.items()), sep="\n  ")
    return found


@pytest.mark.parametrize("name", SHOWN)
def test_the_model_in_numpy(name: str):
    robot = subject(name)
    questions = Questions(robot)
    few = Questions(robot, FEW) if name in GENERIC else questions

    found = errors(
        questions, [("inverse_dynamics", robot.model.inverse_dynamics(*questions.of("inverse_dynamics")))]
    )
    found |= errors(few, numpy_answers(robot.model, few))

    assert not too_large(told(robot.label, found))


@pytest.mark.parametrize(
    "name", slow_but_for([name for name in IN_C if WHOLE or name not in ("two_link", "kr6")], IN_C)
)
def test_its_program_and_its_c(name: str):
    robot = subject(name, expand=name not in GENERIC)  # E and P of those are too large to be lowered
    questions = Questions(robot)

    kernels = lowered(robot.model)

    found = errors(questions, program_answers(kernels, robot.model, questions))
    found |= errors(questions, compiled_answers(compiled(name, robot.model, kernels), robot.model, questions))

    assert not too_large(told(robot.label, found))
    assert len(found) == 2 * 15 + 15, "every function in every form"


def compiled(name: str, model: DynamicsModel, kernels: Mapping[str, Kernel]) -> CompiledRobot:
    """As psdmc.compile, of kernels at hand: lowering takes longer than all else here."""
    package = package_view(package_info(model), kernels, EmitOptions())
    return CompiledRobot(interface_of(package), library(package, name in OPTIMISED))


@pytest.mark.parametrize("name", [*BUNDLED, *FOREIGN])
def test_snapping_is_stated_and_small(name: str):
    robot = loaded(name)
    stated = provenance_of(robot)

    assert bool(stated["snapped"]) == bool(robot.snap_report) == (stated["snap_torque_change"] is not None)
    if robot.snap_report:
        largest = max(stated["snap_torque_change"])
        print(f"{name}: snapping changed torques by at most {largest:.1e} N m")
        assert 0.0 < largest < 0.1
