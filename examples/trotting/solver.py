"""OSQP's C code for the controller's quadratic programme: its pattern, weights and settings, as files to compile."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import osqp
from scipy import sparse

import psdmc

LINEAR, ANGULAR, JOINTS, FORCE = 1.0, 1.0, 1e-6, 1e-3
"""Weights of the base's accelerations ((m/s^2)^-2, (rad/s^2)^-2), of the joints', and of forces in quarters of the weight:
small ones only choose among what moves the base equally well."""
MOST_ITERATIONS = 1000
"""A call ends after some 2 ms; what is not solved by then is not used."""
TOLERANCE = 1e-5
ROOT, JOINT_COUNT, FEET = 6, 12, 4
RATES, FORCES = ROOT + JOINT_COUNT, 3 * FEET

Array = np.ndarray


def write_solver(model: psdmc.DynamicsModel, folder: Path) -> None:
    """OSQP's sources and workspace, and `qp_pattern.h`: the places of A's entries in OSQP's order, and the weights."""
    rng = np.random.default_rng(0)
    pattern = sparse.csc_matrix(rows_of(model, rng) != 0.0, dtype=np.float64)
    weights = np.repeat([LINEAR, ANGULAR, JOINTS, FORCE], [3, 3, JOINT_COUNT, FORCES])
    solver = osqp.OSQP()
    solver.setup(
        sparse.diags(weights, format="csc"),
        np.zeros(RATES + FORCES),
        pattern,
        -np.ones(pattern.shape[0]),
        np.ones(pattern.shape[0]),
        verbose=False,
        eps_abs=TOLERANCE,
        eps_rel=TOLERANCE,
        max_iter=MOST_ITERATIONS,
        check_termination=10,
    )
    solver.codegen(str(folder), parameters="matrices", prefix="qp_", extension_name=None, force_rewrite=True)
    columns = np.repeat(np.arange(RATES + FORCES), np.diff(pattern.indptr))
    (folder / "qp_pattern.h").write_text(
        f"enum {{ QP_ENTRIES = {pattern.nnz} }};\n"
        f"static const unsigned char qp_rows[QP_ENTRIES] = {{{_listed(pattern.indices)}}};\n"
        f"static const unsigned char qp_columns[QP_ENTRIES] = {{{_listed(columns)}}};\n"
        f"static const double qp_weights[{RATES + FORCES}] = {{{_listed(weights)}}};\n"
    )


def rows_of(model: psdmc.DynamicsModel, rng: np.random.Generator) -> Array:
    """The QP's rows at a random state, as controller.c orders them; their zeros are zero in all states."""
    q = rng.uniform(-1.0, 1.0, (1, model.nq))
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7])
    mass = model.mass_matrix(q)[0]
    jacobians = np.concatenate(list(model.frame_jacobian(q)[0][:, :3]))
    dynamics = np.hstack([mass, -jacobians.T])
    feet = np.hstack([jacobians, np.zeros((FORCES, FORCES))])
    cone = np.array([[1, 0, -1], [1, 0, 1], [0, 1, -1], [0, 1, 1]])
    cones, load = np.kron(np.eye(FEET), cone), np.kron(np.eye(FEET), [[0, 0, 1]])
    forces = np.vstack([cones, load])
    forces = np.hstack([np.zeros((len(forces), RATES)), forces])
    return np.vstack([dynamics[:ROOT], feet, forces, dynamics[ROOT:]])


def _listed(values: Array) -> str:
    return ", ".join(map(repr, values.tolist()))
