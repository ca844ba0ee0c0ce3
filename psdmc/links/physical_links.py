"""Finds link masses and inertias that have given base parameters exactly and are nearest to those of the robot file.
Programs that read links, and not base parameters, need these masses and inertias."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from psdmc.dynamics.parameters import inertia_matrix, second_moments
from psdmc.errors import InputError
from psdmc.links.log_det import Block, nearest_definite
from psdmc.links.pseudo_inertias import (
    PhysicalOptions,
    flat_equations,
    held_rows,
    known_inner,
    link_terms,
    pseudo_inertia,
    reference_body,
    require_cvxpy,
)
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import states_of
from psdmc.robot.mechanism import BODY_PARAMETERS, DRIVE, PARAMETERS_PER_LINK, Array

OPEN = PhysicalOptions(smallest=0.0, smallest_drive=0.0)
"""Links may be as small as they like: the divergence keeps them off the boundary."""
BELONGS = 1e-12
"""Share of the largest base parameter by which B x may differ from theta_b where the file's own links are taken."""
LEAST_SHARE = 1e-12
"""Smallest eigenvalue of a pseudo-inertia, as a share of its largest diagonal entry, that is no rounding: lengths are in
units of the link's own gyration, so a plate of a thousandth of its width has 1e-6."""
BODY_SHARE = 1e-9
"""The same from which a link counts as a body: flatter ones have no finite divergence."""
RESEMBLED = 1e-6
"""The same from which the file's body is what a link should resemble as it is: published ones may be bodies by rounding
alone."""
FLAT = 1e-12
"""Entries of a pseudo-inertia, as a share of its largest, that count as zero where a link has no extent."""
SMALL_DRIVE = 1e-4
"""kg m^2 (kg): what a drive inertia should resemble that the file does not state, the least that the physical fit gives
one."""
EDGE = 1e-8
"""Distance below which base parameters are those of links on the boundary: the solver's accuracy."""
STATES, SEED = 200, 77_011
"""Random states over which torques of two sets of base parameters are compared."""


class NoSuchLinks(InputError):
    """This error says that no physically possible masses and inertias of the links have the given base parameters.

    distance  smallest difference of torques that possible links can reach: root mean square over random states, as a
              share of each joint's largest torque
    """

    def __init__(self, message: str, hint: str, distance: float) -> None:
        super().__init__(message, hint)
        self.distance = distance


@dataclass(frozen=True, slots=True, eq=False)
class PhysicalLinks:
    """Standard parameters of links that have the base parameters of the model.

    parameters  (n, 11)  standard parameters about the link frames: B @ parameters = theta_b
    divergence  (n,)  distance of each link from the link in the robot file, tr(P0^-1 P) - log det(P0^-1 P) - 4, with
                      the pseudo-inertias P and P0 (0: equal); NaN if the file does not give the link, or if P or P0 is
                      singular
    """

    parameters: Array
    divergence: Array


def physical_links(model: DynamicsModel) -> PhysicalLinks:
    """Return the standard parameters of links that have the model's theta_b and are nearest to those of the robot file.

    The distance is the sum of the divergences (differences between two distributions of mass) of all links (Lee,
    Wensing, Park 2020). The physically consistent fit uses this distance, too. All pseudo-inertias of the result are
    positive definite, and no drive inertia is negative. If the links of the file fulfil this and have theta_b, they are
    returned unchanged.

    Raises InputError if theta_b is unknown, NoSuchLinks if no such links exist.
    """
    theta = model.known_theta_b()
    own = model.mechanism.parameters
    is_own = _belong(model, own, theta)
    if is_own and _are_physical(own) and all(map(_is_body, own)):
        return PhysicalLinks(np.array(own), _divergences(model, own))
    x = _nearest(model, theta)
    if x is None and is_own and _are_physical(own):
        x = np.array(own)  # points and rods that no body with extent can stand for
    if x is None:
        raise _none_such(model, theta)
    return PhysicalLinks(x, _divergences(model, x))


def _belong(model: DynamicsModel, x: Array, theta: Array) -> bool:
    if np.isnan(x).any():
        return False
    size = max(float(np.abs(theta).max(initial=0.0)), float(np.finfo(float).tiny))
    return bool(np.abs(model.B @ x.reshape(-1) - theta).max(initial=0.0) <= BELONGS * size)


