"""emit-c --estimator: momenta against Pinocchio's, estimates against batch least squares and against the true load."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from bundled import bundled_model, bundled_robot, robot_path
from estimator_library import Array, EstimatorLibrary
from scipy.signal import lfilter
from urdf_text import LIMIT, inertial, joint, link, urdf

from psdmc.backends.info import package_info
from psdmc.compiler import compare_emitted, derive, emit, emit_c
from psdmc.dynamics.parameters import standard_parameters
from psdmc.errors import InputError
from psdmc.lower.kernels import lower_estimator
from psdmc.program.interpret import interpret
from psdmc.recipes.load_momentum import LOADS, load_recipe
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.robot.load import load_robot
from psdmc.robot.reference import Reference, reference

MASS, COM = 1.7, np.array([0.04, -0.03, 0.11])
INERTIA = np.array([[0.012, 0.001, -0.002], [0.001, 0.011, 0.0005], [-0.002, 0.0005, 0.006]])
PARAMETERS = standard_parameters(
    MASS, MASS * COM, INERTIA + MASS * (COM @ COM * np.eye(3) - np.outer(COM, COM))
)
OFFSET = np.array([0.4, -0.7, 0.2, 0.1, -0.3, 0.5])
DT, CUTOFF = 1e-3, 20.0

FOLLOWS = '<mimic joint="a" multiplier="-0.5" offset="0.2"/>'
BODY = inertial(2, "0.1 0.05 -0.02", "0 0 0", "0.02 0.03 0.025 0.001 -0.002 0.003")
MIMIC = urdf(
    link("base", ""),
    *(link(name, BODY) for name in ("one", "two", "tip")),
    joint("a", "base", "one", xyz="0 0 0", axis="0 1 0"),
    joint("b", "one", "two", kind="prismatic", xyz="0.3 0 0.1", axis="1 0 0"),
    joint("c", "two", "tip", xyz="0.1 0.2 0", rpy="0.3 0.2 0.1", extra=LIMIT + FOLLOWS),
    name="gripper",
)
FOLLOWING = np.array([[1.0, 0.0], [0.0, 1.0], [-0.5, 0.0]])


def loaded(robot: Reference) -> Reference:
    """Pinocchio's robot with the load at its tip."""
    model = robot.model.copy()
    tip = model.frames[model.getFrameId(robot.tip_name)]
    model.appendBodyToJoint(tip.parentJoint, pin.Inertia(MASS, COM, INERTIA), tip.placement)
    return replace(robot, model=model)


def terms(robot: Reference, q: Array, qd: Array) -> tuple[Array, Array]:
    """M qd and C^T qd - g; of the gripper, all of whose joints Pinocchio knows, on its own coordinates."""
    joints = np.eye(q.shape[1]) if robot.model.nv == q.shape[1] else FOLLOWING
    start = np.zeros(len(joints)) if len(joints) == q.shape[1] else np.array([0.0, 0.0, 0.2])
    q, qd = q @ joints.T + start, qd @ joints.T
    p = np.einsum("kij,kj->ki", robot.mass_matrix(q), qd)
    rate = np.einsum("kji,kj->ki", robot.coriolis_matrix(q, qd), qd) - robot.gravity(q)
    return p @ joints, rate @ joints


