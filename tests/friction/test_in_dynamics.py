"""Friction in the dynamics: C and PROGRAMs against Pinocchio's dynamics plus the laws' formulas in mpmath."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import mpmath
import numpy as np
import pytest
from bundled import bundled_model, bundled_robot
from command_line import status
from friction_logs import NOISE, friction_log
from slow_cases import slow_but_for
from unoptimised import without_optimisation
from urdf_text import LIMIT, inertial, joint, link, urdf

import psdmc
from psdmc.calibration.logs.log_files import write_log
from psdmc.errors import InputError
from psdmc.friction.law import Law, Value, cos, sin
from psdmc.friction.own import data_of
from psdmc.functions import DEFAULT, OF_TREES, RECIPES
from psdmc.functions.forward_dynamics_second_derivatives import _solved
from psdmc.lower.kernels import lower
from psdmc.model.calibrated_json import from_json
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.linear_friction import friction_in_dynamics
from psdmc.model.random_states import on_joints
from psdmc.program.interpret import interpret
from psdmc.program.signature import TAU, Sizes
from psdmc.recipes.directions import COTANGENT
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.recipes.torques_and_accelerations import with_friction
from psdmc.robot.coordinates import MimicMap
from psdmc.robot.load import load_robot
from psdmc.robot.reference import Reference, reference
from psdmc.toolchain.build_package import build_package

Array = np.ndarray
EXACT = 1e-12
EXAMPLE = Path(__file__).parents[2] / "examples" / "friction_laws" / "ripple.py"
SIGN_SPEED, STRIBECK = 0.03, 0.15
NUMBERS = (
    "coulomb",
    "viscous",
    "viscous^0.5",
    "stribeck_0.15",
    "coulomb_asymmetry",
    "offset",
    "waves",
    "swell",
)
MOTORS = tuple(
    name for name in OF_TREES if RECIPES[name].signature.has_motor_torques and not RECIPES[name].packs
)
HESSIANS = ("inverse_dynamics_second_derivatives", "forward_dynamics_second_derivatives")
RIPPLE = Law(
    name="ripple",
    about="Waves.",
    formula="waves sin(5 q) + swell cos(5 q)",
    values=(Value("waves", low=-math.inf), Value("swell", low=-math.inf)),
    torque=lambda p, at: p[0] * sin(5.0 * at.q) + p[1] * cos(5.0 * at.q),
)

FOLLOWS = '<mimic joint="knee" multiplier="-0.7" offset="0.1"/>'
THICK = "0.11 0.12 0.09 0.01 0.02 -0.01"
TURNED = "0.2 0.1 -0.3"
WALKER = urdf(
    link("trunk", inertial(5.0, "0.02 0.01 0.05", "0 0 0", THICK)),
    *(link(f"leg{k}", inertial(2.0 - 0.4 * k, "0.1 0.03 0.05", "0 0 0", THICK)) for k in range(3)),
    joint("hip", "trunk", "leg0", xyz="0.2 0 0", rpy=TURNED, axis="0 1 0"),
    joint("knee", "leg0", "leg1", xyz="0.3 0.1 0", rpy=TURNED),
    joint("foot", "leg1", "leg2", xyz="0.3 0 0.1", rpy=TURNED, axis="0 1 0", extra=LIMIT + FOLLOWS),
    name="walker",
)
"""A floating base whose foot follows the knee."""


def formula(p: Array, q: object, v: object, speed: float) -> object:
    """Friction of one joint in mpmath; `p` in the order of NUMBERS."""
    coulomb, viscous, curved, peak, asymmetry, offset, waves, swell = (mpmath.mpf(float(x)) for x in p)
    sign, size = mpmath.tanh(v / mpmath.mpf(speed)), abs(v)
    against = coulomb + viscous * size + curved * mpmath.sqrt(size)
    against += peak * mpmath.exp(-((v / mpmath.mpf(STRIBECK)) ** 2))
    ripple = waves * mpmath.sin(5 * q) + swell * mpmath.cos(5 * q)
    return sign * against + abs(sign) * asymmetry + offset + ripple


class Case:
    """A robot with friction, as psdmc and as Pinocchio see it, and states.

    places  for each joint with friction its places in q and qd
    """

    def __init__(
        self, model: DynamicsModel, plain: Reference, joints: list[str], speed: float | None
    ) -> None:
        rng = np.random.default_rng(5)
        self.values = rng.uniform(0.2, 1.5, (len(joints), len(NUMBERS)))
        self.values[:, 4] *= 0.1
        rows = [
            {"joint": joint, "name": name, "value": float(x)}
            for joint, own in zip(joints, self.values, strict=True)
            for name, x in zip(NUMBERS, own, strict=True)
        ]
        columns = {"friction": {"laws": [data_of(RIPPLE)]}}
        law = {"law": "linear", "exponents": [1.0, 0.5], "sign_speed": SIGN_SPEED, "columns": columns}
        self.model = replace(model, calibrated=from_json({"friction": rows, "prediction": law}))
        self.plain, self.speed = plain, speed
        start = model.nv - len(joints)
        self.places = [(model.nq - len(joints) + k, start + k) for k in range(len(joints))]
        self.friction = friction_in_dynamics(self.model, speed)
        self.pinocchio = resisted(plain, self.law)
        self.sizes = Sizes.of(model.mechanism, model.l)
        read = {q.name: q for name in MOTORS for q in RECIPES[name].signature.inputs}
        self.given = {
            q.name: q.drawn(rng.uniform(-1.0, 1.0, (COUNT, *self.sizes.shape(q.axes)))) for q in read.values()
        }
        self.given["q"] = on_joints(model.mechanism, self.given["q"])
        self.given["qd"][0, -2:] = 0.004, -0.03
        states = (self.given[name] for name in ("q", "qd", "qdd"))
        self.given["tau"] = self.pinocchio.inverse_dynamics(*states)

    def law(self, q: Array, qd: Array, order: tuple[int, int] = (0, 0)) -> Array:
        """The friction of all rates, or its derivatives of this order by q and by v, to 40 digits."""
        found, speed = np.zeros(qd.shape), self.speed or SIGN_SPEED
        with mpmath.workdps(40):
            for p, (place, rate) in zip(self.values, self.places, strict=True):
                for state in np.ndindex(qd.shape[:-1]):
                    at = mpmath.mpf(float(q[(*state, place)])), mpmath.mpf(float(qd[(*state, rate)]))
                    own = lambda q, v, p=p: formula(p, q, v, speed)  # noqa: E731
                    value = mpmath.diff(own, at, order) if any(order) else own(*at)
                    found[(*state, rate)] = float(value)
        return found

    def expected(self, name: str) -> dict[str, Array]:
        recipe = RECIPES[name]
        if name not in HESSIANS:
            return recipe.pinocchio(self.pinocchio, self.given)
        there, slopes = dict(self.given), []
        if name == HESSIANS[1]:
            states = (self.given[each] for each in ("q", "qd", "tau"))
            there["qdd"], *slopes = self.pinocchio.forward_dynamics_derivatives(*states)
            there[COTANGENT.name] = np.einsum("si,sij->sj", self.given[COTANGENT.name], slopes[2])
        hessian = RECIPES[HESSIANS[0]].pinocchio(self.plain, there)["hessian"]
        own = np.arange(self.model.nv)
        for a, b in ((0, 0), (0, 1), (1, 0), (1, 1)):
            bend = self.law(there["q"], there["qd"], ((a == 0) + (b == 0), a + b))
            hessian[:, own + a * len(own), own + b * len(own)] += there[COTANGENT.name] * bend
        return {"hessian": _solved(hessian, slopes) if slopes else hessian}


COUNT = 6


def resisted(plain: Reference, law: Callable[..., Array]) -> Reference:
    """Pinocchio's dynamics of the robot with this friction."""

    class Resisted(Reference):
        __slots__ = ()

        def inverse_dynamics(self, q, qd, qdd, wrenches=None):
            return plain.inverse_dynamics(q, qd, qdd, wrenches) + law(q, qd)

        def forward_dynamics(self, q, qd, tau, wrenches=None):
            return plain.forward_dynamics(q, qd, tau - law(q, qd), wrenches)

        def nonlinear_effects(self, q, qd):
            return plain.nonlinear_effects(q, qd) + law(q, qd)

        def inverse_dynamics_derivatives(self, q, qd, qdd, wrenches=None):
            by_q, by_qd, by_qdd = plain.inverse_dynamics_derivatives(q, qd, qdd, wrenches)
            return by_q + diagonal(law(q, qd, (1, 0))), by_qd + diagonal(law(q, qd, (0, 1))), by_qdd

        def forward_dynamics_derivatives(self, q, qd, tau, wrenches=None):
            qdd = self.forward_dynamics(q, qd, tau, wrenches)
            _, _, by_tau = plain.inverse_dynamics_derivatives(q, qd, qdd, wrenches)
            by_tau = np.linalg.inv(by_tau)
            by_q, by_qd, _ = self.inverse_dynamics_derivatives(q, qd, qdd, wrenches)
            return qdd, -by_tau @ by_q, -by_tau @ by_qd, by_tau

    return Resisted(plain.model, plain.tip_name, plain.frame_names, plain.rows)


