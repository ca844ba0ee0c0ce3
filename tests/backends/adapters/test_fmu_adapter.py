"""emit-c --with fmu: FMUs in FMPy, against SciPy's integration of Pinocchio's accelerations."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model, bundled_robot, under_gravity, weighed_model
from random_trees import RandomTree
from scipy.integrate import solve_ivp

from psdmc.compiler import emit_c
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.functions import RECIPES
from psdmc.robot.reference import reference
from psdmc.toolchain.compiler_command import find_compiler

pytest.importorskip("fmpy")
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.build import build_platform_binary
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model
from fmpy.fmi3 import FMU3Model
from fmpy.validation import validate_fmu

TIGHT = {"rtol": 1e-12, "atol": 1e-13, "method": "DOP853"}
FORWARD, ALL = ["forward_dynamics_jvp"], ["kinetic_energy", "potential_energy", "forward_kinematics"]


def packed(
    robot: str, folder: Path, functions: list[str], adapter: str = "fmu", gravity_input: bool = False
) -> Path:
    """The FMU of a bundled robot, as `make fmu` or `make fmu2` packs it."""
    model = (weighed_model if gravity_input else bundled_model)(robot)
    own = {"functions": functions, "adapters": adapter, "gravity_input": gravity_input}
    emit_c(model, folder / "arm", name="arm", **own)  # type: ignore[arg-type]
    flags = "CFLAGS=-O0 -Wall -Wextra -Wpedantic -Wconversion -Wno-sign-conversion -Werror"
    make = ["make", "-s", "-C", folder / "arm", adapter, flags, f"CC={' '.join(find_compiler().command)}"]
    done = subprocess.run(make, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder / "arm" / "build" / f"arm{adapter[3:]}.fmu"


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return packed("two_link", tmp_path_factory.mktemp("fmu"), FORWARD)


@pytest.fixture(scope="module")
def fmu2(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return packed("two_link", tmp_path_factory.mktemp("fmu2"), FORWARD, "fmu2")


@pytest.fixture
def model2(fmu2: Path, tmp_path: Path) -> Iterator[FMU2Model]:
    """The FMU of FMI 2.0, ready for model exchange."""
    made = FMU2Model(
        guid=read_model_description(str(fmu2)).guid,
        unzipDirectory=extract(str(fmu2), str(tmp_path)),
        modelIdentifier="arm",
        instanceName="arm",
    )
    made.instantiate()
    made.setupExperiment()
    made.enterInitializationMode()
    made.exitInitializationMode()
    yield made
    made.terminate()
    made.freeInstance()


@pytest.fixture
def model(fmu: Path, tmp_path: Path) -> Iterator[FMU3Model]:
    """The FMU, ready for model exchange."""
    known = read_model_description(str(fmu))
    made = FMU3Model(
        guid=known.guid,
        unzipDirectory=extract(str(fmu), str(tmp_path)),
        modelIdentifier="arm",
        instanceName="arm",
    )
    made.instantiate()
    made.enterInitializationMode()
    made.exitInitializationMode()
    made.enterContinuousTimeMode()
    yield made
    made.terminate()
    made.freeInstance()


def places(fmu: Path, *names: str) -> list[int]:
    """Value references of the variables name[0], name[1], ..."""
    known = read_model_description(str(fmu)).modelVariables
    return [
        one.valueReference
        for name in names
        for one in known
        if one.name == name or one.name.startswith(f"{name}[")
    ]


def motion(
    robot: str,
    start: np.ndarray,
    tau: np.ndarray,
    times: np.ndarray,
    share: float = 1.0,
    gravity: object = None,
) -> np.ndarray:
    """q and qd at these times, by Pinocchio and SciPy; all masses times `share`."""
    oracle, n = reference(bundled_robot(robot)), len(tau)
    oracle = oracle if gravity is None else under_gravity(oracle, gravity)

    def slope(t: float, x: np.ndarray) -> np.ndarray:
        return np.concatenate(
            [x[n:], oracle.forward_dynamics(x[None, :n], x[None, n:], tau[None] / share)[0]]
        )

    return solve_ivp(slope, (0.0, times[-1]), start, t_eval=times, **TIGHT).y.T


def states_of(result: np.ndarray, n: int) -> np.ndarray:
    return np.column_stack([result[f"{name}[{k}]"] for name in ("q", "qd") for k in range(n)])


def test_fmpy_finds_no_fault_in_it(fmu: Path) -> None:
    assert validate_fmu(str(fmu)) == []
    known = read_model_description(str(fmu), validate=True)
    assert known.numberOfContinuousStates == 4
    assert (fmu.parents[1] / "fmu" / "modelDescription.xml").read_text().count(
        'DirectionalDerivatives="true"'
    ) == 2
    assert [one.description for one in known.modelVariables if one.name == "tau[1]"] == ["joint elbow"]


def test_fmpy_finds_no_fault_in_fmi_2(fmu2: Path) -> None:
    assert validate_fmu(str(fmu2)) == []
    known = read_model_description(str(fmu2), validate=True)
    assert (known.fmiVersion, known.numberOfContinuousStates) == ("2.0", 4)
    states = [one.derivative.name for one in known.modelVariables if one.derivative is not None]
    assert states == ["q[0]", "q[1]", "qd[0]", "qd[1]"]


@pytest.mark.parametrize("kind", ["ModelExchange", "CoSimulation"])
@pytest.mark.parametrize("version", ["fmu", "fmu2"])
def test_it_moves_as_pinocchio_s_robot_does(version: str, kind: str, request: pytest.FixtureRequest) -> None:
    moves_as_pinocchio_s(request.getfixturevalue(version), kind, "two_link")


def test_fmi_2_has_derivatives_states_and_errors(fmu2: Path, model2: FMU2Model) -> None:
    rng, known = np.random.default_rng(8), places(fmu2, "q", "qd", "tau")
    state, seed = rng.uniform(-1.0, 1.0, (2, 6))
    model2.setReal(known, list(state))
    q, qd, tau = (part[None] for part in state.reshape(3, 2))
    oracle = reference(bundled_robot("two_link"))
    _, by_q, by_qd, by_tau = oracle.forward_dynamics_derivatives(q, qd, tau)
    expected = np.hstack([by_q[0], by_qd[0], by_tau[0]]) @ seed
    found = model2.getDirectionalDerivative(places(fmu2, "qdd"), known, list(seed))
    assert np.abs(np.array(found) - expected).max() < 1e-12 * np.abs(expected).max()
    qdd, kept = model2.getReal(places(fmu2, "qdd")), model2.getFMUstate()
    assert np.abs(qdd - oracle.forward_dynamics(q, qd, tau)[0]).max() < 1e-12 * np.abs(qdd).max()

    for wrong in ([float("nan")], [float("inf")]):
        with pytest.raises(FMICallException, match="status 3"):
            model2.setReal(places(fmu2, "theta_b")[:1], wrong)
    model2.setReal(places(fmu2, "q"), [0.0, 1.0])
    assert model2.getReal(places(fmu2, "qdd")) != qdd
    model2.setFMUstate(kept)
    assert model2.getReal(places(fmu2, "qdd")) == qdd
    model2.freeFMUstate(kept)
    with pytest.raises(FMICallException, match="status 3"):
        model2.getInteger([1])


@pytest.mark.slow
def test_fmpy_compiles_the_sources_of_fmi_2(tmp_path: Path) -> None:
    unzipped = Path(extract(str(packed("two_link", tmp_path, FORWARD, "fmu2")), str(tmp_path / "unzipped")))
    shutil.rmtree(unzipped / "binaries")
    build_platform_binary(unzipped)
    moves_as_pinocchio_s(unzipped, "CoSimulation", "two_link")


def moves_as_pinocchio_s(fmu: Path, kind: str, robot: str) -> None:
    n = len(bundled_model(robot).joint_names)
    rng = np.random.default_rng(5)
    start, tau = rng.uniform(-1.0, 1.0, 2 * n), rng.uniform(-1.0, 1.0, n)
    given = {f"{name}[{k}]": start[k + n * (name == "qd")] for name in ("q", "qd") for k in range(n)}
    given |= {f"tau[{k}]": tau[k] for k in range(n)} | {"internal_step": 2e-4}
    given |= {f"theta_b[{k}]": 2.0 * value for k, value in enumerate(bundled_model(robot).theta_b)}
    names = [f"{name}[{k}]" for name in ("q", "qd") for k in range(n)]
    result = simulate_fmu(
        str(fmu), fmi_type=kind, start_values=given, output=names, stop_time=0.5, output_interval=0.05,
        relative_tolerance=1e-12,
    )  # fmt: skip
    expected = motion(robot, start, tau, result["time"], share=2.0)
    assert len(result) == 11
    assert np.abs(states_of(result, n) - expected).max() < 1e-8 * np.abs(expected).max()


@pytest.mark.parametrize(("version", "kind"), [("fmu", "ModelExchange"), ("fmu2", "CoSimulation")])
def test_gravity_is_a_parameter(version: str, kind: str, tmp_path: Path) -> None:
    """Motions are those of Pinocchio under the gravity given, and under that of the file if none is given."""
    robot, pull, tau = "two_link", (3.0, -2.0, 6.0), np.array([0.5, -0.2])
    fmu = packed(robot, tmp_path, ["potential_energy"], version, gravity_input=True)
    assert validate_fmu(str(fmu)) == []
    known = {one.name: one for one in read_model_description(str(fmu), validate=True).modelVariables}
    file = bundled_model(robot).mechanism.gravity
    assert [float(known[f"gravity[{k}]"].start) for k in range(3)] == list(file)
    assert known["gravity[0]"].description == "gravity along x of the base frame"
    given = {"tau[0]": tau[0], "tau[1]": tau[1], "internal_step": 2e-4}
    turned = {f"gravity[{k}]": value for k, value in enumerate(pull)}
    for start, gravity in ((given, file), (given | turned, pull)):
        result = simulate_fmu(
            str(fmu), fmi_type=kind, start_values=start, output=["q[0]", "q[1]", "qd[0]", "qd[1]", "U"],
            stop_time=0.3, output_interval=0.05, relative_tolerance=1e-12,
        )  # fmt: skip
        expected = motion(robot, np.zeros(4), tau, result["time"], gravity=gravity)
        assert np.abs(states_of(result, 2) - expected).max() < 1e-8 * np.abs(expected).max()
        oracle = under_gravity(reference(bundled_robot(robot)), gravity)
        energy = RECIPES["potential_energy"].pinocchio(oracle, {"q": expected[:, :2]})["U"]
        assert np.abs(np.diff(result["U"]) - np.diff(energy)).max() < 1e-7 * np.abs(energy).max()


def test_directional_derivatives_under_another_gravity(tmp_path: Path) -> None:
    fmu = packed("two_link", tmp_path, FORWARD, gravity_input=True)
    known = read_model_description(str(fmu))
    model = FMU3Model(
        guid=known.guid, unzipDirectory=extract(str(fmu), str(tmp_path / "fmu")), modelIdentifier="arm", instanceName="arm"
    )  # fmt: skip
    model.instantiate()
    rng, places_of = np.random.default_rng(8), places(fmu, "q", "qd", "tau")
    state, seed = rng.uniform(-1.0, 1.0, (2, 6))
    model.setFloat64([*places_of, *places(fmu, "gravity")], [*state, 3.0, -2.0, 6.0])
    oracle = under_gravity(reference(bundled_robot("two_link")), (3.0, -2.0, 6.0))
    _, *blocks = oracle.forward_dynamics_derivatives(*(part[None] for part in state.reshape(3, 2)))
    expected = np.hstack([block[0] for block in blocks]) @ seed

    found = model.getDirectionalDerivative(places(fmu, "qdd"), places_of, list(seed))

    assert np.abs(np.array(found) - expected).max() < 1e-12 * np.abs(expected).max()
    with pytest.raises(FMICallException, match="status 3"):
        model.setFloat64(places(fmu, "gravity")[:1], [float("nan")])
    model.freeInstance()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["ModelExchange", "CoSimulation"])
def test_kr6_moves_as_pinocchio_s(kind: str, tmp_path: Path) -> None:
    moves_as_pinocchio_s(packed("kr6", tmp_path, ["forward_dynamics"]), kind, "kr6")


def test_scipy_integrates_it_with_inputs_that_change(fmu: Path, model: FMU3Model) -> None:
    """Model exchange by hand."""
    torques = places(fmu, "tau")
    oracle, start = reference(bundled_robot("two_link")), np.array([0.3, -0.8, 1.0, 0.2])

    def tau(t: float) -> np.ndarray:
        return np.array([np.sin(5.0 * t), 0.4 * np.cos(3.0 * t)])

    def slope(t: float, x: np.ndarray) -> np.ndarray:
        found, states = (ctypes.c_double * 4)(), (ctypes.c_double * 4)(*x)
        model.setTime(t)
        model.setFloat64(torques, list(tau(t)))
        model.setContinuousStates(states, 4)
        model.getContinuousStateDerivatives(found, 4)
        return np.array(found)

    def pinocchio_s(t: float, x: np.ndarray) -> np.ndarray:
        return np.concatenate([x[2:], oracle.forward_dynamics(x[None, :2], x[None, 2:], tau(t)[None])[0]])

    ends = [solve_ivp(one, (0.0, 1.0), start, **TIGHT).y[:, -1] for one in (slope, pinocchio_s)]
    assert np.abs(ends[0] - ends[1]).max() < 1e-9


def test_directional_derivatives_are_pinocchio_s(fmu: Path, model: FMU3Model) -> None:
    rng, known = np.random.default_rng(8), places(fmu, "q", "qd", "tau")
    state, seed = rng.uniform(-1.0, 1.0, (2, 6))
    model.setFloat64(known, list(state))
    q, qd, tau = (part[None] for part in state.reshape(3, 2))
    _, by_q, by_qd, by_tau = reference(bundled_robot("two_link")).forward_dynamics_derivatives(q, qd, tau)
    expected = np.hstack([by_q[0], by_qd[0], by_tau[0]]) @ seed

    found = model.getDirectionalDerivative(places(fmu, "qdd", "der_q", "q"), known, list(seed))

    assert np.abs(np.array(found) - [*expected, *seed[2:4], *seed[:2]]).max() < 1e-12 * np.abs(expected).max()
    with pytest.raises(FMICallException, match="status 3"):
        model.getDirectionalDerivative(places(fmu, "qdd"), places(fmu, "theta_b"), [1.0] * 4)


def test_a_state_is_kept_and_put_back(fmu: Path, model: FMU3Model) -> None:
    model.setFloat64(places(fmu, "q"), [0.5, -0.5])
    before, kept = model.getFloat64(places(fmu, "qdd")), model.getFMUState()
    model.setFloat64(places(fmu, "q", "tau"), [0.0, 0.0, 3.0, 4.0])
    assert model.getFloat64(places(fmu, "qdd")) != before

    model.setFMUState(kept)

    assert model.getFloat64(places(fmu, "qdd", "q")) == [*before, 0.5, -0.5]
    model.freeFMUState(kept)
    model.reset()
    assert model.getFloat64(places(fmu, "q")) == [0.0, 0.0]


def test_what_it_refuses_changes_nothing(fmu: Path, model: FMU3Model) -> None:
    theta, wrong = places(fmu, "theta_b"), [
        (places(fmu, "theta_b")[:1], [float("nan")]),
        (places(fmu, "q") + places(fmu, "tau")[:1], [1.0, 1.0, float("inf")]),
        (places(fmu, "internal_step"), [0.0]),
        (places(fmu, "qdd")[:1], [1.0]),
        ([10_000], [1.0]),
        (places(fmu, "q"), [1.0]),
    ]  # fmt: skip
    everything = list(range(places(fmu, "internal_step")[0] + 1))
    before = model.getFloat64(everything)
    for references, values in wrong:
        with pytest.raises(FMICallException, match="status 3"):
            model.setFloat64(references, values)
    with pytest.raises(FMICallException, match="status 3"):
        model.getInt32([1])
    assert model.getFloat64(everything) == before
    model.setFloat64(theta, [0.0] * 4)
    with pytest.raises(FMICallException, match="status 2"):  # discard: no mass
        model.getFloat64(places(fmu, "qdd"))


def test_another_model_s_token_is_refused(fmu: Path, tmp_path: Path) -> None:
    made = FMU3Model(
        guid="{other}",
        unzipDirectory=extract(str(fmu), str(tmp_path)),
        modelIdentifier="arm",
        instanceName="arm",
    )

    with pytest.raises(Exception, match="instantiate"):
        made.instantiate()


def test_the_archive_has_the_same_bytes_again(fmu: Path) -> None:
    package, again = fmu.parents[1], fmu.with_name("again.fmu")
    pack = ["python3", package / "fmu" / "pack.py", package / "build" / "libarm_fmu.so", again]
    subprocess.run(pack, check=True)
    assert again.read_bytes() == fmu.read_bytes()
    subprocess.run([*pack, "aarch64-linux"], check=True)
    assert b"binaries/aarch64-linux/arm.so" in again.read_bytes()


@pytest.mark.slow
def test_energies_frames_and_the_sources_of_an_fmu(tmp_path: Path) -> None:
    """Of the FMU that FMPy compiles from its sources."""
    fmu = packed("scara", tmp_path, ALL)
    assert validate_fmu(str(fmu)) == []
    unzipped = Path(extract(str(fmu), str(tmp_path / "unzipped")))
    shutil.rmtree(unzipped / "binaries")
    build_platform_binary(unzipped, all_warnings=True)
    start = {"q[0]": 0.4, "q[1]": -0.6, "qd[0]": 0.7, "qd[2]": -0.1}
    names = ["T", "U", *(f"position[{k}]" for k in range(3))]
    result = simulate_fmu(str(unzipped), start_values=start, output=names, stop_time=0.01)
    oracle, (q, qd) = reference(bundled_robot("scara")), np.array([[0.4, -0.6, 0, 0], [0.7, 0, -0.1, 0]])
    assert result["T"][0] == pytest.approx(0.5 * qd @ oracle.mass_matrix(q[None])[0] @ qd, rel=1e-12)
    place = oracle.poses(q[None], [oracle.tip_name])[0, 0, :3, 3]
    assert [result[name][0] for name in names[2:]] == pytest.approx(place, abs=1e-12)
    energy = result["T"] + result["U"]
    assert np.abs(energy - energy[0]).max() < 1e-6


def test_names_of_robot_files_stay_in_their_attributes(tmp_path: Path) -> None:
    arm = bundled_model("two_link")
    emit_c(arm, tmp_path / "arm", functions="gravity", adapters="fmu", name='a" b="<c>&\n\x00--')
    known = read_model_description(str(tmp_path / "arm" / "fmu" / "modelDescription.xml"), validate=True)
    assert known.description == 'a" b="<c>&<0a><00>--'


def test_robots_that_no_fmu_can_have_are_refused(tmp_path: Path) -> None:
    arm = bundled_model("two_link")
    for model, options, expected in (
        (arm, {"real": "float32"}, "an FMU computes with double"),
        (replace(arm, theta_b=None), {}, "needs values of the base parameters"),
        (
            derive_model(RandomTree(5, (-1, 0), "FR").mechanism(), expand=False),
            {},
            "joints with several coordinates",
        ),
        (arm, {"target": "cortex-m4f"}, "has no shared libraries"),
    ):
        with pytest.raises(InputError, match=expected):
            emit_c(model, tmp_path / "c", functions="gravity", adapters="fmu", **options)  # type: ignore[arg-type]
    assert not (tmp_path / "c").exists()