def _nearest(model: DynamicsModel, theta: Array) -> Array | None:
    """(n, 11) the solution; None where there is none."""
    span = model.mechanism.parameter_span
    rows, sides = _equations(model, theta)
    # The point nearest to the file's that fulfils the equations, and directions in which they stay fulfilled.
    _, values, axes = np.linalg.svd(rows)
    rank = int(np.sum(values > np.finfo(float).eps * max(rows.shape) * values.max(initial=0.0)))
    start, free = _corrected(rows, sides, known_inner(model)), axes[rank:].T
    z = nearest_definite(_blocks(model, span @ start, span @ free), np.zeros(free.shape[1]))
    if z is None:
        return None
    x = (span @ _corrected(rows, sides, start + free @ z)).reshape(-1, PARAMETERS_PER_LINK)
    return x if _are_physical(x) and _belong(model, x, theta) else None


def _blocks(model: DynamicsModel, start: Array, free: Array) -> list[Block]:
    """Every link's pseudo-inertia and drive inertia as functions of the free coordinates z: x = start + free z."""
    found = []
    span = model.mechanism.parameter_span
    for link, known in enumerate(model.mechanism.parameters):
        first = PARAMETERS_PER_LINK * link
        held = held_rows(span, first)
        if np.any(span[first]) and held:
            own = slice(first, first + BODY_PARAMETERS)
            constant = np.array(pseudo_inertia(start[own].tolist()))[np.ix_(held, held)]
            slopes = [np.array(pseudo_inertia(row))[np.ix_(held, held)] for row in free[own].T.tolist()]
            near, is_known = _resembled(known, held)
            weight = OPEN.known_body if is_known else OPEN.unknown_body
            found.append(Block(constant, np.reshape(slopes, (-1, len(held), len(held))), near, weight))
        drive = first + DRIVE
        if np.any(span[drive]):
            usual = float(known[DRIVE]) if known[DRIVE] > SMALL_DRIVE else SMALL_DRIVE
            turning = free[drive].reshape(-1, 1, 1)
            found.append(Block(start[drive].reshape(1, 1), turning, np.full((1, 1), usual), 1.0))
    return found


def _resembled(link: Array, held: list[int]) -> tuple[Array, bool]:
    """Return what a link should resemble: the file's body if it can exist, else what the physical fit takes for it."""
    if np.isfinite(link).all() and _is_body(link) and _least_share(link) > RESEMBLED:
        return np.array(pseudo_inertia(link[:BODY_PARAMETERS].tolist()))[np.ix_(held, held)], True
    return reference_body(link, held)


def _equations(model: DynamicsModel, theta: Array) -> tuple[Array, Array]:
    """Rows and right sides that the span's coordinates fulfil: theta_b, and no extent where a link is assumed flat."""
    span = model.mechanism.parameter_span
    flat = [
        row @ span
        for link in range(len(model.mechanism))
        for row in flat_equations(span, PARAMETERS_PER_LINK * link)
    ]
    return np.vstack([model.B @ span, *flat]), np.concatenate([theta, np.zeros(len(flat))])


def _corrected(rows: Array, sides: Array, inner: Array) -> Array:
    """The nearest point that fulfils the equations to rounding: what a solver leaves of them is taken off again."""
    for _ in range(3):
        inner = inner + np.linalg.lstsq(rows, sides - rows @ inner, rcond=None)[0]
    return np.asarray(inner)


def _solved(cp: Any, problem: Any) -> bool:
    with warnings.catch_warnings():  # cvxpy warns of reduced accuracy; the result is checked
        warnings.simplefilter("ignore", UserWarning)
        try:
            problem.solve(solver=cp.CLARABEL)
        except cp.error.SolverError:
            return False
    return problem.status in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE)


def moments(link: Array) -> Array:
    """Return a link's 4 x 4 pseudo-inertia in kg and m, from its standard parameters: integrals over the mass of the
    products of x, y, z and 1."""
    matrix = np.zeros((4, 4))
    matrix[:3, :3] = second_moments(inertia_matrix(link))
    matrix[:3, 3] = matrix[3, :3] = link[1:4]
    matrix[3, 3] = link[0]
    return matrix


def _are_physical(x: Array) -> bool:
    """Whether no pseudo-inertia has a negative eigenvalue, beyond rounding, in units of the link's own size, and no drive
    inertia is negative. Links whose file assumes extents away are flat."""
    return bool((x[:, DRIVE] >= 0.0).all()) and all(_least_share(link) >= -LEAST_SHARE for link in x)