def on_coordinates(free: Reference, model: DynamicsModel) -> Reference:
    """Pinocchio's dynamics of a robot whose mimic joints follow: S^T tau with the rates S qd of all joints."""
    own = MimicMap.of(model.mechanism.coordinates, model.mechanism.types)

    class Followed(Reference):
        __slots__ = ()

        def inverse_dynamics(self, q, qd, qdd, wrenches=None):
            return own.summed(free.inverse_dynamics(own.positions(q), own.rates(qd), own.rates(qdd)))

        def inverse_dynamics_derivatives(self, q, qd, qdd, wrenches=None):
            blocks = free.inverse_dynamics_derivatives(own.positions(q), own.rates(qd), own.rates(qdd))
            return tuple(own.summed(own.summed(block), -2) for block in blocks)

        def forward_dynamics(self, q, qd, tau, wrenches=None):
            load = tau - self.inverse_dynamics(q, qd, np.zeros_like(qd))
            mass = self.inverse_dynamics_derivatives(q, qd, qd)[2]
            return np.linalg.solve(mass, load[..., None])[..., 0]

    return Followed(free.model, free.tip_name, free.frame_names, free.rows)


def diagonal(values: Array) -> Array:
    return values[..., None] * np.eye(values.shape[-1])


@cache
def case(name: str, speed: float | None = None) -> Case:
    if name == "arm":
        model = bundled_model("scara")
        return Case(model, reference(bundled_robot("scara")), list(model.joint_names), speed)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "walker.urdf"
        path.write_text(WALKER if name == "walker" else WALKER.replace(FOLLOWS, ""), encoding="utf-8")
        model = psdmc.derive(path, floating=True, expand=False)
        plain = reference(load_robot(path, floating=True))
    if name == "walker":
        return Case(model, on_coordinates(plain, model), ["hip", "knee"], speed)
    return Case(model, plain, ["hip", "knee", "foot"], speed)


