"""Ten seconds of motion: the compiled forward dynamics under scipy's integrator, against Pinocchio's aba under the same.

Pinocchio reads the URDF on its own; energies are Pinocchio's too, so that no error of psdmc can hide in its own measure.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest
from bundled import robot_path
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from unoptimised import without_optimisation

import psdmc

Array = NDArray[np.float64]
Accelerations = Callable[[Array, Array, Array], Array]
Law = Callable[[float, Array, Array], Array]

SECONDS = 10.0
N = 6
START = np.array([0.2, -0.8, 0.5, 0.3, -0.6, 0.4])
STIFFNESS, DAMPING = np.array([80.0, 80, 60, 10, 10, 5]), np.array([10.0, 10, 8, 1, 1, 0.3])


@dataclass(frozen=True)
class Motion:
    """States (k, 6), and what the total energy lacks of its start and the work done since, (k,) J."""

    q: Array
    qd: Array
    imbalance: Array
    kinetic: Array


class PinocchioArm:
    """The URDF as Pinocchio reads it; `continuous` joints take (cos, sin) there."""

    def __init__(self, path: Path) -> None:
        self.model: Any = pinocchio.buildModelFromUrdf(str(path))
        self.data = self.model.createData()
        self.neutral = pinocchio.neutral(self.model)

    def _at(self, q: Array) -> Array:
        return np.asarray(pinocchio.integrate(self.model, self.neutral, q))

    def accelerations(self, q: Array, qd: Array, tau: Array) -> Array:
        return np.asarray(pinocchio.aba(self.model, self.data, self._at(q), qd, tau))

    def kinetic(self, q: Array, qd: Array) -> float:
        return float(pinocchio.computeKineticEnergy(self.model, self.data, self._at(q), qd))

    def potential(self, q: Array) -> float:
        return float(pinocchio.computePotentialEnergy(self.model, self.data, self._at(q)))


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bundled URDF with its rounded right angles written out: both sides read the same numbers."""
    text = robot_path("rounded_arm").read_text(encoding="utf-8")
    for rounded, exact in (("1.5708", math.pi / 2), ("3.1416", math.pi), ("0.7854", math.pi / 4)):
        text = text.replace(rounded, repr(exact))
    file = tmp_path_factory.mktemp("exact") / "arm.urdf"
    file.write_text(text, encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def arm(path: Path) -> PinocchioArm:
    return PinocchioArm(path)


@pytest.fixture(scope="module")
def compiled(path: Path) -> Accelerations:
    model = psdmc.derive(path, expand=False)
    with without_optimisation():
        return psdmc.compile(model, functions=["forward_dynamics"]).forward_dynamics


def _motion(accelerations: Accelerations, law: Law, arm: PinocchioArm) -> Motion:
    def rates(time: float, state: Array) -> Array:
        q, qd = state[:N], state[N : 2 * N]
        tau = law(time, q, qd)
        return np.concatenate([qd, accelerations(q, qd, tau), [qd @ tau]])

    start = np.concatenate([START, np.zeros(N + 1)])
    times = np.linspace(0.0, SECONDS, 101)
    found = solve_ivp(rates, (0.0, SECONDS), start, "DOP853", times, rtol=1e-11, atol=1e-12)
    assert found.success
    q, qd, work = found.y[:N].T, found.y[N : 2 * N].T, found.y[-1]
    kinetic = np.array([arm.kinetic(*state) for state in zip(q, qd, strict=True)])
    energy = kinetic + np.array([arm.potential(row) for row in q])
    return Motion(q, qd, energy - energy[0] - work, kinetic)


def _led(time: float, q: Array, qd: Array) -> Array:
    """Springs towards a moving pose, and dampers: neighbouring motions run together."""
    wanted = START + 0.5 * np.sin(0.7 * np.arange(1, N + 1) * time)
    return STIFFNESS * (wanted - q) - DAMPING * qd


def _free(time: float, q: Array, qd: Array) -> Array:
    return np.zeros(N)


@pytest.mark.slow
def test_a_led_motion_is_pinocchios_for_ten_seconds(compiled: Accelerations, arm: PinocchioArm) -> None:
    own, reference = _motion(compiled, _led, arm), _motion(arm.accelerations, _led, arm)
    assert own.kinetic.max() > 10.0  # J: the arm does move
    assert np.abs(own.q - reference.q).max() < 1e-12
    assert np.abs(own.qd - reference.qd).max() < 1e-11
    assert np.abs(own.imbalance).max() < 1e-12 * own.kinetic.max()


def test_a_free_fall_keeps_its_energy_for_ten_seconds(compiled: Accelerations, arm: PinocchioArm) -> None:
    """Chaotic: two integrations differ in all digits after 5 s, but each keeps its energy as well as its integrator can."""
    own, reference = _motion(compiled, _free, arm), _motion(arm.accelerations, _free, arm)
    most = own.kinetic.max()
    assert most > 100.0
    assert np.abs(own.imbalance).max() < 1e-9 * most
    assert np.abs(reference.imbalance).max() < 1e-9 * most
