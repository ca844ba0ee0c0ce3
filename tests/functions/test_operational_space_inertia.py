"""Operational-space inertias against Pinocchio, against a free body's own, and where there is none."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from against_pinocchio import ARM, EVERY, bench, matches_pinocchio
from direct import Direct, write_sources
from installed import in_wheel, need
from mimic_trees import as_urdf
from random_trees import TREES, RandomTree
from robots_at_hand import drawn, subject
from slow_cases import slow_but_for
from unoptimised import without_optimisation
from wide_robots import WideRobot, wide_robot

import psdmc
from psdmc.backends.c.package import package_view
from psdmc.backends.info import EmitOptions, package_info
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.functions import RECIPES
from psdmc.lower.kernels import lower
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import on_joints
from psdmc.robot.coordinates import Coordinate
from psdmc.robot.load import load_robot
from psdmc.robot.reference import OnCoordinates, reference

NAME = "operational_space_inertia"
EXACT = 1e-10
"""Of the largest entry; mu is 0.1 to 1."""


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    """In every layout: float64 within 1e-12, float32 within 2e-4 of the largest entry."""
    matches_pinocchio(NAME, robot, real)


def compiled(model: DynamicsModel) -> psdmc.CompiledRobot:
    with without_optimisation():
        return psdmc.compile(model, functions=[NAME])


def states(model: DynamicsModel, count: int = 20) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(8)
    q = on_joints(model.mechanism, rng.uniform(-np.pi, np.pi, (count, model.nq)))
    return q, rng.uniform(0.1, 1.0, count)


def assert_near(found: np.ndarray, expected: np.ndarray) -> None:
    assert np.array_equal(found, np.swapaxes(found, -1, -2))
    assert np.linalg.eigvalsh(found).min() > 0.0
    assert np.abs(found - expected).max() < EXACT * np.abs(expected).max()


@pytest.mark.parametrize("robot", ["kr6", "Panda"])
def test_arms_have_pinocchios(robot: str) -> None:
    own = subject(robot)
    q, mu = states(own.model)
    expected = RECIPES[NAME].pinocchio(own.pinocchio, {"q": q, "mu": mu})["Lambda"]
    assert_near(compiled(own.model).operational_space_inertia(q, mu), expected)
    assert_near(own.model.operational_space_inertia(q, mu), expected)


def test_feet_of_a_quadruped_have_pinocchios() -> None:
    """A free base moves every foot in six directions, so that mu may be zero."""
    robot = load_robot(in_wheel("hyq_no_sensors.urdf"), floating=True)
    model = derive_model(robot.mechanism, expand=False)
    q, mu = states(model)
    mu[::2] = 0.0
    expected = RECIPES[NAME].pinocchio(reference(robot), {"q": q, "mu": mu})["Lambda"]
    assert expected.shape == (20, 4, 6, 6)
    assert_near(compiled(model).operational_space_inertia(q, mu), expected)


@pytest.mark.parametrize("name", ["small", "pair", "hand", "two"])
def test_trees_with_joints_of_many_coordinates_have_pinocchios(name: str) -> None:
    own: WideRobot = wide_robot(name)
    q, mu = own.given["q"], own.given["mu"]
    expected = RECIPES[NAME].pinocchio(own.pinocchio, own.given)["Lambda"]
    assert_near(compiled(own.model).operational_space_inertia(q, mu), expected)


@pytest.mark.parametrize("seed", slow_but_for([2, 5], range(6)))
def test_random_chains_have_pinocchios(seed: int) -> None:
    own = drawn(seed, ("RRRRRRR", "PRRPRRR", "RRRRR")[seed % 3], tidy=seed % 2 == 1)
    q, mu = states(own.model)
    expected = RECIPES[NAME].pinocchio(own.pinocchio, {"q": q, "mu": mu})["Lambda"]
    assert_near(compiled(own.model).operational_space_inertia(q, mu), expected)


def test_joints_that_follow_others_count_with_their_leaders(tmp_path: Path) -> None:
    """Pinocchio's mass matrix and Jacobians of every joint, summed along what moves together."""
    path = tmp_path / "hand.urdf"
    coordinates = [Coordinate(0), Coordinate(1), Coordinate(1, -1.5, 0.2), Coordinate(3)]
    path.write_text(as_urdf(RandomTree(2, TREES["a wrist with two fingers"], "RRRP"), coordinates))
    robot = load_robot(path)
    model = derive_model(robot.mechanism, expand=False)
    q, mu = states(model)
    oracle = OnCoordinates.of(reference(robot), robot.mechanism)
    mass = oracle.mass_matrix(q)
    given = {"q": oracle.mimic_map.positions(q)}
    jacobians = oracle.mimic_map.summed(RECIPES["frame_jacobian"].pinocchio(oracle.free, given)["J"])
    seen = jacobians @ np.linalg.solve(mass[:, None], np.swapaxes(jacobians, -1, -2))
    assert_near(
        compiled(model).operational_space_inertia(q, mu),
        np.linalg.inv(seen + mu[:, None, None, None] * np.eye(6)),
    )


