"""emit-c --friction: what one log's fit found, in C and C++, against its formula; and a log's way from the fit to there."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model
from command_line import status
from direct import Direct, shared_library, write_sources
from friction_logs import friction_log

from psdmc.backends.c.package import PackageView, package_view
from psdmc.backends.info import EmitOptions, package_info
from psdmc.calibration.api import calibrate
from psdmc.calibration.logs.log_files import write_log
from psdmc.compiler import emit_c
from psdmc.errors import InputError
from psdmc.lower.kernels import lower
from psdmc.model.calibrated import NumberRow, parameters_of
from psdmc.model.calibrated_json import as_json, from_json
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.linear_friction import linear_friction
from psdmc.model.load import load
from psdmc.model.store import save
from psdmc.toolchain.build_package import build_package

COULOMB, VISCOUS, CURVED, OFFSET = (
    np.array([3.0, 1.5]),
    np.array([0.8, 0.3]),
    np.array([0.2, 0.0]),
    np.array([-0.4, 0.7]),
)
SIGN_SPEED = 0.03


def formula(v: np.ndarray) -> np.ndarray:
    """Of the documents, with a second viscous term of |v|^1.5."""
    return np.tanh(v / SIGN_SPEED) * (COULOMB + VISCOUS * np.abs(v) + CURVED * np.abs(v) ** 1.5) + OFFSET


def with_friction(model: DynamicsModel, **law: object) -> DynamicsModel:
    """The model with those numbers, as psdmc 0.2 wrote them."""
    terms = {"coulomb": COULOMB, "viscous": VISCOUS, "viscous^1.5": CURVED, "offset": OFFSET}
    rows = [
        {"joint": joint, "name": name, "value": float(values[k])}
        for name, values in terms.items()
        for k, joint in enumerate(model.joint_names)
    ]
    prediction = {"law": "linear", "exponents": [1.0, 1.5], "sign_speed": SIGN_SPEED, **law}
    return replace(model, calibrated=from_json({"friction": rows, "prediction": prediction}))


@pytest.fixture(scope="module")
def arm() -> DynamicsModel:
    return with_friction(bundled_model("two_link_full"))


def package(model: DynamicsModel, real: str = "float64") -> PackageView:
    kernels = lower(model, "factored", ["kinetic_energy"])
    return package_view(package_info(model, "arm", friction=True), kernels, EmitOptions(real=real))  # type: ignore[arg-type]


@pytest.mark.parametrize(("real", "limit"), [("float64", 1e-14), ("float32", 2e-6)])
def test_c_is_the_formula(arm: DynamicsModel, real: str, limit: float, tmp_path: Path) -> None:
    library = Direct(package(arm, real), shared_library(package(arm, real), tmp_path, ["-O0"]))
    for v in np.vstack([np.zeros(2), np.random.default_rng(0).normal(size=(20, 2)), [[1e-3, -1e-3]]]):
        qd, tau_f = v.astype(real), np.empty(2, real)
        library("friction", qd, tau_f)
        assert np.abs(tau_f - formula(qd.astype(float))).max() < limit * 4.0
        library("friction", qd, qd)
        assert np.array_equal(qd, tau_f)


ASYMMETRY, PEAK, SLOW = np.array([0.5, -0.3]), np.array([0.6, 0.25]), 0.0123456789


def uneven(model: DynamicsModel) -> DynamicsModel:
    """With an asymmetry and a Stribeck effect at the first joint, and a spring, which is no friction."""
    kept = with_friction(model).calibrated
    assert kept is not None
    joints = model.joint_names
    further = [
        NumberRow(joint, "coulomb_asymmetry", float(ASYMMETRY[k]), 0.0, "Nm")
        for k, joint in enumerate(joints)
    ]
    name = f"stribeck_{SLOW!r}"
    further.append(NumberRow(joints[0], name, float(PEAK[0]), 0.0, "Nm", parameters=parameters_of(name)))
    springs = (NumberRow("*/ x", "stiffness", 1.0, 0.0, "Nm/rad"),)
    return replace(model, calibrated=replace(kept, friction=(*kept.friction, *further), springs=springs))


@pytest.mark.parametrize(("real", "limit"), [("float64", 1e-14), ("float32", 2e-6)])
def test_asymmetry_and_stribeck_in_c(real: str, limit: float, tmp_path: Path) -> None:
    view = package(uneven(bundled_model("two_link_full")), real)
    library = Direct(view, shared_library(view, tmp_path, ["-O0"]))
    peak = PEAK * [1.0, 0.0]
    for v in np.vstack([np.zeros(2), 0.02 * np.random.default_rng(0).normal(size=(20, 2)), [[1.0, -1.0]]]):
        qd, tau_f = v.astype(real), np.empty(2, real)
        library("friction", qd, tau_f)
        at = qd.astype(float)
        sign = np.tanh(at / SIGN_SPEED)
        expected = formula(at) + sign * peak * np.exp(-((at / SLOW) ** 2)) + np.abs(sign) * ASYMMETRY
        assert np.abs(tau_f - expected).max() < limit * 4.0
    header = (tmp_path / "include" / "arm" / "arm.h").read_text(encoding="utf-8")
    assert "what this function does not have: 1 spring(s). */" in header
    assert "*/ x" not in header


@pytest.mark.parametrize(
    "name", ["stribeck_", "stribeck_inf", "stribeck_-1.0", "stribeck_1e-3", "stribeck_*/"]
)
def test_a_forged_stribeck_velocity_is_refused(name: str) -> None:
    kept = as_json(with_friction(bundled_model("two_link_full")).calibrated)
    kept["friction"][0]["name"] = name
    with pytest.raises(ValueError, match="is a value of no friction law"):
        from_json(kept)


MAIN = """
#include <cstdio>
#include "arm/arm.hpp"
int main()
{
    for (double value : arm::Description::friction({0.5, -0.01})) std::printf("%.17g ", value);
    return 0;
}
"""


@pytest.mark.needs("g++")
def test_the_cpp_class_has_it_too(arm: DynamicsModel, tmp_path: Path) -> None:
    write_sources(package(arm), tmp_path)
    (tmp_path / "main.cpp").write_text(MAIN)
    strict = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror", "-Iinclude"]
    subprocess.run(["gcc", "-c", "-std=c99", *strict, "src/friction.c"], cwd=tmp_path, check=True)
    words = ["-std=c++17", *strict, "main.cpp", "friction.o", "-lm"]
    subprocess.run(["g++", *words, "-o", "main"], cwd=tmp_path, check=True)
    found = subprocess.run(["./main"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    assert np.allclose([float(word) for word in found.split()], formula(np.array([0.5, -0.01])), rtol=1e-14)


def test_one_log_s_friction_reaches_a_built_package(tmp_path: Path, capsys) -> None:
    """A log of Pinocchio's torques and that friction, calibrated, emitted, built; the self-test compares it."""
    log, _ = friction_log(
        3, 30.0, lambda q, qd: np.tanh(qd / SIGN_SPEED) * (COULOMB + VISCOUS * np.abs(qd)) + OFFSET
    )
    write_log(log, tmp_path / "log.csv")
    model = bundled_model("two_link_full")
    found = calibrate(model, tmp_path / "log.csv")
    values = {(row.joint, row.name): row for row in found.friction}
    for k, joint in enumerate(model.joint_names):
        for name, truth in (("coulomb", COULOMB), ("viscous", VISCOUS), ("offset", OFFSET)):
            row = values[joint, name]
            assert abs(row.value - truth[k]) < 3.0 * row.std + 2e-3
    found.model.save(tmp_path / "calibrated.npz")
    calibrated = load(tmp_path / "calibrated.npz")
    words = ["-o", tmp_path / "c", "--functions", "gravity", "--friction"]
    assert status("emit-c", tmp_path / "calibrated.npz", *words) == 0
    build_package(tmp_path / "c")
    header = (tmp_path / "c" / "include" / "two_link_full" / "two_link_full.h").read_text()
    assert "void two_link_full_friction(const double *qd, double *tau_f);" in header
    assert "check_friction" in (tmp_path / "c" / "test" / "self_test.c").read_text()
    damaged = tmp_path / "c" / "src" / "friction.c"
    damaged.write_text(damaged.read_text().replace("tanh(", "0.99 * tanh("))
    from psdmc.errors import ToolchainError

    with pytest.raises(ToolchainError, match="friction"):
        build_package(tmp_path / "c", edited=True)
    capsys.readouterr()
    assert status("show", tmp_path / "calibrated.npz") == 0
    said = capsys.readouterr().out
    for word in ("log: log.csv", "6,000 rows", "R^2 held out", "coulomb [Nm]", "+-"):
        assert word in said
    assert calibrated.theta_b is not None


