"""LuGre: the compiled integrator against scipy's stiff one, closed forms, and the generated C."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from psdmc.calibration.identify import state_friction
from psdmc.calibration.identify.state_friction import ActuatorView, actuator_files, calibrated_actuators
from psdmc.errors import InputError
from psdmc.friction.terms import STATE_LAW
from psdmc.model.calibrated_json import from_json
from psdmc.toolchain.compiler_command import find_compiler


class Lugre(NamedTuple):
    """The seven of (12) to (14)."""

    coulomb: float
    static: float
    stribeck_velocity: float
    viscous: float
    viscous_exponent: float
    stiffness: float
    damping: float


def friction_torque(friction: Lugre, *along: Any, **more: Any) -> np.ndarray:
    return state_friction.friction_torque(np.array(friction), *along, **more)


STIFF = Lugre(9.59, 12.5, 0.0144, 23.7, 0.61, 288e3, 22.8)
SOFT = Lugre(3.59, 4.0, 0.21, 2.38, 0.63, 5.36e3, 8.91)


@pytest.mark.parametrize("friction", [STIFF, SOFT])
def test_it_follows_a_stiff_integrator_through_presliding_and_reversals(friction: Lugre):
    period = 1e-3
    time = np.arange(0.0, 1.5, period)
    w = 2 * np.pi * 1.3

    def speed(t):
        return 0.4 * np.sin(w * t) * np.minimum(t, 1.0) ** 2

    def rate(t, z):
        v = speed(t)
        peak = (friction.static - friction.coulomb) * np.exp(-((v / friction.stribeck_velocity) ** 2))
        return v - np.abs(v) * z * friction.stiffness / (friction.coulomb + peak)

    solved = solve_ivp(rate, (0, time[-1]), [0.0], "Radau", time, rtol=1e-9, atol=1e-14, max_step=2e-3)
    z, v = solved.y[0], speed(time)
    viscous = friction.viscous * np.abs(v) ** friction.viscous_exponent * np.sign(v)
    expected = friction.stiffness * z + friction.damping * rate(time, z) + viscous

    found = friction_torque(friction, v, period)

    assert np.abs(found - expected).max() < 5e-3 * np.abs(expected).max()
    assert np.sqrt(np.mean((found - expected) ** 2)) < 3e-4 * np.abs(expected).max()


def steady_torque(friction: Lugre, qd: float) -> float:
    """Friction torque in steady sliding: sigma_0 g(qd) sign(qd) plus the viscous part."""
    peak = (friction.static - friction.coulomb) * np.exp(-((qd / friction.stribeck_velocity) ** 2))
    magnitude = friction.coulomb + peak + friction.viscous * abs(qd) ** friction.viscous_exponent
    return float(np.sign(qd) * magnitude)


@pytest.mark.parametrize("period", [1e-5, 1e-3, 0.1, 10.0])
def test_steady_sliding_is_reached_and_kept_for_any_step(period: float):
    speeds = np.full(1000, -0.5)

    found = friction_torque(STIFF, speeds, period)

    assert found[-1] == pytest.approx(steady_torque(STIFF, -0.5), rel=1e-6)
    assert np.abs(found).max() < 1e3


def test_small_motion_is_a_spring():
    speeds = np.full(11, 1e-7)

    found = friction_torque(STIFF, speeds, 1e-3)

    viscous = STIFF.viscous * 1e-7**STIFF.viscous_exponent
    spring = STIFF.stiffness * 1e-7 * 10e-3 + STIFF.damping * 1e-7
    assert found[-1] - viscous == pytest.approx(spring, rel=1e-4)


def test_standing_still_keeps_the_bristles_as_they_are():
    found = friction_torque(STIFF, np.zeros(5), 1e-3, z=2e-5)

    assert found.tolist() == pytest.approx([STIFF.stiffness * 2e-5] * 5)


@pytest.mark.parametrize(
    "wrong",
    [
        (0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0),
        (2.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0),
        (1.0, 1.0, 1.0, 1.0, 1.0, 1.0, -1.0),
    ],
)
def test_impossible_parameters_are_refused(wrong: tuple[float, ...]):
    with pytest.raises(InputError, match="lugre friction: "):
        STATE_LAW.require(np.array(wrong))


@pytest.mark.parametrize(
    ("real", "ctype", "tolerance"), [("double", ctypes.c_double, 1e-12), ("float", ctypes.c_float, 1e-4)]
)
def test_the_generated_functions_do_the_same(tmp_path: Path, real: str, ctype, tolerance: float):
    view = ActuatorView(
        real=real,
        robot="Arm 7",
        joint_names=("a", "b"),
        friction=(np.array(STIFF), np.array(SOFT)),
        torque_constants=(36.1, 17.9),
    )
    library = built(tmp_path, view)
    count, dt = 400, 1e-3
    speeds = np.stack([np.full(count, 0.02), np.linspace(-0.3, 0.3, count)], axis=1)
    z, tau = (ctype * 2)(), (ctype * 2)()
    out = np.empty((count, 2))
    for k in range(count):
        getattr(library, f"{view.name}_friction")((ctype * 2)(*speeds[k]), z, ctype(dt), tau)
        out[k] = tau[:]

    # at a constant speed the step is exact: the same as the simulation, one sample later
    expected = friction_torque(STIFF, np.full(count + 1, 0.02), dt)[1:]
    assert np.abs(out[:, 0] - expected).max() < tolerance * np.abs(expected).max()
    current = (ctype * 2)(72.2, 17.9)
    getattr(library, f"{view.name}_motor_current")(current, current)
    assert current[:] == pytest.approx([2.0, 1.0], rel=1e-6)


def built(folder: Path, view: ActuatorView) -> ctypes.CDLL:
    for path, text in actuator_files(view).items():
        (folder / path).parent.mkdir(exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")
    source = next((folder / "src").glob("*.c"))
    warnings = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wdouble-promotion", "-Werror"]
    words = [
        *find_compiler().command,
        "-std=c99",
        *warnings,
        "-fPIC",
        "-shared",
        "-Iinclude",
        str(source),
        "-lm",
    ]
    subprocess.run([*words, "-o", "actuators.so"], cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "actuators.so"))


def test_a_calibration_without_lugre_has_no_friction_function():
    plain = {"friction": [{"joint": "a", "name": "coulomb", "value": 1.0}], "motors": []}

    with pytest.raises(InputError, match=r"no friction with a state was identified for joint\(s\) a"):
        calibrated_actuators("arm", ("a",), from_json(plain))