FREE_BODY = """<robot name="brick"><link name="brick"><inertial><origin xyz="0.1 0 0.2"/><mass value="2"/>
<inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""


def test_a_free_body_has_its_mass_and_inertia(tmp_path: Path) -> None:
    """[[m 1, -m [c]], [m [c], I - m [c]^2]] about its frame, c being the centre of mass, turned along the world's axes."""
    path = tmp_path / "brick.urdf"
    path.write_text(FREE_BODY)
    model = derive_model(load_robot(path, floating=True).mechanism, expand=False)
    x, y, z = 0.1, 0.0, 0.2
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    inertia = np.diag([0.02, 0.03, 0.04]) - 2.0 * cross @ cross
    own = np.block([[2.0 * np.eye(3), -2.0 * cross], [2.0 * cross, inertia]])
    half = np.sqrt(0.5)
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # a quarter turn about z
    whole = np.kron(np.eye(2), turned)
    found = compiled(model).operational_space_inertia([3.0, 1.0, 2.0, 0.0, 0.0, half, half], 0.0)
    np.testing.assert_allclose(found, [whole @ own @ whole.T], atol=1e-12)


STRAIGHT = np.array([0.3, -0.8, 0.9, 0.4, 0.0, 0.2])
"""KR6 with its axes 4 and 6 in line."""

BUILDS = [(compiler, real) for compiler in ("gcc", "clang") for real in ("float64", "float32")]
QUICK_BUILDS = [("gcc", "float64"), ("clang", "float32")]