def test_what_has_no_such_friction_is_refused(arm: DynamicsModel, tmp_path: Path) -> None:
    bare = bundled_model("two_link_full")
    with pytest.raises(InputError, match="not calibrated"):
        emit_c(bare, tmp_path / "c", functions=["gravity"], friction=True)
    with pytest.raises(InputError, match="its friction has a state"):
        emit_c(with_friction(bare, law="lugre"), tmp_path / "c", functions=["gravity"], friction=True)
    with pytest.raises(InputError, match="freestanding"):
        emit_c(arm, tmp_path / "c", functions=["gravity"], friction=True, trig="freestanding")
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize(
    "law",
    [{"sign_speed": 0.0}, {"sign_speed": "fast"}, {"exponents": [1.0, "inf"]}, {"exponents": [1.0, 99.0]}],
)
def test_forged_numbers_are_refused(law: dict[str, object], tmp_path: Path) -> None:
    with pytest.raises((InputError, ValueError), match=r"damaged|expected a number|with number 99"):
        emit_c(
            with_friction(bundled_model("two_link_full"), **law),
            tmp_path / "c",
            functions=["gravity"],
            friction=True,
        )


def test_packages_without_it_say_nothing(tmp_path: Path) -> None:
    emit_c(bundled_model("scara"), tmp_path / "c", functions=["gravity"])
    assert not [
        path for path in (tmp_path / "c").rglob("*") if path.is_file() and "friction(" in path.read_text()
    ]