@pytest.fixture(scope="module")
def gripper(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("mimic") / "gripper.urdf"
    path.write_text(MIMIC)
    return path


@pytest.mark.parametrize("name", ["scara", "kr6", "gripper"])
def test_momenta_of_robot_and_load_are_pinocchios(name: str, gripper: Path) -> None:
    path = gripper if name == "gripper" else robot_path(name)
    model, robot = derive(path), reference(load_robot(path))
    q, qd = np.random.default_rng(0).normal(size=(2, 20, model.nv))
    kernel, recipe = lower_estimator(model, "inertia"), load_recipe("inertia")
    sizes = kernel.function.sizes(package_info(model).sizes)
    found = interpret(kernel.single, {"q": q, "qd": qd}, sizes)

    p, rate = terms(robot, q, qd)
    with_load = terms(loaded(robot), q, qd)
    by_load = (found[key].reshape(20, 10, model.nv) for key in ("p_load", "p_rate_load"))
    p_load, rate_load = (np.einsum("kpi,p->ki", each, PARAMETERS) for each in by_load)

    for value, expected in (
        (found["p"], p),
        (found["p_rate"], rate),
        (p_load, with_load[0] - p),
        (rate_load, with_load[1] - rate),
    ):
        np.testing.assert_allclose(value, expected, atol=1e-11 * np.abs(expected).max())
    on_arrays = recipe.reference(RobotOnArrays.of(model, model.theta_b), {"q": q, "qd": qd})
    for key, value in on_arrays.items():
        np.testing.assert_allclose(found[key], value.reshape(20, -1), atol=1e-11 * np.abs(value).max())
    if name != "gripper":
        np.testing.assert_allclose(recipe.pinocchio(robot, {"q": q, "qd": qd})["p_rate"], rate, atol=1e-11)


class Motion:
    """A motion of the KR6 with the load: measured states and mean torques of each step, by Pinocchio."""

    def __init__(self, steps: int, seed: int = 1) -> None:
        draw = np.random.default_rng(seed)
        size, rate = draw.uniform(0.1, 0.4, (3, 6)), draw.uniform(1.0, 5.0, (3, 6))
        start = draw.uniform(0.0, 6.0, (3, 6))
        self.robot = reference(bundled_robot("kr6"))
        self.q, self.qd, _ = self._at(size, rate, start, np.arange(steps) * DT)
        middle = self._at(size, rate, start, (np.arange(steps) - 0.5) * DT)
        self.tau = loaded(self.robot).inverse_dynamics(*middle) + OFFSET

    @staticmethod
    def _at(size: Array, rate: Array, start: Array, times: Array) -> tuple[Array, Array, Array]:
        angle = rate * times[:, None, None] + start
        return (
            (size * np.sin(angle)).sum(1),
            (size * rate * np.cos(angle)).sum(1),
            (-size * rate**2 * np.sin(angle)).sum(1),
        )

    def run(self, library: EstimatorLibrary, state: Any, noise: Array | float = 0.0) -> None:
        for q, qd, tau in zip(self.q, self.qd, self.tau + noise, strict=True):
            assert library.step(state, q, qd, tau, DT) == 0


@pytest.fixture(scope="module")
def motion() -> Motion:
    return Motion(3001)


@pytest.fixture(scope="module")
def mass(tmp_path_factory: pytest.TempPathFactory) -> EstimatorLibrary:
    return EstimatorLibrary(bundled_model("kr6"), "mass", tmp_path_factory.mktemp("mass") / "arm")


@pytest.fixture(scope="module")
def inertia(tmp_path_factory: pytest.TempPathFactory) -> EstimatorLibrary:
    return EstimatorLibrary(bundled_model("kr6"), "inertia", tmp_path_factory.mktemp("inertia") / "arm")


def test_without_forgetting_it_is_batch_least_squares(inertia: EstimatorLibrary, motion: Motion) -> None:
    """Filtered by SciPy from Pinocchio's momenta, and solved by NumPy with the prior as further rows."""
    noise = np.random.default_rng(2).normal(size=motion.tau.shape)
    tau_sd, prior = np.full(6, 1.0), np.array([10.0, *[5.0] * 3, *[2.5] * 6, *[2.0] * 6])
    state = inertia.began(tau_sd, memory=1e6, offset_sd=[2.0] * 6)
    motion.run(inertia, state, noise)

    step = CUTOFF * DT
    filtered = lambda u: lfilter([step / (1 + step)], [1, -1 / (1 + step)], u, axis=0)  # noqa: E731
    q, qd = motion.q, motion.qd
    found = load_recipe("inertia").reference(
        RobotOnArrays.of(bundled_model("kr6"), bundled_model("kr6").theta_b), {"q": q, "qd": qd}
    )

    def change(p: Array, rate: Array) -> Array:
        return np.diff(p, axis=0) / DT - (rate[1:] + rate[:-1]) / 2

    columns = filtered(change(found["p_load"].transpose(0, 2, 1), found["p_rate_load"].transpose(0, 2, 1)))
    ones = filtered(np.ones((len(q) - 1, 1, 1))) * np.eye(6)
    y = filtered((motion.tau + noise)[1:] - change(*terms(motion.robot, q, qd)))
    A = np.concatenate([columns, ones], axis=2).reshape(-1, 16)
    information = A.T @ A + np.diag(prior**-2)
    expected, covariance = np.linalg.solve(information, A.T @ y.ravel()), np.linalg.inv(information)

    value, sd = np.array(list(state.value))[:16], np.sqrt(covariance.diagonal())
    np.testing.assert_allclose(value, expected, atol=1e-4 * sd.min())
    variance = [state.covariance[k][k] for k in range(16)]
    np.testing.assert_allclose(np.sqrt(variance), sd, rtol=1e-4)


def test_it_finds_the_true_load_and_offsets(inertia: EstimatorLibrary, motion: Motion) -> None:
    state = inertia.began(np.full(6, 0.01), offset_sd=[2.0] * 6)
    motion.run(inertia, state)
    load = inertia.load(state)
    assert abs(load["mass"] - MASS) < 1e-3
    np.testing.assert_allclose(load["com"], COM, atol=1e-3)
    np.testing.assert_allclose(load["inertia"], INERTIA[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]], atol=2e-3)
    np.testing.assert_allclose(load["offset"], OFFSET, atol=2e-2)


