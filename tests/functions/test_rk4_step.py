"""A step of fourth-order Runge-Kutta against Pinocchio, and its order."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from against_pinocchio import INTERPRETED, SEVERAL, bench, matches_pinocchio, program_matches_pinocchio


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("rk4_step", robot, real)


@pytest.mark.parametrize("robot", INTERPRETED)
def test_its_programs_are_pinocchios(robot: str) -> None:
    program_matches_pinocchio("rk4_step", robot)


def test_half_the_step_has_a_sixteenth_of_the_error() -> None:
    """Fourth order, over a tenth of a second of free motion; the truth by steps a tenth as long."""
    own = bench("sliding")
    start = [0.2 * own.given[name][:5] for name in ("q", "qd")]

    def after(steps: int) -> np.ndarray:
        q, qd = start
        for _ in range(steps):
            q, qd = own.robot.rk4_step(q, qd, np.zeros_like(q), 0.1 / steps)
        return np.concatenate([q, qd], axis=1)

    truth = after(400)
    long, short = (np.abs(after(steps) - truth).max() for steps in (10, 20))
    assert 12.0 < long / short < 20.0


def test_the_jacobians_that_the_documents_make_of_it_are_its_slopes() -> None:
    document = Path(__file__).parents[2] / "docs" / "derivatives.md"
    blocks = re.findall(r"```python\n(.*?)```", document.read_text(encoding="utf-8"), re.DOTALL)
    (code,) = (block for block in blocks if "def rk4_jacobians" in block)
    names: dict[str, Any] = {"np": np}
    exec(code, names)
    own, n, dt, step = bench("sliding"), 4, 0.01, 1e-6
    states = [own.given[name][:5] for name in ("q", "qd", "tau")]
    whole = np.concatenate(names["rk4_jacobians"](own.robot, *states, dt), axis=-1)
    for j, unit in enumerate(np.eye(3 * n)):
        ahead, behind = (
            np.concatenate(own.robot.rk4_step(*moved(states, h * unit), dt), axis=-1) for h in (step, -step)
        )
        np.testing.assert_allclose(
            whole[..., j], (ahead - behind) / (2 * step), atol=1e-7 * np.abs(whole).max()
        )


def moved(states: list[np.ndarray], way: np.ndarray) -> list[np.ndarray]:
    return [x + part for x, part in zip(states, np.split(way, len(states)), strict=True)]


def test_a_stage_without_a_positive_mass_matrix_spoils_the_step() -> None:
    own = bench("kr6")
    states = [own.given[name][:9] for name in ("q", "qd", "tau")]
    for output in own.robot.rk4_step(*states, 0.01, theta_b=-np.asarray(own.model.theta_b)):
        assert np.isnan(output).all()