@pytest.mark.parametrize(("compiler", "real"), slow_but_for(QUICK_BUILDS, BUILDS, spread=True))
def test_c_returns_a_status_and_nan_in_every_layout(compiler: str, real: str, tmp_path: Path) -> None:
    need(compiler)
    own = subject("kr6")
    model, dtype = own.model, np.dtype(real)
    package = package_view(package_info(model, "arm"), lower(model, functions=[NAME]), EmitOptions(real=real))  # type: ignore[arg-type]
    write_sources(package, tmp_path)
    library = tmp_path / "arm.so"
    sources = [str(tmp_path / source) for source in package.sources]
    words = [compiler, "-std=c99", "-O2", "-march=native", "-ffp-contract=fast", "-fPIC", "-shared"]
    subprocess.run(
        [*words, f"-I{tmp_path}/include", *sources, "-lm", "-o", str(library)],
        check=True,
        capture_output=True,
    )
    call, count = Direct(package, library), 3 * package.lanes + 1
    q, _ = states(model, count)
    q[:, 4] = 1.0
    expected = RECIPES[NAME].pinocchio(own.pinocchio, {"q": q, "mu": np.zeros(count)})["Lambda"]
    limit = (1e-10 if real == "float64" else 1e-2) * np.abs(expected).max(axis=(1, 2, 3))
    given, mu = np.ascontiguousarray(q, dtype), np.zeros(count, dtype)
    theta_b = np.asarray(model.theta_b, dtype)
    rows = np.zeros((count, 1, 6, 6), dtype)
    assert call(f"{NAME}_batch", count, given, mu, rows) == 0
    assert (np.abs(rows - expected).max(axis=(1, 2, 3)) < limit).all()

    failing = package.lanes + 2
    given[failing] = STRAIGHT
    one = np.zeros((6, 6), dtype)
    status = call(NAME, given[failing], mu, one)
    assert status == 1 + model.nv
    assert np.isnan(one).all()
    assert call(f"{NAME}_theta", given[failing], mu, theta_b, one) == status
    assert call(NAME, given[failing], np.array([0.1], dtype), one) == 0
    assert np.isfinite(one).all()
    assert call(NAME, given[0], np.array([-0.001], dtype), one) == 1 + model.nv
    assert call(NAME, given[0], np.array([np.nan], dtype), one) == 1 + model.nv
    assert 1 <= call(f"{NAME}_theta", given[0], mu, -theta_b, one) <= model.nv

    assert call(f"{NAME}_batch", count, given, mu, rows) == 1 + failing
    blocks = -(-count // package.lanes)
    padded = np.zeros((blocks * package.lanes, model.nv), dtype)
    padded[:count], padded[count:, 4] = given, 1.0
    laid = np.ascontiguousarray(padded.reshape(blocks, package.lanes, -1).transpose(0, 2, 1))
    lanes = np.zeros((blocks, 36, package.lanes), dtype)
    assert (
        call(f"{NAME}_batch_soa", count, laid, np.zeros((blocks, package.lanes), dtype), lanes) == 1 + failing
    )
    by_lane = lanes.transpose(0, 2, 1).reshape(-1, 1, 6, 6)[:count]
    for found in (rows, by_lane):
        assert np.isnan(found[failing]).all()
        assert (np.abs(found - expected).max(axis=(1, 2, 3)) < limit)[np.arange(count) != failing].all()


@pytest.mark.parametrize("kinds", ["RRRRR", "RPRP", "RRR"])
@pytest.mark.parametrize("real", ["float64", "float32"])
def test_too_few_joints_are_noticed_in_every_state(kinds: str, real: str) -> None:
    """Rounding gives such a matrix pivots of any sign."""
    own = drawn(12, kinds)
    with without_optimisation():
        robot = psdmc.compile(own.model, functions=[NAME], real=real)
    q, _ = states(own.model, 200)
    for one in q:
        with pytest.raises(InputError, match=r"frame 'tip': .* is not positive definite at mu = 0\n"):
            robot.operational_space_inertia(one, 0.0)
    assert np.isfinite(robot.operational_space_inertia(q, 0.1)).all()


@pytest.mark.parametrize("is_compiled", [True, False])
def test_python_names_frame_mu_and_state(is_compiled: bool) -> None:
    model = subject("kr6").model
    robot = compiled(model) if is_compiled else model
    call = robot.operational_space_inertia
    bent = np.where(np.arange(6) == 4, 1.0, STRAIGHT)
    text = f"{NAME}: frame 'link6': J M^-1 J^T + mu I is not positive definite at mu = "

    remedy = "give mu > 0, such as 1e-3, or a pose in which the frame can move in all six directions"

    def refusal(*given: object, hint: str = remedy, **named: object) -> str:
        with pytest.raises(InputError) as caught:
            call(*given, **named)
        assert caught.value.hint == hint
        return str(caught.value).splitlines()[0]

    assert refusal(STRAIGHT, 0.0) == f"{text}0"
    assert refusal(STRAIGHT, np.array(0.0)) == f"{text}0"
    assert refusal(bent, -0.5, hint="give 0 or more") == f"{NAME}: mu is -0.5"
    assert refusal([[bent], [STRAIGHT]], 0.0) == f"{text}0 in state 1, 0"
    assert refusal(np.array([bent, STRAIGHT]), np.zeros(2)) == f"{text}0 in state 1"
    assert refusal(STRAIGHT, 0.0, theta_b=1.01 * np.asarray(model.theta_b)) == f"{text}0"
    lost = np.full(6, np.nan)
    assert np.isnan(call(lost, 0.0)).all()
    assert np.isnan(call(bent, np.nan)).all()
    assert np.isnan(call(bent, 0.0, theta_b=-np.asarray(model.theta_b))).all()
    assert refusal([lost, bent, STRAIGHT], 0.0) == f"{text}0 in state 2"
    found = call([lost, bent], [0.0, 1e-3])
    assert np.isnan(found[0]).all()
    assert np.isfinite(found[1]).all()


def test_it_gives_the_kinetic_energy_of_the_frames_velocity() -> None:
    """Kinetic energy of the rates that give the frame a velocity and no inner motion: v^T Lambda v = qd^T M qd."""
    own = bench(ARM)
    q = own.given["q"]
    mu = np.full(len(q), 1e-9)
    jacobians, mass = own.robot.frame_jacobian(q)[:, 0], own.model.mass_matrix(q)
    rates = np.linalg.solve(mass, np.swapaxes(jacobians, -1, -2))
    found = own.robot.operational_space_inertia(q, mu)[:, 0]
    moved = jacobians @ rates
    energy = np.swapaxes(rates, -1, -2) @ mass @ rates
    np.testing.assert_allclose(moved @ found @ moved, energy, atol=1e-6 * np.abs(energy).max())