def _least_share(link: Array) -> float:
    """Smallest eigenvalue of a link's pseudo-inertia whose diagonal is scaled to ones. A row without extent counts as
    negative where it has other entries."""
    matrix = moments(link)
    least = FLAT * float(np.abs(matrix).max())
    held = np.diag(matrix) > least
    if np.abs(matrix[~held]).max(initial=0.0) > least:
        return -1.0
    size = np.sqrt(np.diag(matrix)[held])
    scaled = matrix[np.ix_(held, held)] / np.outer(size, size)
    return float(np.linalg.eigvalsh(scaled)[0]) if held.any() else 0.0


def _is_body(link: Array) -> bool:
    """Whether a link has mass and extent in every direction, beyond rounding."""
    return bool((np.diag(moments(link)) > 0.0).all()) and _least_share(link) > BODY_SHARE


def _divergences(model: DynamicsModel, x: Array) -> Array:
    found = np.full(len(x), np.nan)
    for k, (known, link) in enumerate(zip(model.mechanism.parameters, x, strict=True)):
        if np.isnan(known[:BODY_PARAMETERS]).any():
            continue
        if np.array_equal(known[:BODY_PARAMETERS], link[:BODY_PARAMETERS]):
            found[k] = 0.0
        elif _is_body(known) and _is_body(link):
            ratio = np.linalg.solve(moments(known), moments(link))
            found[k] = max(0.0, float(np.trace(ratio) - np.linalg.slogdet(ratio)[1] - 4.0))
    return found


def _none_such(model: DynamicsModel, theta: Array) -> NoSuchLinks:
    """The refusal, with how far the nearest base parameters are that physical links have."""
    cp = require_cvxpy()
    rows, largest = _torque_rows(model, theta)
    x = cp.Variable(model.mechanism.parameter_span.shape[1])
    flat = model.mechanism.parameter_span @ x
    constraints = [c for k in range(len(model.mechanism)) for c in link_terms(cp, model, flat, k, OPEN)[0]]
    weight = np.linalg.qr(rows, mode="r")
    problem = cp.Problem(cp.Minimize(cp.norm(weight @ (model.B @ flat - theta))), constraints)
    name = model.mechanism.name
    hint = "calibrate without --no-physical, or correct the file's masses and inertias"
    if not _solved(cp, problem) or x.value is None:
        return NoSuchLinks(f"{name!r}: no physical links have its theta_b", hint, float("nan"))
    near = model.B @ model.mechanism.parameter_span @ np.asarray(x.value)
    errors = (rows @ (near - theta)).reshape(-1, model.nv)
    distance = float(np.sqrt(np.mean(errors**2)))
    joint = int(np.argmax(np.abs(errors).max(axis=0)))
    worst = model.joint_names[model.mechanism.rate_joints[joint]]
    entry = int(np.argmax(np.abs(near - theta) * np.linalg.norm(rows, axis=0)))
    if distance < EDGE:
        return NoSuchLinks(
            f"{name!r}: only links on the edge of what is physical, flat or without mass, have its theta_b: the nearest "
            f"differ by {distance:.2g} of the joints' largest torques",
            hint,
            distance,
        )
    return NoSuchLinks(
        f"{name!r}: no physical links have its theta_b: the nearest that some have changes torques by {distance:.2g} of "
        f"the joints' largest (root of the mean square over {STATES} random states), by up to "
        f"{np.abs(errors[:, joint]).max():.2g} at joint {worst!r} ({largest[joint]:.3g} N m), most of it by "
        f"{model.base_parameters.labels[entry]} = {near[entry]:.4g} instead of {theta[entry]:.4g}",
        hint,
        distance,
    )


def _torque_rows(model: DynamicsModel, theta: Array) -> tuple[Array, Array]:
    """The regressor at random states (states nv, l), each joint in units of its largest torque; and that torque (nv,)."""
    states = states_of(model.mechanism, np.random.default_rng(SEED), STATES)
    regressor = model.regressor(*states)
    torque = np.abs(regressor @ theta).max(axis=0)
    floor = max(1e-9 * float(torque.max(initial=0.0)), float(np.finfo(float).tiny))
    largest = np.where(torque > floor, torque, max(float(torque.max(initial=0.0)), floor))
    return (regressor / largest[:, None]).reshape(-1, model.l), largest
