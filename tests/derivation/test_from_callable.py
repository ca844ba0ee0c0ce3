"""The sampled path for a user's own torque function."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from bundled import bundled_model
from random_chains import random_chain

from psdmc.derivation.derive import derive_model
from psdmc.derivation.from_callable import derive_from_callable
from psdmc.dynamics.frames import base_acceleration, frames_of
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.dynamics.parameters import bodies_of
from psdmc.errors import DerivationError, InputError
from psdmc.robot.mechanism import Mechanism


def newton_euler_of(chain: Mechanism) -> Callable[..., np.ndarray]:
    """Vectorised torques by body parameters, link by link."""
    n = len(chain)

    def torques(q, qd, qdd, X, gravity_scale):
        x = np.column_stack([X.reshape(n, 10), np.zeros(n)])
        up = tuple(gravity_scale * a for a in base_acceleration(chain))
        columns = (list(v.T) for v in (q, qd, qdd))
        found = inverse_dynamics(frames_of(chain), bodies_of(chain, x), [0.0] * n, *columns, up)
        return np.stack([np.broadcast_to(torque, len(q)) for torque in found], axis=1)

    return torques


@pytest.mark.parametrize("name", ["two_link_full", "scara"])
def test_it_finds_what_the_chain_path_finds(name: str) -> None:
    model = bundled_model(name)
    kinds = [joint.kind for joint in model.chain.joints]
    names = [f"x{i}" for i in range(10 * model.n)]
    sampled = derive_from_callable(newton_euler_of(model.chain), kinds, names, vectorised=True)
    assert np.array_equal(sampled.E, model.E)
    assert sampled.B.shape == (model.l, 10 * model.n)
    assert sampled.certificate.max() < 1e-12


def test_it_finds_oblique_axes_and_prismatic_joints() -> None:
    chain = random_chain(3, "RPR")
    kinds = [joint.kind for joint in chain.joints]
    sampled = derive_from_callable(
        newton_euler_of(chain), kinds, [f"x{i}" for i in range(30)], vectorised=True, length=0.5
    )
    model = derive_model(chain)
    assert np.array_equal(sampled.E, model.E)
    assert len(sampled.pivots) == model.l


def pendulum(q, qd, qdd, X, gravity_scale):
    """Mass moment X[0] (kg m), inertia X[1], and X[2], which is the same as X[1]."""
    return [gravity_scale * 9.81 * X[0] * np.sin(q[0]) + (X[1] + X[2]) * qdd[0]]


def test_a_pendulum_by_hand() -> None:
    model = derive_from_callable(pendulum, ["revolute"], ["mr", "I", "Im"])
    assert model.E.tolist() == [[0, 0], [1, 0], [0, 0], [0, 0], [0, 1]]
    assert model.pivots == (0, 1)
    assert np.allclose(model.B, [[1.0, 0.0, 0.0], [0.0, 1.0, 1.0]], atol=1e-15)
    assert np.allclose(model.P[0].toarray(), [[9.81, 0.0], [0.0, 1.0]], atol=1e-13)


def test_friction_is_refused() -> None:
    def rubbing(q, qd, qdd, X, gravity_scale):
        return [X[0] * qdd[0] + X[0] * np.tanh(qd[0])]

    with pytest.raises(InputError, match=r"torque 1 .* no rigid-body torque"):
        derive_from_callable(rubbing, ["revolute"], ["I"])


def test_a_function_of_another_shape_is_refused() -> None:
    with pytest.raises(InputError, match=r"returned shape \(5, 2\), expected \(5, 1\)"):
        derive_from_callable(lambda *state: [0.0, 0.0], ["revolute"], ["I"])


def test_a_grid_beyond_memory_is_refused() -> None:
    with pytest.raises(DerivationError, match="6-joint"):
        derive_from_callable(pendulum, ["revolute"] * 6, ["a"] * 60, memory=10**6)
