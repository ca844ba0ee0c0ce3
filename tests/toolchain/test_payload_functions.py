"""emit-c --payload: loads added to theta_b in C and C++, against with_payload and against Pinocchio with such a body."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from bundled import bundled_model, bundled_robot, robot_path
from direct import Direct, shared_library, write_sources

from psdmc.backends.c.package import PackageView, package_view
from psdmc.backends.info import EmitOptions, package_info
from psdmc.compiler import derive, emit_c
from psdmc.errors import InputError
from psdmc.lower.kernels import lower
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.reference import reference

MASS, COM, INERTIA = 2.5, np.array([0.02, -0.03, 0.11]), np.array([0.02, 0.001, 0.03, -0.002, 0.003, 0.025])
MATRIX = INERTIA[[[0, 1, 3], [1, 2, 4], [3, 4, 5]]]


def package(model: DynamicsModel, real: str = "float64") -> PackageView:
    kernels = lower(model, "factored", ["inverse_dynamics"])
    return package_view(package_info(model, "arm", payload=True), kernels, EmitOptions(real=real))  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def kr6() -> DynamicsModel:
    return derive(robot_path("kr6"), frames=["link3", "link6"], tool=(0.0, 0.1, 0.2, 0.3, -0.4, 0.5))


@pytest.mark.parametrize("real", ["float64", "float32"])
def test_c_adds_what_python_adds(kr6: DynamicsModel, real: str, tmp_path: Path) -> None:
    library = Direct(package(kr6, real), shared_library(package(kr6, real), tmp_path, ["-O0"]))
    load = [np.asarray(values, real) for values in (COM, INERTIA)]
    limit = 1e-14 if real == "float64" else 1e-6
    for frame, name in ((None, None), (0, "link3"), (1, "link6"), (2, "tool")):
        theta = np.array(kr6.theta_b, real)
        if frame is None:
            library("add_payload", MASS, *load, theta)
        else:
            assert library("add_payload_at", frame, MASS, *load, theta) == 0
        expected = kr6.with_payload(MASS, COM, MATRIX, frame=name).theta_b
        np.testing.assert_allclose(theta, expected, atol=limit * np.abs(expected).max())
    theta = np.array(kr6.theta_b, real)
    assert library("add_payload_at", 3, MASS, *load, theta) == 1
    np.testing.assert_array_equal(theta, np.array(kr6.theta_b, real))


def test_torques_are_pinocchios_with_the_body_and_taking_it_off_leaves_none(tmp_path: Path) -> None:
    model, robot = bundled_model("kr6"), reference(bundled_robot("kr6"))
    library = Direct(package(model), shared_library(package(model), tmp_path, ["-O0"]))
    theta = np.array(model.theta_b)
    library("add_payload", MASS, COM, INERTIA, theta)
    tip = robot.model.frames[robot.model.getFrameId(robot.tip_name)]
    robot.model.appendBodyToJoint(tip.parentJoint, pin.Inertia(MASS, COM, MATRIX), tip.placement)
    q, qd, qdd = np.random.default_rng(0).normal(size=(3, 50, 6))
    found = np.empty((50, 6))
    library("inverse_dynamics_theta_batch", 50, q, qd, qdd, theta, found)
    expected = robot.inverse_dynamics(q, qd, qdd)
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())
    library("add_payload", -MASS, COM, -INERTIA, theta)
    np.testing.assert_allclose(theta, model.theta_b, atol=1e-14 * np.abs(theta).max())


def test_without_an_inertia_it_is_a_point(tmp_path: Path) -> None:
    model = bundled_model("kr6")
    library = Direct(package(model), shared_library(package(model), tmp_path, ["-O0"]))
    theta = np.array(model.theta_b)
    library("add_payload", MASS, COM, library.ffi.NULL, theta)
    expected = model.with_payload(MASS, COM).theta_b
    np.testing.assert_allclose(theta, expected, atol=1e-14 * np.abs(expected).max())


MAIN = """
#include <cstdio>
#include "arm/arm.hpp"
int main()
{
    arm::Description::Parameters theta = arm::Description::theta_b;
    arm::Description::add_payload(2.5, {0.02, -0.03, 0.11}, {0.02, 0.001, 0.03, -0.002, 0.003, 0.025}, theta);
    const int status = arm::Description::add_payload_at(9, 1.0, {}, {}, theta);
    for (double value : theta) std::printf("%.17g ", value);
    return status == 1 ? 0 : 1;
}
"""


@pytest.mark.needs("g++")
def test_the_class_does_so_too(kr6: DynamicsModel, tmp_path: Path) -> None:
    shown = package(kr6)
    write_sources(shown, tmp_path)
    (tmp_path / "main.cpp").write_text(MAIN)
    subprocess.run(
        ["gcc", "-c", "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-Iinclude", "src/payload.c"],
        cwd=tmp_path, check=True,
    )  # fmt: skip
    words = ["-std=c++17", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-Iinclude", "main.cpp", "payload.o"]
    subprocess.run(["g++", *words, "-o", "main"], cwd=tmp_path, check=True)
    found = subprocess.run(
        ["./main"], cwd=tmp_path, check=True, capture_output=True, text=True
    ).stdout.split()
    expected = kr6.with_payload(MASS, COM, MATRIX).theta_b
    np.testing.assert_allclose([float(word) for word in found], expected, rtol=1e-12, atol=1e-15)


def test_a_model_that_admits_no_load_is_refused_and_a_package_without_says_nothing(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="link 'link2' cannot carry this load"):
        emit_c(bundled_model("two_link"), tmp_path / "refused", functions=["gravity"], payload=True)
    assert not (tmp_path / "refused").exists()
    emit_c(bundled_model("scara"), tmp_path / "plain", functions=["gravity"])
    assert "payload" not in (tmp_path / "plain" / "include" / "scara" / "scara.h").read_text()
    assert not (tmp_path / "plain" / "src" / "payload.c").exists()