@pytest.mark.parametrize("exponents", [(0.5, 1.0), (1.0, 0.5), (0.5,), (0.5, 2.0)])
def test_viscous_terms_are_called_by_their_exponents_and_those_of_psdmc_0_1_are_read(
    exponents: tuple[float, ...], tmp_path: Path
):
    """Files of 0.1 call the first term viscous, whatever its exponent."""
    model = bundled_model("two_link_full")
    values = {d: 1.0 + d * np.arange(1.0, 3.0) for d in exponents}
    names = {"0.1": ["viscous", *(f"viscous^{d:g}" for d in exponents[1:])]}
    names["now"] = ["viscous" if d == 1.0 else f"viscous^{d:g}" for d in exponents]
    speed = np.linspace(-2.0, 2.0, 9)[:, None] * np.ones(2)
    size = sum(value * np.abs(speed) ** d for d, value in values.items())

    for version, called in names.items():
        columns = {"coulomb": COULOMB, **dict(zip(called, values.values(), strict=True)), "offset": OFFSET}
        rows = [
            {"joint": joint, "name": name, "value": float(column[k]), "unit": "Nms/rad"}
            for name, column in columns.items()
            for k, joint in enumerate(model.joint_names)
        ]
        law = {"law": "linear", "exponents": list(exponents), "sign_speed": SIGN_SPEED}
        kept = {"friction": rows, "prediction": law}
        old = replace(model, provenance={**model.provenance, "calibration": kept})
        save(old, tmp_path / f"{version}.npz")

        found = load(tmp_path / f"{version}.npz")

        expected = np.tanh(speed / SIGN_SPEED) * (COULOMB + size) + OFFSET
        assert np.allclose(linear_friction(found).torque(speed), expected, rtol=1e-14)
        assert found.calibrated is not None
        assert "calibration" not in found.provenance
        said = [row.name for row in found.calibrated.friction][2:-2:2]
        assert said == names["now"]