def test_errors_are_within_their_standard_deviations(inertia: EstimatorLibrary, motion: Motion) -> None:
    """Of 20 noises in tau, q and qd: 99 % within three standard deviations, and these are no bound far away."""
    ratios = []
    for seed in range(20):
        draw = np.random.default_rng(seed)
        state = inertia.began(np.full(6, 0.5), offset_sd=[2.0] * 6)
        noisy = Motion.__new__(Motion)
        noisy.q, noisy.qd = motion.q + 1e-5 * draw.normal(size=motion.q.shape), motion.qd
        noisy.qd = motion.qd + 1e-3 * draw.normal(size=motion.q.shape)
        noisy.tau = motion.tau
        noisy.run(inertia, state, 0.5 * draw.normal(size=motion.tau.shape))
        load = inertia.load(state)
        true = {"mass": MASS, "com": COM, "offset": OFFSET}
        ratios.append(np.hstack([(load[key] - true[key]) / load[f"{key}_sd"] for key in true]))
    ratios = np.abs(np.array(ratios))
    assert (ratios < 3.0).mean() >= 0.99
    assert np.sqrt((ratios**2).mean()) > 0.3


def test_a_load_picked_up_at_rest_and_put_down_is_seen(mass: EstimatorLibrary) -> None:
    """At rest a minute long, of the directions that torques tell nothing no information is lost or made up."""
    robot = reference(bundled_robot("kr6"))
    q, rest = np.array([[0.1, -0.9, 1.2, 0.3, 0.6, 0.2]]), np.zeros(6)
    empty, full = robot.gravity(q)[0], loaded(robot).gravity(q)[0]
    state = mass.began(np.full(6, 0.5), offset_sd=[0.3] * 6)
    draw = np.random.default_rng(3)
    for tau, steps in ((empty, 30_000), (full, 2000)):
        for noise in 0.5 * draw.normal(size=(steps, 6)):
            mass.step(state, q[0], rest, tau + noise, DT)
        load = mass.load(state)
        true = MASS if tau is full else 0.0
        assert abs(load["mass"] - true) < 3 * load["mass_sd"]
        assert all(state.covariance[k][k] <= 1.0001 * (10.0, 5.0, 5.0, 5.0)[k] ** 2 for k in range(4))
    assert load["mass"] > 3 * load["mass_sd"]