def compared(name: str, expected: dict[str, Array], found: dict[str, Array], limit: float = EXACT) -> None:
    largest = max(float(np.abs(values).max()) for values in expected.values())
    for output, values in expected.items():
        size = max(float(np.abs(values).max()), 1e-6 * largest)
        error = np.abs(np.reshape(found[output], values.shape) - values).max() / size
        assert error < limit, f"{name}: {output}: {error:.1e}"


WITHOUT_STEPS = tuple(
    name
    for name in MOTORS
    if not any(word in name for word in ("euler", "rk4", "wrenches", "constrained", "contact", "second"))
)
"""What Pinocchio can say of a robot with a mimic joint."""


@pytest.mark.parametrize(
    ("robot", "name"),
    slow_but_for(
        [("arm" if name in WITHOUT_STEPS else "floating", name) for name in MOTORS],
        [(robot, name) for robot in ("arm", "floating") for name in MOTORS]
        + [("walker", name) for name in WITHOUT_STEPS],
        spread=True,
    ),
)
def test_every_function_is_pinocchios_with_the_law(name: str, robot: str) -> None:
    """PROGRAMs without and with theta_b, and the NumPy reference of the self-test."""
    own, recipe = case(robot, 0.05 if robot == "arm" else None), RECIPES[name]
    expected = own.expected(name)
    theta_b = np.asarray(own.model.theta_b)
    on_arrays = RobotOnArrays.of(own.model, theta_b)
    found = with_friction(recipe, own.friction).reference(on_arrays, own.given)
    if recipe.gradient:
        expected = {key: value for key, value in expected.items() if key != recipe.gradient}
    compared(name, expected, found, 1e-11 if "rk4" in name else EXACT)
    given = {key: np.reshape(value, (COUNT, -1)) for key, value in own.given.items()} | {"theta_b": theta_b}
    for kernel in lower(own.model, "auto", [name], friction=own.friction).values():
        if kernel.function is recipe.signature:
            for program in (kernel.single, kernel.batch):
                sizes = recipe.signature.sizes(own.sizes)
                compared(name, expected, interpret(program, given, sizes), 1e-11 if "rk4" in name else EXACT)


