"""Tests of gradients of functions with contacts by theta_b."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from against_pinocchio import INTERPRETED, bench, program_matches_pinocchio
from contact_trees import OneByOne
from loop_trees import four_bar_legs

from psdmc.functions import RECIPES, SIGNATURES
from psdmc.robot.reference import reference
from psdmc.verification.check import with_passive_joints


def made_for(name: str) -> tuple[Callable[[str], None], Callable[..., None]]:
    """Tests of the gradient of function `name`: its PROGRAMs, and loops and contacts together. tests/frameworks compares
    with differences along a direction of theta_b."""
    function = f"{name}_vjp_parameters"

    @pytest.mark.parametrize("robot", INTERPRETED)
    def of_programs(robot: str) -> None:
        program_matches_pinocchio(function, robot)
        assert bench(robot).long_kernels[function].theta is False

    @pytest.mark.parametrize(
        "made", [lambda model: model, pytest.param(OneByOne, marks=pytest.mark.slow)], ids=["NumPy", "C"]
    )
    def of_loops_and_contacts(made: Callable[..., Any]) -> None:
        """Differences of Pinocchio's motions and forces between two robots whose bodies differ."""
        own = four_bar_legs()
        model, given = own.model, {name: array[:4] for name, array in own.given.items()}
        given["active"] = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0], [1.0, 0.0]])
        rng = np.random.default_rng(3)
        outputs = [output.name for output in SIGNATURES[name].outputs]
        rows = given["cotangent_forces"].shape[1]
        weights = {
            f"cotangent_{each}": rng.normal(size=(4, size))
            for each, size in zip(outputs, (model.nv, rows), strict=True)
        }
        change, step = rng.normal(size=model.l) * np.abs(model.theta_b), 1e-3
        read = with_passive_joints(model, own.loaded)

        def weighted_by_pinocchio(h: float) -> np.ndarray:
            x = model.mechanism.parameters.reshape(-1) + h * (model.representative @ change)
            robot = reference(read, snapped=False, parameters=x.reshape(len(model.mechanism), -1))
            found = RECIPES[name].pinocchio(robot, given)
            return np.sum(
                [(weights[f"cotangent_{each}"] * found[each]).sum(axis=1) for each in outputs], axis=0
            )

        first, second = (
            (weighted_by_pinocchio(h) - weighted_by_pinocchio(-h)) / (2.0 * h) for h in (step, 2.0 * step)
        )
        expected = (4.0 * first - second) / 3.0
        states = [(given | weights)[each.name] for each in SIGNATURES[function].inputs]
        gradient = getattr(made(model), function)(*states).grad_theta_b
        scale = np.abs(gradient * change).sum(axis=1)
        assert (np.abs(gradient @ change - expected) < 1e-7 * scale).all()

    return of_programs, of_loops_and_contacts
