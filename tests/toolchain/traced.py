"""Kernels of a small arm with turning and sliding joints, traced straight from psdmc.dynamics: no lowering needed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np

from psdmc.backends.c.package import PackageView, package_view
from psdmc.backends.info import EmitOptions, JointInfo, PackageInfo
from psdmc.backends.reference_states import ReferenceStates
from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.frames import Frame, frame_at
from psdmc.dynamics.kinematics import jacobian
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.dynamics.regressor import regressor
from psdmc.dynamics.spatial import Body
from psdmc.functions import DEFAULT, SIGNATURES
from psdmc.model.equations import BaseParameter
from psdmc.program.interpret import interpret
from psdmc.program.kernel import Kernel
from psdmc.program.passes.drop_unused import drop_unused
from psdmc.program.program import Program, Slot
from psdmc.program.signature import Sizes
from psdmc.program.trace import Tracer
from psdmc.robot.joints import PRISMATIC, REVOLUTE
from psdmc.robot.mechanism import Placement

TYPES = (REVOLUTE, REVOLUTE, PRISMATIC, REVOLUTE)
N = len(TYPES)
L = 11 * N
SIZES = Sizes.of_chain(N, L)
UP = (0.0, 0.0, 9.81)
Outputs = list[tuple[Slot, object]]


def arm(seed: int = 0) -> tuple[list[Frame], np.ndarray]:
    """Frames, and body parameters (N, 11): mass, moment, second moments, drive inertia."""
    random = np.random.default_rng(seed)
    places = [
        Placement(np.linalg.qr(random.normal(size=(3, 3)))[0], random.normal(size=3) * 0.3) for _ in TYPES
    ]
    frames = [frame_at(TYPES[i], i - 1, place) for i, place in enumerate(places)]
    mass, moment = random.uniform(1, 5, (N, 1)), random.normal(size=(N, 3)) * 0.1
    second = np.hstack([random.uniform(0.5, 1, (N, 3)), random.normal(size=(N, 3)) * 0.05])
    return frames, np.hstack([mass, moment, second, random.uniform(0, 0.3, (N, 1))])


def bodies(values: Sequence[object]) -> tuple[list[Body], list[object]]:
    rows = [list(values[11 * i : 11 * i + 11]) for i in range(N)]
    return [Body(r[0], tuple(r[1:4]), tuple(r[4:10])) for r in rows], [r[10] for r in rows]


def vector(name: str, values: Sequence[object]) -> Outputs:
    return [(Slot(name, i), value) for i, value in enumerate(values)]


def matrix(name: str, rows: Sequence[Sequence[object]]) -> Outputs:
    return vector(name, [value for row in rows for value in row])


def ldl_solve(M: Sequence[Sequence[object]], right: Sequence[object]) -> tuple[list[object], list[object]]:
    """Pivots and solution of M x = right, unrolled, first joint first."""
    lower = [[0.0] * N for _ in range(N)]
    pivots: list[object] = []
    y: list[object] = []
    for j in range(N):
        pivot, value = M[j][j], right[j]
        for k in range(j):
            pivot = pivot - lower[j][k] * lower[j][k] * pivots[k]
            value = value - lower[j][k] * y[k]
        pivots.append(pivot)
        y.append(value)
        for i in range(j + 1, N):
            entry = M[i][j]
            for k in range(j):
                entry = entry - lower[i][k] * (lower[j][k] * pivots[k])
            lower[i][j] = entry / pivot
    x: list[object] = [0.0] * N
    for i in reversed(range(N)):
        x[i] = y[i] / pivots[i]
        for k in range(i + 1, N):
            x[i] = x[i] - lower[k][i] * x[k]
    return pivots, x


def traced(name: str, theta: bool, frames: list[Frame], parameters: np.ndarray) -> Program:
    """One function's PROGRAM."""
    tracer = Tracer()
    function = SIGNATURES[name]
    given = {q.name: tracer.symbols(q.name, N) for q in function.inputs}
    values = tracer.symbols("theta_b", L) if theta else [float(v) for v in parameters.ravel()]
    body, drive = bodies(values)
    zero = [0.0] * N

    def torque(qd: object, qdd: object, base: object = UP, qd_r: object = None) -> Sequence[object]:
        return inverse_dynamics(frames, body, drive, given["q"], qd, qdd, base, qd_r=qd_r)

    def coriolis() -> Outputs:
        units = [[1.0 if i == j else 0.0 for i in range(N)] for j in range(N)]
        columns = [torque(given["qd"], zero, (0.0, 0.0, 0.0), unit) for unit in units]
        return matrix("C", list(zip(*columns, strict=True)))

    def forward() -> Outputs:
        bias = torque(given["qd"], zero)
        right = [t - h for t, h in zip(given["tau"], bias, strict=True)]
        pivots, qdd = ldl_solve(mass_matrix(frames, body, drive, given["q"]), right)
        return vector("pivot", pivots) + vector("qdd", qdd)

    def feature_rows(last: str, reference: object = None) -> Outputs:
        rows = regressor(
            frames, [Placement.identity()] * N, range(L), given["q"], given["qd"], given[last], UP, reference
        )
        return [(Slot("Y", i * L + c), value) for i, row in enumerate(rows) for c, value in row.items()]

    makers: dict[str, Callable[[], Outputs]] = {
        "inverse_dynamics": lambda: vector("tau", torque(given["qd"], given["qdd"])),
        "forward_dynamics": forward,
        "mass_matrix": lambda: matrix("M", mass_matrix(frames, body, drive, given["q"])),
        "nonlinear_effects": lambda: vector("h", torque(given["qd"], zero)),
        "coriolis_matrix": coriolis,
        "gravity": lambda: vector("g", torque(zero, zero)),
        "regressor": lambda: feature_rows("qdd"),
        "regressor_slotine_li": lambda: feature_rows("qdd_r", given["qd_r"]),
        "jacobian": lambda: matrix("J", jacobian(frames, N - 1, Placement.identity(), given["q"])),
    }
    return drop_unused(tracer.finish(makers[name]()))