def test_no_variance_grows_beyond_its_prior(mass: EstimatorLibrary, motion: Motion) -> None:
    """What is forgotten in 0.05 s would leave more than is known before the first step."""
    prior = np.array([0.02, 0.002, 0.002, 0.002])
    state = mass.began(np.full(6, 5.0), memory=0.05, load_sd=prior.tolist())
    for q, qd, tau in zip(motion.q, motion.qd, motion.tau, strict=True):
        mass.step(state, q, qd, tau, DT)
        assert all(state.covariance[k][k] <= 1.000001 * prior[k] ** 2 for k in range(4))


def test_what_the_model_lacks_widens_the_standard_deviations(mass: EstimatorLibrary, motion: Motion) -> None:
    """An estimator without inertias, told of torques far more exact than it explains."""
    state = mass.began(np.full(6, 0.05), offset_sd=[2.0] * 6)
    motion.run(mass, state)
    load = mass.load(state)
    assert state.misfit > 5.0
    assert abs(load["mass"] - MASS) < 3 * load["mass_sd"]


def test_the_reported_load_is_one_that_a_body_can_have(inertia: EstimatorLibrary) -> None:
    state = inertia.began(np.full(6, 1.0), largest_mass=2.0, reach=0.1)
    inertia.step(state, *np.zeros((3, 6)), DT)
    draw = np.random.default_rng(4)
    for _ in range(200):
        values = draw.normal(size=10) * [3.0, *[0.3] * 3, *[0.05] * 6]
        for k, value in enumerate(values):
            state.value[k] = value
            state.covariance[k][k] = 1e-6
        load = inertia.load(state)
        assert 0.0 <= load["mass"] <= 2.0
        assert np.abs(load["com"]).max() <= 0.1
        xx, xy, yy, xz, yz, zz = load["inertia"]
        moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        assert moments[0] > -1e-12
        assert moments[2] <= (moments[0] + moments[1]) * (1 + 1e-9) + 1e-12


@pytest.mark.parametrize("kind", LOADS)
def test_float_estimates_what_double_does(kind: str, motion: Motion, tmp_path: Path) -> None:
    found = []
    noise = 0.5 * np.random.default_rng(5).normal(size=motion.tau.shape)
    for real in ("float64", "float32"):
        library = EstimatorLibrary(bundled_model("kr6"), kind, tmp_path / real, real)
        state = library.began(np.full(6, 0.5))
        motion.run(library, state, noise)
        found.append(library.load(state))
    double, single = found
    assert abs(double["mass"] - single["mass"]) < 0.5 * double["mass_sd"]
    np.testing.assert_allclose(single["com_sd"], double["com_sd"], rtol=0.2)


def test_bad_input_changes_nothing(mass: EstimatorLibrary, motion: Motion) -> None:
    state = mass.began(np.full(6, 0.5))
    for k in range(50):
        mass.step(state, motion.q[k], motion.qd[k], motion.tau[k], DT)
    before, good = mass.bytes(state), [motion.q[50], motion.qd[50], motion.tau[50]]
    for dt in (0.0, -DT, np.nan, np.inf, 1e7):
        assert mass.step(state, *good, dt) == 1
    for place in range(3):
        for wrong in (np.nan, np.inf, -np.inf, 1e9):
            given = [each.copy() for each in good]
            given[place][3] = wrong
            assert mass.step(state, *given, DT) == 1
    assert mass.bytes(state) == before
    for name in ("cutoff", "memory"):
        kept = getattr(state, name)
        for wrong in (0.0, -1.0, np.nan, np.inf):
            setattr(state, name, wrong)
            assert mass.step(state, *good, DT) == 2
        setattr(state, name, kept)
    assert mass.bytes(state) == before
    assert mass.step(state, *good, DT) == 0