REGIONS = tuple(
    name
    for name in MOTORS
    if RECIPES[name].regions is not None or name in ("inverse_dynamics", "forward_dynamics", *HESSIANS)
)
"""Functions whose C for many rates is loops and calls of others, and those with which they can be compared."""


@pytest.mark.parametrize(
    ("robot", "names"),
    slow_but_for(
        [("walker", DEFAULT)], [("arm", MOTORS), ("floating", REGIONS), ("walker", DEFAULT)], spread=True
    ),
)
def test_c_is_pinocchios_with_the_law(robot: str, names: tuple[str, ...]) -> None:
    """One state, and many states in lanes."""
    own = case(robot, 0.05 if robot == "arm" else None)
    with without_optimisation():
        compiled = psdmc.compile(own.model, functions=names, friction=True, smoothing_speed=own.speed)
    for name in names:
        if name in MOTORS:
            recipe, expected = RECIPES[name], own.expected(name)
            inputs = [own.given[quantity.name] for quantity in recipe.signature.inputs]
            rows = compiled.call(recipe.signature, inputs)
            one = compiled.call(recipe.signature, [array[3] for array in inputs])
            for found, wanted in ((rows, expected), (one, {k: v[3] for k, v in expected.items()})):
                values = [found] if len(recipe.signature.outputs) == 1 else found
                named = dict(zip((each.name for each in recipe.signature.outputs), values, strict=True))
                kept = {key: value for key, value in wanted.items() if key != recipe.gradient}
                compared(name, kept, named, 1e-10 if "rk4" in name or found is one else EXACT)


def test_functions_without_torques_of_motors_are_the_same() -> None:
    """Among them one whose loops call derivatives of inverse dynamics, for a robot with more than eight rates."""
    own, names = case("floating"), ("nonlinear_effects", "mass_matrix", "impulse_derivatives")
    with without_optimisation():
        found = psdmc.compile(own.model, functions=names, friction=True)
        plain = psdmc.compile(own.model, functions=names)
    rng = np.random.default_rng(2)
    for name in names:
        signature = RECIPES[name].signature
        given = [
            own.given.get(q.name, q.drawn(rng.uniform(-1.0, 1.0, (COUNT, *own.sizes.shape(q.axes)))))
            for q in signature.inputs
        ]
        for one, other in zip(found.call(signature, given), plain.call(signature, given), strict=True):
            assert np.allclose(one, other, rtol=1e-10, atol=1e-9), name


def test_functions_with_torques_of_motors_are_found() -> None:
    with_tau = {
        name for name, each in RECIPES.items() if TAU in (*each.signature.inputs, *each.signature.outputs)
    }
    assert {name for name in with_tau if not RECIPES[name].packs} <= set(MOTORS)
    words = ("gravity", "mass", "regressor", "nonlinear", "coriolis", "impulse", "momentum", "energy", "com_")
    assert not [name for name in MOTORS for word in words if word in name]


def test_derivatives_at_rest_are_numbers_and_the_slope_of_the_law() -> None:
    """|v|^0.5 has no derivative at rest, its product with the smooth sign has: zero."""
    own = case("arm")
    still = {"q": own.given["q"], "qd": 0.0 * own.given["qd"]}
    slopes = own.friction.slopes(list(still["q"].T), list(still["qd"].T))
    coulomb, _, _, peak, asymmetry, *_ = own.values.T
    by_qd = np.transpose(slopes[1])
    assert np.allclose(by_qd, (coulomb + peak + asymmetry) / SIGN_SPEED, rtol=1e-7)
    for each in own.friction.bends(list(still["q"].T), list(still["qd"].T)):
        assert np.isfinite(np.array(each)).all()