def arm_kernels(seed: int = 0, names: Sequence[str] | None = None) -> dict[str, Kernel]:
    """All functions, baked and with theta_b."""
    found = [
        arm_kernel(name, theta, seed)
        for name in DEFAULT
        if names is None or name in names
        for theta in ((False, True) if SIGNATURES[name].theta else (False,))
    ]
    return {kernel.name: kernel for kernel in found}


@cache
def arm_kernel(name: str, theta: bool, seed: int) -> Kernel:
    """Traced once by each process."""
    program = traced(name, theta, *arm(seed))
    return Kernel(SIGNATURES[name], theta, program, program, "factored")


def arm_info(name: str = "test arm", seed: int = 0) -> PackageInfo:
    parameters = arm(seed)[1].ravel().tolist()
    return PackageInfo(
        name=name,
        joints=tuple(
            JointInfo(
                f"joint {i}",
                joint.word,
                -1.0,
                1.0,
                2.0,
                effort=10.0,
                unit=joint.position_unit,
                effort_unit=joint.effort_unit,
            )
            for i, joint in enumerate(TYPES)
        ),
        gravity=(0.0, 0.0, -9.81),
        base="base",
        tip="tool",
        parameters=tuple(BaseParameter(f"p{i}", "kg", value) for i, value in enumerate(parameters)),
        model_hash="0123abcd",
        psdmc_version="0.1.0",
    )


def arm_package(
    name: str = "test arm",
    seed: int = 0,
    options: EmitOptions | None = None,
    names: Sequence[str] | None = None,
    references: ReferenceStates | None = None,
) -> PackageView:
    return package_view(arm_info(name, seed), arm_kernels(seed, names), options or EmitOptions(), references)


def arm_references(count: int = 4, seed: int = 0) -> ReferenceStates:
    """Random states and every function's values there, by the interpreted PROGRAMs."""
    kernels = arm_kernels(seed)
    theta = 1.25 * arm(seed)[1].ravel()
    q, qd, qdd, qd_r, qdd_r = np.random.default_rng(5).normal(size=(5, count, N))
    given = {"q": q, "qd": qd, "qdd": qdd, "qd_r": qd_r, "qdd_r": qdd_r}
    expected: dict[str, np.ndarray] = {}
    for name, kernel in kernels.items():
        function = kernel.function
        if not function.factorises:
            inputs = given | {"theta_b": theta}
            (expected[name],) = interpret(kernel.single, inputs, function.sizes(SIZES)).values()
    for suffix in ("", "_theta"):
        given[f"tau{suffix}"] = expected[f"inverse_dynamics{suffix}"]
        expected[f"forward_dynamics{suffix}"] = qdd
    return ReferenceStates(given, expected, theta)