def test_after_a_pause_the_filters_begin_anew(mass: EstimatorLibrary, motion: Motion) -> None:
    state = mass.began(np.full(6, 0.5))
    for k in range(50):
        mass.step(state, motion.q[k], motion.qd[k], motion.tau[k], DT)
    value = list(state.value)
    assert mass.step(state, motion.q[500], motion.qd[500], motion.tau[500], 0.45) == 0
    assert list(state.value) == value
    assert state.weight == 0.0


def test_the_option_is_recorded_and_packages_without_it_stay(tmp_path: Path) -> None:
    model = bundled_model("scara")
    emit_c(model, tmp_path / "with", functions=["gravity"], estimator="mass", trig="freestanding")
    emit_c(model, tmp_path / "without", functions=["gravity"])
    assert not compare_emitted(model, tmp_path / "with", {"estimator": "mass"})
    with pytest.raises(InputError, match="--estimator contradicts"):
        compare_emitted(model, tmp_path / "with", {"estimator": "inertia"})
    header = (tmp_path / "without" / "include" / "scara" / "scara.h").read_text()
    assert "estimat" not in header
    assert not (tmp_path / "without" / "src" / "estimator.c").exists()
    sources = [str(path) for path in sorted((tmp_path / "with" / "src").glob("*.c"))]
    words = [
        "gcc",
        "-O1",
        "-fno-math-errno",
        "-shared",
        "-fPIC",
        f"-I{tmp_path / 'with' / 'include'}",
        *sources,
    ]
    subprocess.run([*words, "-o", str(tmp_path / "with.so")], check=True)
    undefined = subprocess.run(
        ["nm", "-uD", tmp_path / "with.so"], capture_output=True, text=True, check=True
    )
    assert not [
        line
        for line in undefined.stdout.splitlines()
        if "GLIBC" in line and " mem" not in line and " w " not in line
    ]


def test_what_cannot_have_one_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "arm"
    with pytest.raises(InputError, match="estimator 'all' is not known"):
        emit_c(bundled_model("scara"), path, functions=["gravity"], estimator="all")
    with pytest.raises(InputError, match="back end rust has no --estimator"):
        emit(bundled_model("scara"), path, "rust", functions=["gravity"], estimator="mass")
    unknown = derive(robot_path("rounded_arm"), unknown="all")
    with pytest.raises(InputError, match="base parameters are unknown"):
        emit_c(unknown, path, functions=["gravity"], estimator="mass")
    floating = derive(robot_path("rounded_arm"), floating=True)
    with pytest.raises(InputError, match="a joint of the robot has several coordinates"):
        emit_c(floating, path, functions=["gravity"], estimator="mass")
    assert not path.exists()


@pytest.mark.needs("g++")
def test_cpp_and_other_compilers_take_the_header(mass: EstimatorLibrary, tmp_path: Path) -> None:
    emit_c(bundled_model("kr6"), tmp_path / "arm", functions=["gravity"], name="arm", estimator="inertia")
    main = '#include "arm/arm.h"\nint main() { static arm_estimator state; return state.started; }\n'
    (tmp_path / "main.cpp").write_text(main)
    include = f"-I{tmp_path / 'arm' / 'include'}"
    strict = ["-Wall", "-Wextra", "-Wpedantic", "-Werror", include]
    subprocess.run(
        ["g++", "-std=c++17", *strict, "-c", tmp_path / "main.cpp", "-o", tmp_path / "main.o"], check=True
    )
    vectorless = ["gcc", "-std=c99", "-Darm_NO_VECTORS", *strict]
    subprocess.run(
        [*vectorless, "-c", tmp_path / "arm" / "src" / "estimator.c", "-o", tmp_path / "e.o"], check=True
    )