def test_a_log_s_residual_is_its_noise(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A log of Pinocchio's torques with friction and a ripple is calibrated; the C of the result predicts another log."""
    truth = np.array([[3.0, 1.5], [0.8, 0.3], [0.9, -0.35]])

    def friction(q: Array, qd: Array) -> Array:
        return np.tanh(qd / SIGN_SPEED) * (truth[0] + truth[1] * np.abs(qd)) + truth[2] * np.sin(5.0 * q)

    (log, _), (other, qdd) = (friction_log(seed, 30.0, friction) for seed in (3, 4))
    write_log(log, tmp_path / "3.csv")
    bundled_model("two_link_full").save(tmp_path / "arm.npz")
    shutil.copy(EXAMPLE, tmp_path)
    (tmp_path / "log.toml").write_text('friction = "ripple.py"\n[[log]]\nfile = "3.csv"\n', encoding="utf-8")
    found = tmp_path / "found.npz"
    assert status("calibrate", tmp_path / "arm.npz", tmp_path / "log.toml", "-o", found) == 0
    robot = psdmc.compile(found, friction=True, functions=["inverse_dynamics", "forward_dynamics"])
    states, torque = (other.position, other.velocity, qdd), other.effort
    residual = robot.inverse_dynamics(*states) - torque
    assert np.sqrt((residual**2).mean(axis=0)) == pytest.approx(NOISE, rel=0.05)
    without = psdmc.compile(found, functions=["inverse_dynamics"]).inverse_dynamics(*states) - torque
    assert np.sqrt((without**2).mean(axis=0)).min() > 10.0 * NOISE
    back = robot.forward_dynamics(*states[:2], robot.inverse_dynamics(*states))
    assert np.allclose(back, states[2], rtol=1e-10, atol=1e-10)

    package = tmp_path / "c"
    words = (found, "-o", package, "--functions", "inverse_dynamics,gravity,rk4_step_derivatives")
    assert status("emit-c", *words, "--friction=in-dynamics", "--smoothing-speed", 0.1) == 0
    build_package(package)
    header = (package / "include" / "two_link_full" / "two_link_full.h").read_text(encoding="utf-8")
    assert "s = tanh(v / 0.1), a smooth sign" in header
    assert "s (Coulomb + viscous |v|) + ripple_sin sin(5 q) + ripple_cos cos(5 q)" in header
    assert (
        "Functions with friction: inverse_dynamics, forward_dynamics_derivatives, rk4_step_derivatives."
        in header
    )
    assert "Functions without friction: gravity." in header
    assert "two_link_full_friction" not in header
    capsys.readouterr()
    assert status("emit-c", found, "-o", package, "--check") == 0
    assert "up to date" in capsys.readouterr().out
    assert status("emit-c", "--friction", found, "-o", tmp_path / "plain", "--functions", "gravity") == 0
    assert (tmp_path / "plain" / "src" / "friction.c").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--friction=x",), "type --friction or --friction=in-dynamics"),
        (("--smoothing-speed", "0.1"), "add --friction=in-dynamics"),
        (("--friction=in-dynamics", "--smoothing-speed", "0"), "expected a number of rad/s from 1e-09"),
        (("--friction=in-dynamics", "--smoothing-speed", "1e-310"), "expected a number of rad/s from 1e-09"),
        (("--friction=in-dynamics", "--estimator", "mass"), "write --friction, and subtract"),
        (("--friction=in-dynamics", "--trig", "freestanding"), "friction needs tanh, which is libm's"),
        (("--friction=in-dynamics", "--functions", f"{HESSIANS[0]}_packed"), f"emit {HESSIANS[0]}, or leave"),
    ],
)
def test_wrong_options_are_refused(
    words: tuple[str, ...], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case("arm").model.save(tmp_path / "arm.npz")
    assert status("emit-c", tmp_path / "arm.npz", "-o", tmp_path / "c", *words) != 0
    assert said in capsys.readouterr().err
    assert not (tmp_path / "c").exists()


def test_models_without_such_friction_are_refused() -> None:
    with pytest.raises(InputError, match="not calibrated"):
        psdmc.compile(bundled_model("scara"), friction=True)
    known = case("arm").model
    for speed in ("0.1", [0.1], True, 10**400):
        with pytest.raises(InputError, match="expected a number of rad/s"):
            psdmc.compile(known, friction=True, smoothing_speed=speed)  # type: ignore[arg-type]
    assert known.calibrated is not None
    state = from_json(
        {"friction": [], "prediction": {"law": "lugre", "exponents": [1.0], "sign_speed": 0.03}}
    )
    with pytest.raises(InputError, match="its friction has a state"):
        psdmc.compile(replace(known, calibrated=state), friction=True)
    walker = case("walker").model
    assert walker.calibrated is not None
    rows = tuple(replace(row, joint="foot") for row in walker.calibrated.friction[:1])
    foreign = replace(walker.calibrated, friction=(*walker.calibrated.friction, *rows))
    with pytest.raises(InputError, match="follow no other"):
        friction_in_dynamics(replace(walker, calibrated=foreign))
