"""Forward dynamics and its derivatives in C, against Pinocchio and difference quotients."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARM, EVERY, bench, matches_pinocchio
from direct import Direct
from robots_at_hand import drawn
from slow_cases import slow_but_for
from unoptimised import without_optimisation

from psdmc.compiler import compile
from psdmc.functions import RECIPES
from psdmc.lower.kernels import lower
from psdmc.program.interpret import interpret
from psdmc.program.signature import Sizes

ALLOWED = {"inverse_dynamics_derivatives": 1e-11, "forward_dynamics_derivatives": 1e-9}
"""Errors on random robots, relative to each block's largest entry."""


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_they_are_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("forward_dynamics_derivatives", robot, real)


RANDOM = [(201, "RRPRR", False), (202, "PRRRR", True), (203, "RRRRRR", False)]


@pytest.mark.parametrize(("seed", "kinds", "tidy"), slow_but_for(RANDOM[:2], RANDOM, spread=True))
def test_on_random_robots_the_programs_are_pinocchios(seed: int, kinds: str, tidy: bool) -> None:
    """Those of inverse dynamics too; what sliding joints alone do not feel is zero but for rounding."""
    robot, rng = drawn(seed, kinds, tidy=tidy), np.random.default_rng(seed)
    given = {name: rng.uniform(-3.0, 3.0, (50, len(kinds))) for name in ("q", "qd", "qdd")}
    given["tau"] = robot.pinocchio.inverse_dynamics(*given.values())
    kernels = lower(robot.model, "factored", tuple(ALLOWED), theta_variants=False)
    for name, allowed in ALLOWED.items():
        sizes = RECIPES[name].signature.sizes(Sizes.of_chain(len(kinds), robot.model.l))
        found = interpret(kernels[name].single, given, sizes)
        expected = RECIPES[name].pinocchio(robot.pinocchio, given)
        least = 1e-9 * max(np.abs(values).max() for values in expected.values())
        for block, values in expected.items():
            error = np.abs(found[block].reshape(values.shape) - values).max()
            assert error <= allowed * max(np.abs(values).max(), least), f"{name}: {block}"


@pytest.mark.parametrize("robot", sorted({"scara", ARM}))
def test_they_are_the_slopes_of_forward_dynamics(robot: str) -> None:
    own = bench(robot)
    step, states = 1e-6, [own.given[name][:10] for name in ("q", "qd", "tau")]
    with without_optimisation():
        forward = compile(own.model, functions=["forward_dynamics"]).forward_dynamics
    found = own.robot.forward_dynamics_derivatives(*states)
    np.testing.assert_allclose(found.qdd, forward(*states), rtol=1e-9, atol=1e-9)
    for by, block in enumerate((found.dqdd_dq, found.dqdd_dqd, found.dqdd_dtau)):
        for j in range(own.model.n):
            ahead, behind = (
                [
                    values + h * np.eye(own.model.n)[j] if k == by else values
                    for k, values in enumerate(states)
                ]
                for h in (step, -step)
            )
            slope = (forward(*ahead) - forward(*behind)) / (2 * step)
            np.testing.assert_allclose(block[:, :, j], slope, atol=1e-5 * np.abs(block).max())


@pytest.mark.parametrize("layout", ["batch", "batch_soa"])
def test_of_many_states_only_those_become_nan_that_have_no_accelerations(layout: str) -> None:
    """One in a whole block of lanes, one in the last, which is not; the call says which was the first."""
    own, count = bench(ARM), 11
    n = own.model.n
    lanes = layout == "batch_soa"
    inputs = [own.given[name][:count].copy() for name in ("q", "qd", "tau")]
    inputs[0][[3, 9]] = np.nan
    outputs = [np.zeros((16, size)) for size in (n, n * n, n * n, n * n)]
    given = [_in_lanes(values) if lanes else values for values in inputs]
    assert (
        Direct(own.package, own.robot.library)(
            f"forward_dynamics_derivatives_{layout}", count, *given, *outputs
        )
        == 4
    )
    for values in outputs:
        rows = values.reshape(2, -1, 8).transpose(0, 2, 1).reshape(16, -1) if lanes else values
        assert np.isnan(rows[[3, 9]]).all()
        assert np.isfinite(np.delete(rows[:count], [3, 9], axis=0)).all()
        assert (np.delete(rows[:count], [3, 9], axis=0) != 0.0).any(axis=1).all()


def _in_lanes(rows: np.ndarray) -> np.ndarray:
    """Blocks of eight states, [variable][lane]; lanes without a state repeat the first."""
    filled = np.concatenate([rows, np.repeat(rows[:1], -len(rows) % 8, axis=0)])
    return np.ascontiguousarray(filled.reshape(-1, 8, rows.shape[1]).transpose(0, 2, 1))
