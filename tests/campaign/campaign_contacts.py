"""Random small robots with contacts and closed loops, one per seed, and their C in every layout against dense systems that
are built from Pinocchio's numbers.

Joints turn, slide or are balls, the base is fixed or floats. Every set of active contacts has two states. Errors are
relative to the bound of their state.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any
from unittest import mock

import numpy as np
import pinocchio as pin
from direct import Direct
from mimic_trees import FOOT, TRUNK, as_urdf, placed
from random_trees import RandomTree
from unoptimised import compiled

from psdmc.backends.c.package import PackageView, package_view
from psdmc.backends.info import EmitOptions, package_info
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.functions import RECIPES, SIGNATURES
from psdmc.lower import kernels, search
from psdmc.model.random_states import states_of
from psdmc.program.signature import Sizes
from psdmc.robot.coordinates import Coordinate
from psdmc.robot.load import LoadedRobot, load_robot_text
from psdmc.robot.mechanism import Mechanism
from psdmc.robot.reference import Reference, reference
from psdmc.robot.urdf.urdf_words import SPACE, STANDS_FOR_BALL
from psdmc.toolchain.call import CompiledRobot
from psdmc.toolchain.interface import interface_of
from psdmc.verification.check import with_passive_joints

Array = np.ndarray

FEWEST, MOST = 3, 8
"""Joints."""

KINDS, KIND_SHARES = "RPS", (0.6, 0.25, 0.15)
LIMB, FLOATING, SURFACE, ON_BASE = 0.6, 0.5, 0.35, 0.3
"""Shares: of bodies on the one drawn before, of floating robots, of contacts with 6 rows, of loops that end at the base."""

ROWS = (3, 3, 6, ["x", "z"], ["y"], ["x", "y", "rx", "ry"], ["x", "y", "z", "rx", "rz"])
"""Rows of loops."""

TRIES = 30
"""Drawings of a loop: psdmc refuses redundant rows by name."""

STATES = 16
"""Two for each set of active contacts, as there are at most three contacts."""

NEAR = 0.3
"""rad, m: standard deviation of the distance of a state from a configuration in which loops are closed."""

MU_FROM = 1e8
"""Condition number from which a state gets mu > 0: contacts and loops hold more motions than the robot has, or nearly."""

VALUE, SLOPE = 1e-10, 1e-8
PER_CONDITION = {VALUE: 1e2 * 2.2e-16, SLOPE: 1e4 * 2.2e-16}
"""Bounds of errors, of values and of derivatives. They are larger where these multiples of the condition number are."""

ALWAYS = (
    "constrained_forward_dynamics",
    "constrained_forward_dynamics_derivatives",
    "impulse",
    "impulse_derivatives",
)
IN_TURN = (
    ("delassus", "contact_jacobian", "loop_jacobian"),
    ("contact_space_inertia", "contact_drift", "loop_drift"),
    ("contact_inverse_dynamics", "loop_inverse_dynamics"),
    ("constrained_forward_dynamics_vjp",),
    ("constrained_forward_dynamics_jvp",),
    ("impulse_vjp", "impulse_jvp"),
    ("constrained_semi_implicit_euler", "loop_error"),
)

ZERO = 1e-4
"""Outputs below this share of a function's other outputs and of one in SI units, such as torques of passive joints, can be
rounding errors."""

BUDGET = 4
"""Programs that the search for cheap arrangements may trace."""


@dataclass(frozen=True, eq=False)
class ContactRobot:
    """The robot of a seed. `closed` is a configuration in which loops are closed."""

    seed: int
    loaded: LoadedRobot
    closed: Array
    kinds: str

    is_mixed = False

    @property
    def text(self) -> str:
        return self.loaded.source_text + "".join(f"\n<!-- {table} -->" for table in self.loaded.options.loops)

    @property
    def described(self) -> str:
        robot = self.loaded.mechanism
        loops = [len(loop.rows) for loop in robot.loops]
        return (
            f"joints {self.kinds}, {robot.nv} rates, parents {robot.parents}, contacts of {robot.rows_of_contacts} rows, "
            f"loops of {loops} rows{', floating' if robot.has_floating_base else ''}"
        )


@cache
def random_contact_robot(seed: int) -> ContactRobot:
    """The robot of a seed: nothing else decides it."""
    rng = np.random.default_rng([60, seed])
    n = int(rng.integers(FEWEST, MOST + 1))
    parents = tuple(k - 1 if rng.random() < LIMB else int(rng.integers(-1, k)) for k in range(n))
    kinds = "".join(rng.choice(list(KINDS), n, p=KIND_SHARES))
    floats = bool(rng.random() < FLOATING)
    tree = RandomTree(seed, parents, kinds)
    text = as_urdf(tree, [Coordinate(i) for i in range(n)])
    # A URDF has no ball joints: psdmc's own mark of those of MJCFs.
    text = text.replace('type="spherical">', f'type="{STANDS_FOR_BALL}"><ball xmlns="{SPACE}"/>')
    text = text.replace('<link name="base"/>', f'<link name="base">{TRUNK}</link>')
    text = text.replace("</robot>", "".join(FOOT.format(i=i) for i in range(n)) + "</robot>")
    feet = sorted(rng.permutation(n)[: int(rng.integers(1, 4))].tolist())
    contacts = [f"foot{i}:6" if rng.random() < SURFACE else f"foot{i}" for i in feet]
    load = partial(load_robot_text, text, "urdf", floating=floats, contacts=contacts)
    loaded: LoadedRobot = load()
    closed = states_of(loaded.mechanism, rng, 1)[0][0]
    tables: list[dict[str, Any]] = []
    wanted = int(rng.integers(0, 3))
    for _ in range(TRIES):
        if len(tables) == wanted:
            break
        more = [*tables, _loop(rng, reference(loaded, snapped=False).model, closed, n, floats)]
        try:
            loaded, tables = load(loops=more), more
            derive_model(loaded.mechanism, expand=False)
        except InputError:
            tables = more[:-1]
            loaded = load(loops=tables) if tables else load()
    return ContactRobot(seed, loaded, closed, kinds)


def _loop(rng: np.random.Generator, model: pin.Model, closed: Array, n: int, floats: bool) -> dict[str, Any]:
    """A loop between two links, or between the base, or the world of a floating robot, and a link."""
    data = model.createData()
    pin.framesForwardKinematics(model, data, closed)
    one, other = (f"link{i}" for i in rng.permutation(n)[:2])
    if rng.random() < ON_BASE:
        one = "universe" if floats else "base"
    turn = rng.normal(size=4)
    offset = pin.SE3(
        pin.Quaternion(turn / np.linalg.norm(turn)).toRotationMatrix(), rng.uniform(-0.3, 0.3, 3)
    )
    where = data.oMf[model.getFrameId(other)] * offset
    ends = {"first": placed(model, data, one, where), "second": placed(model, data, other, where)}
    return {"rows": ROWS[int(rng.integers(len(ROWS)))], **ends, "follows": []}


def contact_errors(robot: ContactRobot) -> dict[str, float]:
    """Errors relative to their bounds, by layout and function."""
    model = derive_model(robot.loaded.mechanism, expand=False)
    theirs = reference(with_passive_joints(model, robot.loaded), snapped=False)
    mechanism = model.mechanism
    given, conditions = _given(robot, theirs)
    names = [
        name
        for name in (*ALWAYS, *IN_TURN[robot.seed % len(IN_TURN)])
        if RECIPES[name].lack_of_loops(mechanism) is None
    ]
    with mock.patch.object(kernels, "Search", partial(search.Search, budget=BUDGET)):
        made = package_view(
            package_info(model, "robot"), kernels.lower(model, "factored", names), EmitOptions()
        )
    library = compiled(made, False)
    called, direct = CompiledRobot(interface_of(made), library), Direct(made, library)
    errors = {}
    for name in names:
        inputs = [given[q.name] for q in SIGNATURES[name].inputs]
        expected = RECIPES[name].pinocchio(theirs, given)
        least = SLOPE if name.endswith(("_derivatives", "_vjp", "_jvp")) else VALUE
        own = _of_base(robot, theirs, given) if name.endswith("inverse_dynamics") else conditions
        bounds = np.maximum(least, PER_CONDITION[least] * own)
        least_scale = ZERO * max(1.0, *(np.abs(values).max() for values in expected.values()))
        for layout, found in _layouts(made, called, direct, name, inputs):
            errors[f"contacts, {layout}, {name}"] = max(
                _error(values, found[output], bounds, least_scale) for output, values in expected.items()
            )
    return errors


def _given(robot: ContactRobot, theirs: Reference) -> tuple[dict[str, Array], Array]:
    """What functions read, and condition numbers of the dense systems."""
    rng, mechanism = np.random.default_rng([61, robot.seed]), robot.loaded.mechanism
    q, qd, tau = states_of(mechanism, rng, STATES)
    if mechanism.loops:
        start = np.tile(robot.closed, (STATES, 1))
        q = theirs.integrated(start, NEAR * rng.normal(size=qd.shape))
        q[-1] = robot.closed
    contacts = len(mechanism.contacts)
    active = ((np.arange(STATES)[:, None] >> np.arange(contacts)) & 1).astype(float)
    found = {"q": q, "qd": qd, "qd_before": qd, "tau": tau, "active": active, "mu": np.zeros(STATES)}
    found["qdd"] = rng.normal(size=qd.shape)
    conditions = _conditions(theirs, mechanism, found)
    found["mu"] = np.where(conditions < MU_FROM, 0.0, rng.uniform(0.1, 1.0, STATES))
    read = {q.name: q for name in (*ALWAYS, *sum(IN_TURN, ())) for q in SIGNATURES[name].inputs}
    sizes = Sizes.of(mechanism)
    drawn = {
        name: each.drawn(rng.uniform(-1.0, 1.0, (STATES, *sizes.shape(each.axes))))
        for name, each in read.items()
        if name not in found
    }
    return found | drawn, _conditions(theirs, mechanism, found)


def _jacobian(theirs: Reference, mechanism: Mechanism, given: dict[str, Array]) -> Iterator[Array]:
    """For each state, the rows of active contacts and of loops."""
    rows = RECIPES["contact_jacobian"].pinocchio(theirs, given)["J"]
    if mechanism.loops:
        rows = np.concatenate([rows, RECIPES["loop_jacobian"].pinocchio(theirs, given)["J"]], axis=1)
    on = np.repeat(given["active"], mechanism.rows_of_contacts, axis=1) > 0.0
    on = np.pad(on, ((0, 0), (0, rows.shape[1] - on.shape[1])), constant_values=True)
    return (own[mask] for own, mask in zip(rows, on, strict=True))


def _conditions(theirs: Reference, mechanism: Mechanism, given: dict[str, Array]) -> Array:
    """Condition numbers of the dense systems, scaled to ones on the diagonals of M and of J M^-1 J^T."""
    found, masses = [], theirs.mass_matrix(given["q"])
    for mass, rows, mu in zip(masses, _jacobian(theirs, mechanism, given), given["mu"], strict=True):
        scale = 1.0 / np.sqrt(np.diag(mass))
        own = rows * scale
        sizes = np.linalg.norm(own, axis=1)
        sizes = np.where(sizes > 0.0, sizes, 1.0)
        own = own / sizes[:, None]
        shift = mu * np.diag(1.0 / sizes**2)
        found.append(
            np.linalg.cond(np.block([[mass * np.outer(scale, scale), -own.T], [own, shift]]))
            if len(own)
            else np.linalg.cond(mass * np.outer(scale, scale))
        )
    return np.array(found)


def _of_base(robot: ContactRobot, theirs: Reference, given: dict[str, Array]) -> Array:
    """Condition numbers of the equations of inverse dynamics, without singular values that count as zero."""
    found, mechanism = [], robot.loaded.mechanism
    for rows in _jacobian(theirs, mechanism, given):
        parts = [rows[:, :6]] if mechanism.has_floating_base else []
        if theirs.passive:
            parts.append(rows[-sum(map(len, mechanism.rows_of_loops)) :][:, list(theirs.passive)])
        values = [np.linalg.svd(part, compute_uv=False) for part in parts if part.size]
        kept = [own[own > 1e-8 * own[0]] for own in values]
        found.append(np.prod([own[0] / own[-1] for own in kept]) if kept else 1.0)
    return np.array(found)


def _layouts(
    made: PackageView, called: CompiledRobot, direct: Direct, name: str, inputs: Sequence[Array]
) -> Iterator[tuple[str, dict[str, Array]]]:
    """The outputs of C: for one state at a time, for many, in lanes, and of Python's call, (STATES, ...)."""
    kernel = next(kernel for kernel in made.kernels if kernel.name == name)
    flat = [np.ascontiguousarray(array.reshape(STATES, -1)) for array in inputs]
    one, rows = ({out.name: np.zeros((STATES, out.size)) for out in kernel.outputs} for _ in range(2))
    for k in range(STATES):
        direct(name, *(array[k] for array in flat), *(array[k] for array in one.values()))
    yield "one state", one
    if f"{name}_batch" in _symbols(kernel):
        direct(f"{name}_batch", STATES, *flat, *rows.values())
        yield "rows", rows
    if f"{name}_batch_soa" in _symbols(kernel):
        lanes, blocks = made.lanes, -(-STATES // made.lanes)
        laid = [
            np.ascontiguousarray(
                np.resize(array, (blocks * lanes, array.shape[1]))
                .reshape(blocks, lanes, -1)
                .transpose(0, 2, 1)
            )
            for array in flat
        ]
        soa = {out.name: np.zeros((blocks, out.size, lanes)) for out in kernel.outputs}
        direct(f"{name}_batch_soa", STATES, *laid, *soa.values())
        yield (
            "lanes",
            {
                key: array.transpose(0, 2, 1).reshape(blocks * lanes, -1)[:STATES]
                for key, array in soa.items()
            },
        )
    found = called.call(SIGNATURES[name], list(inputs), None)
    values = [found] if len(kernel.outputs) == 1 else list(found)
    yield "batch", dict(zip((out.name for out in kernel.outputs), map(np.asarray, values), strict=True))


def _symbols(kernel: Any) -> str:
    return " ".join(prototype.text for prototype in kernel.prototypes.values())


def _error(expected: Array, found: Array, bounds: Array, least_scale: float) -> float:
    """The largest error of any state relative to its bound and to its largest value, or to that of half of the states, or to
    `least_scale`. NaN if there is no number."""
    expected = expected.reshape(STATES, -1)
    sizes = np.abs(expected).max(axis=1, initial=0.0)
    scale = np.maximum(sizes, max(np.median(sizes), least_scale))
    errors = np.abs(found.reshape(expected.shape) - expected).max(axis=1, initial=0.0)
    return float((errors / scale / bounds).max())
