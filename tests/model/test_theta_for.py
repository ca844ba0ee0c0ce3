"""theta_b of given bodies, in Python and in C: torques are those of Pinocchio's model with these bodies."""

from __future__ import annotations

import subprocess
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from bundled import bundled_model, bundled_robot, robot_path
from direct import Direct, shared_library, write_sources
from lowered import lowered
from mimic_trees import as_urdf
from random_trees import TREES, RandomTree
from slow_cases import slow_but_for
from urdf_text import BALL, joint, link, urdf

import psdmc
from psdmc.backends.c.package import PackageView, package_view
from psdmc.backends.info import EmitOptions, package_info
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import states_of
from psdmc.robot.coordinates import Coordinate
from psdmc.robot.load import LoadedRobot, load_robot_text
from psdmc.robot.reference import OnCoordinates, reference

Bodies = tuple[np.ndarray, np.ndarray, np.ndarray]

EXACT = 1e-12
"""Of each output's largest entry: both sides are recursions of sums in double precision."""
SINGLE = 2e-5
"""The same in single precision, whose rounding is 6e-8; theta_b's sums of bodies and lengths lose a digit or two."""

BEAST = urdf(
    *(link(name, BALL) for name in ("hull", "trunk", "leg", "foot", "boom")),
    joint("weld", "hull", "trunk", kind="fixed", rpy="0.4 -0.7 1.1"),
    joint("hip", "trunk", "leg", rpy="0.3 0.1 -0.2", axis="0.6 0 0.8"),
    joint("knee", "leg", "foot", rpy="0 0 0.7", axis="0 1 0"),
    joint("lift", "hull", "boom", kind="prismatic", rpy="0 0.4 0"),
    name="beast",
)
"""Its root link carries another by a fixed joint: on a floating base the two are one body."""


def mimicking() -> str:
    """A gripper: the second joint follows the first."""
    tree = RandomTree(4, TREES["a wrist with two fingers"], "RRRR")
    return as_urdf(tree, [Coordinate(0), Coordinate(0, -1.5, 0.2), Coordinate(2), Coordinate(3)])


@cache
def robot(name: str) -> LoadedRobot:
    if name == "kr6":
        return bundled_robot(name)
    text = mimicking() if name == "mimic" else BEAST
    return load_robot_text(text, "urdf", source_name="beast.urdf", floating=name == "floating")


@cache
def model(name: str) -> DynamicsModel:
    return derive_model(robot(name).mechanism)


ROBOTS = ["kr6", "tree", "floating", "mimic"]


def bodies(n: int, seed: int = 0) -> Bodies:
    """Physical ones: of eight points each."""
    random = np.random.default_rng(seed)
    points, shares = random.normal(scale=0.2, size=(n, 8, 3)), random.uniform(0.1, 1.0, size=(n, 8))
    masses = shares.sum(axis=1)
    coms = np.einsum("np,npi->ni", shares, points) / masses[:, None]
    away = points - coms[:, None]
    second = np.einsum("np,npi,npj->nij", shares, away, away)
    inertias = np.trace(second, axis1=1, axis2=2)[:, None, None] * np.eye(3) - second
    return masses, coms, inertias


def with_bodies(name: str, given: Bodies):
    """Pinocchio's own model of the file, with these bodies in the places of its links'."""
    oracle = reference(robot(name))
    theirs = oracle.model
    for k in range(len(theirs.inertias)):
        theirs.inertias[k] = pin.Inertia.Zero()
    for link_name, mass, com, inertia in zip(model(name).link_names, *given, strict=True):
        frame = theirs.frames[theirs.getFrameId(link_name, pin.BODY)]
        theirs.inertias[frame.parentJoint] = frame.placement.act(pin.Inertia(mass, com, inertia))
    mechanism = robot(name).mechanism
    return OnCoordinates.of(oracle, mechanism) if mechanism.has_mimic_joints else oracle


def assert_near(found: np.ndarray, expected: np.ndarray, limit: float = EXACT) -> None:
    np.testing.assert_allclose(found, expected, rtol=0, atol=limit * np.abs(expected).max())


@pytest.mark.parametrize("name", ROBOTS)
def test_torques_are_pinocchios_with_these_bodies(name: str) -> None:
    ours, given = model(name), bodies(model(name).n)
    oracle = with_bodies(name, given)
    q, qd, qdd = states_of(ours.mechanism, np.random.default_rng(1), 20)

    theta = ours.theta_for(*given)

    assert theta.shape == (ours.l,)
    assert_near(ours.inverse_dynamics(q, qd, qdd, theta_b=theta), oracle.inverse_dynamics(q, qd, qdd))
    assert_near(ours.mass_matrix(q, theta_b=theta), oracle.mass_matrix(q))
    assert_near(ours.nonlinear_effects(q, qd, theta_b=theta), oracle.nonlinear_effects(q, qd))
    assert_near(ours.gravity(q, theta_b=theta), oracle.gravity(q))


