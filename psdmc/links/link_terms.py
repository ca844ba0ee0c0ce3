"""Constraints and costs that keep links physically possible in a fit. These are positive definite pseudo-inertias,
positive drive inertias, and a small distance from the bodies in the robot file."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np

from psdmc.errors import InputError
from psdmc.links.link_bodies import flat_rows, held_rows, pseudo_inertia, reference_body, vanishes
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, Array


@dataclass(frozen=True, slots=True)
class PhysicalOptions:
    """Bounds of the physically consistent fit, and weights of the distance from the bodies in the robot file.

    smallest        smallest eigenvalue of each link's pseudo-inertia, in kg, with lengths in units of 0.1 m
    smallest_drive  smallest value of each drive inertia that is a parameter, kg m^2
    known_body      weight of the distance (divergence) from the file's body, if the file has one. The divergence
                    compares two distributions of mass and does not depend on unit or frame (Lee, Wensing, Park 2020)
    unknown_body    weight of the distance from an ordinary body if the file has none: enough to keep the pseudo-inertia
                    positive definite
    """

    smallest: float = 1e-6
    smallest_drive: float = 1e-4
    known_body: float = 1.0
    unknown_body: float = 1e-2


def known_inner(model: DynamicsModel) -> Array:
    """Return the coordinates of the file's standard parameters in the basis `parameter_span`, which the assumptions
    allow. Unknown parameters count as zero."""
    span = model.mechanism.parameter_span
    known = np.nan_to_num(model.mechanism.parameters.reshape(-1))
    return np.asarray(np.linalg.lstsq(span, known, rcond=None)[0])


def link_terms(
    cp: Any, model: DynamicsModel, x: Any, link: int, options: PhysicalOptions
) -> tuple[list[Any], Any]:
    """Return the constraints for one link in a fit, and the weighted divergence (distance between distributions of
    mass) from the body in the robot file.

    The constraints keep the pseudo-inertia and the drive inertia above their bounds. A link that is assumed massless
    has no divergence, and only the constraint of the drive inertia.
    """
    start = PARAMETERS_PER_LINK * link
    span: Array = model.mechanism.parameter_span
    constraints: list[Any] = []
    if np.any(span[start + 10]):
        constraints.append(x[start + 10] >= options.smallest_drive)
    if not np.any(span[start]):
        return constraints, 0.0
    held = held_rows(span, start)
    body = cp.bmat(pseudo_inertia([x[start + k] for k in range(10)]))
    constraints += [body[k, :] == 0 for k in flat_rows(span, start) if not vanishes(span, start, k)]
    block = body[held, :][:, held] if len(held) < 4 else body
    near, is_known = reference_body(model.mechanism.parameters[link], held)
    weight = options.known_body if is_known else options.unknown_body
    divergence = cp.trace(np.linalg.inv(near) @ block) - cp.log_det(block)
    return [*constraints, block >> options.smallest * np.eye(len(held))], weight * divergence


def require_cvxpy() -> Any:
    """Return the module cvxpy. Raises InputError with the remedy if cvxpy or its solver is not installed."""
    missing = [name for name in ("cvxpy", "clarabel") if find_spec(name) is None]
    if missing:
        raise InputError(
            f"physical consistency needs {' and '.join(missing)}, not installed here",
            "pip install 'psdmc[calibrate]', or see the unconstrained fit with --no-physical",
        )
    return import_module("cvxpy")