def package(name: str, real: str = "float64") -> PackageView:
    kernels = lowered(model(name), "factored", ["inverse_dynamics"])
    info = package_info(model(name), "arm", bodies=True)
    return package_view(info, kernels, EmitOptions(real=real))  # type: ignore[arg-type]


def in_c(given: Bodies, real: str = "float64") -> list[np.ndarray]:
    """Inertias as Ixx Ixy Iyy Ixz Iyz Izz."""
    masses, coms, inertias = given
    six = inertias[:, [0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
    return [np.ascontiguousarray(values, real) for values in (masses, coms, six)]


QUICK = [("kr6", "float64"), ("floating", "float64"), ("kr6", "float32")]
CASES = [(name, real) for name in ROBOTS for real in ("float64", "float32")]


@pytest.mark.parametrize(("name", "real"), slow_but_for(QUICK, CASES, spread=True))
def test_c_gives_pinocchios_torques_and_pythons_theta(name: str, real: str, tmp_path: Path) -> None:
    ours, given = model(name), bodies(model(name).n)
    flags = ["-O0", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-compare", "-Werror"]
    library = Direct(package(name, real), shared_library(package(name, real), tmp_path, flags))
    theta = np.full(ours.l, np.nan, real)
    limit = EXACT if real == "float64" else SINGLE

    library("theta_from_bodies", *in_c(given, real), theta)

    assert_near(theta, ours.theta_for(*given), limit)
    states = [np.ascontiguousarray(s, real) for s in states_of(ours.mechanism, np.random.default_rng(1), 20)]
    found = np.empty((20, ours.nv), real)
    library("inverse_dynamics_theta_batch", 20, *states, theta, found)
    assert_near(found, with_bodies(name, given).inverse_dynamics(*map(np.float64, states)), limit)


@pytest.mark.parametrize("real", ["float64", "float32"])
def test_the_packages_own_test_compares_it(real: str, tmp_path: Path) -> None:
    psdmc.emit_c(model("tree"), tmp_path, functions="gravity", name="beast", bodies=True, real=real)  # type: ignore[arg-type]
    words = [
        "gcc",
        "-O0",
        "-w",
        "-Iinclude",
        "test/self_test.c",
        *(f"src/{path.name}" for path in tmp_path.glob("src/*.c")),
    ]

    def ran() -> subprocess.CompletedProcess[str]:
        subprocess.run([*words, "-lm", "-o", "self_test"], cwd=tmp_path, check=True)
        return subprocess.run(["./self_test"], cwd=tmp_path, capture_output=True, text=True, check=False)

    assert ran().returncode == 0
    source = tmp_path / "src/bodies.c"
    source.write_text(source.read_text().replace("mass * (y * y + z * z)", "mass * (y * y - z * z)"))
    broken = ran()
    assert broken.returncode == 1
    assert "theta_from_bodies" in broken.stdout


MAIN = """
#include <cstdio>
#include "arm/arm.hpp"
int main()
{
    using Arm = arm::Description;
    std::array<Arm::Real, Arm::bodies> masses{};
    std::array<std::array<Arm::Real, 3>, Arm::bodies> coms{};
    std::array<std::array<Arm::Real, 6>, Arm::bodies> inertias{};
    masses[5] = 2.0;
    coms[5] = {0.1, 0.2, 0.3};
    inertias[5] = {0.01, 0.001, 0.02, 0.002, 0.003, 0.025};
    for (double value : Arm::theta_from_bodies(masses, coms, inertias)) std::printf("%.17g ", value);
}
"""


@pytest.mark.needs("g++")
def test_the_class_does_so_too(tmp_path: Path) -> None:
    write_sources(package("kr6"), tmp_path)
    (tmp_path / "main.cpp").write_text(MAIN)
    subprocess.run(["gcc", "-c", "-std=c99", "-Iinclude", "src/bodies.c"], cwd=tmp_path, check=True)
    words = ["-std=c++17", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-Iinclude", "main.cpp", "bodies.o"]
    subprocess.run(["g++", *words, "-o", "main"], cwd=tmp_path, check=True)
    done = subprocess.run(["./main"], cwd=tmp_path, check=True, capture_output=True, text=True)
    masses, coms, inertias = np.zeros(6), np.zeros((6, 3)), np.zeros((6, 3, 3))
    masses[5], coms[5] = 2.0, [0.1, 0.2, 0.3]
    inertias[5] = [[0.01, 0.001, 0.002], [0.001, 0.02, 0.003], [0.002, 0.003, 0.025]]
    assert_near(np.array(done.stdout.split(), float), bundled_model("kr6").theta_for(masses, coms, inertias))


def test_the_header_says_units_order_and_links(tmp_path: Path) -> None:
    files = psdmc.emit_c(model("floating"), tmp_path, functions="gravity", name="beast", bodies=True)
    assert "src/bodies.c" in files
    header = (tmp_path / "include/beast/beast.h").read_text()
    assert "#define beast_BODIES 4\n" in header
    assert "inertias  [BODIES][6]  kg m^2, Ixx Ixy Iyy Ixz Iyz Izz about that centre" in header
    assert "     0  hull\n     1  boom\n     2  leg\n     3  foot\n" in header
    assert "check_theta_from_bodies();" in (tmp_path / "test/self_test.c").read_text()
    psdmc.emit_c(model("floating"), tmp_path, functions="gravity", name="beast")
    assert not (tmp_path / "src/bodies.c").exists()
    assert "BODIES" not in (tmp_path / "include/beast/beast.h").read_text()


def test_drive_inertias_are_the_models_or_given() -> None:
    own = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    driven, given = psdmc.derive(robot_path("kr6"), drive_inertia=own), bodies(6)
    q = np.random.default_rng(2).normal(size=(5, 6))
    still = bundled_model("kr6").mass_matrix(q, theta_b=bundled_model("kr6").theta_for(*given))
    found = driven.mass_matrix(q, theta_b=driven.theta_for(*given))
    assert_near(found, still + np.diag(own))
    found = driven.mass_matrix(q, theta_b=driven.theta_for(*given, drive_inertias=[1, 0, 0, 0, 0, 2]))
    assert_near(found, still + np.diag([1.0, 0, 0, 0, 0, 2.0]))
    with pytest.raises(InputError, match="these bodies: link1:Im is not zero, but the model was") as caught:
        bundled_model("kr6").theta_for(*given, drive_inertias=[1, 0, 0, 0, 0, 0])
    assert "(Im) by --drive-inertia all" in caught.value.hint


def test_data_frames_are_matched_by_links() -> None:
    pd = pytest.importorskip("pandas")
    arm, (masses, coms, inertias) = bundled_model("kr6"), bodies(6)
    names = list(arm.link_names)
    table = pd.DataFrame(coms, index=names, columns=["x", "y", "z"]).iloc[::-1][["z", "x", "y"]]
    found = arm.theta_for(pd.Series(masses, index=names)[names[::-1]], table, inertias)
    np.testing.assert_array_equal(found, arm.theta_for(masses, coms, inertias))


def changed(which: int, value: object, *place: int) -> Bodies:
    found = [np.array(values) for values in bodies(6)]
    found[which][place] = value
    return tuple(found)  # type: ignore[return-value]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ((np.ones(5), *bodies(6)[1:]), r"masses has shape \(5,\), expected \(6,\)"),
        ((bodies(6)[0], np.ones((3, 6)), bodies(6)[2]), r"coms has shape \(3, 6\), expected \(6, 3\)"),
        ((*bodies(6)[:2], np.ones((6, 6))), r"inertias has shape \(6, 6\), expected \(6, 3, 3\)"),
        (changed(0, -1.0, 2), "masses: that of link 'link3' is -1, expected no less than zero"),
        (changed(1, np.nan, 0, 2), "coms: nan of 'link1' is not finite"),
        (changed(1, 1e6, 0, 2), r"coms: 1e\+06 of 'link1' is out of range"),
        (changed(2, 0.5, 1, 0, 2), "inertias: that of link 'link2' is not symmetric"),
        ((["a"] * 6, *bodies(6)[1:]), "masses has dtype"),
    ],
)
def test_what_are_no_bodies_is_refused_by_link(given: Bodies, message: str) -> None:
    with pytest.raises(InputError, match=message):
        bundled_model("kr6").theta_for(*given)


def test_an_inertia_of_no_rigid_body_is_taken_with_a_warning() -> None:
    """As robot files are: published sets have such, and torques are defined."""
    given = changed(2, np.diag([0.1, 0.1, 0.5]), 3)
    with pytest.warns(UserWarning, match="link 'link4': principal moments break the triangle inequality"):
        theta = bundled_model("kr6").theta_for(*given)
    q, qd, qdd = np.random.default_rng(1).normal(size=(3, 6))
    found = bundled_model("kr6").inverse_dynamics(q, qd, qdd, theta_b=theta)
    assert_near(found, with_bodies("kr6", given).inverse_dynamics(q, qd, qdd))


def test_what_the_model_assumes_zero_is_refused_by_name(tmp_path: Path) -> None:
    planar = bundled_model("two_link")
    with pytest.raises(
        InputError, match=r"^these bodies: link1:.* are not zero, but .* with them assumed zero\n"
    ):
        planar.theta_for(*bodies(2))
    with pytest.raises(
        InputError,
        match=r"two_link: theta_from_bodies takes bodies whose link1:.* are not zero, but the model",
    ):
        psdmc.emit_c(planar, tmp_path / "refused", functions="gravity", bodies=True)
    assert not (tmp_path / "refused").exists()


def test_the_old_name_of_equivalent_parameters_works_and_says_so() -> None:
    arm = bundled_model("kr6")
    with pytest.warns(
        DeprecationWarning, match=r"standard_parameters\(\) has been renamed equivalent_parameters\(\)"
    ):
        found = arm.standard_parameters()
    np.testing.assert_array_equal(found, arm.equivalent_parameters())
