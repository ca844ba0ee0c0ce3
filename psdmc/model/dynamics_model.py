"""MODEL: inverse dynamics as functions times constants, and everything known about where it came from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from psdmc.model import equations, evaluate, payload
from psdmc.robot.chain import PARAMETERS_PER_LINK, Chain, Placement, frozen_array

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class DynamicsModel:
    """Inverse dynamics as functions times constants: tau[i] = y(state) @ P[i] @ theta_b.

    n joints, p functions, l base parameters.

    E            (5n, p) uint8   exponents; row blocks q, sin q, cos q, qd, qdd; None where derived with
    --no-expand
    P            n x (p, l)      sparse reduction matrices (csr), one per joint; None with E
    theta_b      (l,) float      base parameters, SI, units per entry; None while unknown
    B            (l, 11n) float  theta_b = B @ x for standard parameters x within the chain's parameter_span
    chain        the robot: joints, link frames, gravity, limits, standard parameters
    certificate  (n,)            largest torque error against Newton-Euler on fresh samples, per joint,
    relative to that
                                 joint's largest torque there
    provenance   plain JSON values: source text, its hash and format, options, snapping and its effect,
    tolerances
    """

    E: NDArray[np.uint8] | None
    P: tuple[sparse.csr_array, ...] | None
    theta_b: Array | None
    B: Array
    chain: Chain
    certificate: Array
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n, l = len(self.chain), np.asarray(self.B).shape[0]
        object.__setattr__(self, "B", frozen_array(self.B, (l, PARAMETERS_PER_LINK * n), "B"))
        object.__setattr__(self, "certificate", frozen_array(self.certificate, (n,), "certificate"))
        if self.theta_b is not None:
            object.__setattr__(self, "theta_b", frozen_array(self.theta_b, (l,), "theta_b"))
        if (self.E is None) != (self.P is None):
            raise ValueError("E and P are given together or not at all")
        if self.E is None or self.P is None:
            return
        exponents = np.array(self.E, dtype=np.uint8)
        if exponents.ndim != 2 or exponents.shape[0] != 5 * n:
            raise ValueError(f"E has shape {exponents.shape}, expected ({5 * n}, p)")
        exponents.setflags(write=False)
        object.__setattr__(self, "E", exponents)
        expected = (exponents.shape[1], l)
        if len(self.P) != n or any(matrix.shape != expected for matrix in self.P):
            raise ValueError(f"P has {len(self.P)} matrices, expected {n} of shape {expected}")

    @property
    def joint_names(self) -> tuple[str, ...]:
        return self.chain.joint_names

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.chain)

    @property
    def l(self) -> int:  # noqa: E743  the paper's letter
        """Number of base parameters."""
        return int(self.B.shape[0])

    @property
    def p(self) -> int | None:
        """Number of functions; None where they were not expanded."""
        return None if self.E is None else int(self.E.shape[1])

    @property
    def pivots(self) -> tuple[int, ...]:
        """For each base parameter the first standard parameter (index into x) that enters it alone, and as
        itself."""
        is_alone = (self.B != 0.0).sum(axis=0) == 1
        return tuple(int(np.flatnonzero(is_alone & (row == 1.0))[0]) for row in self.B)

    @property
    def representative(self) -> Array:
        """(11n, l) standard parameters from base parameters, within the chain's parameter_span.

        Each base parameter sits on its pivot, the first column of B that belongs to it alone; the span's
        other coordinates are zero. B @ representative = 1.
        """
        leads = np.argmax(self.chain.parameter_span != 0.0, axis=0)
        column_of = {int(row): column for column, row in enumerate(leads)}
        return frozen_array(
            self.chain.parameter_span[:, [column_of[pivot] for pivot in self.pivots]],
            (PARAMETERS_PER_LINK * self.n, self.l),
            "representative",
        )

    def inverse_dynamics(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
        """tau (..., n), N m or N, straight from E, P and theta_b: slow and obvious, the reference."""
        return evaluate.inverse_dynamics(self, q, qd, qdd)

    def regressor(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
        """Y (..., n, l) with tau = Y theta_b."""
        return evaluate.regressor(self, q, qd, qdd)

    def mass_matrix(self, q: ArrayLike) -> Array:
        """M(q), (..., n, n)."""
        return evaluate.mass_matrix(self, q)

    def nonlinear_effects(self, q: ArrayLike, qd: ArrayLike) -> Array:
        """h(q, qd) = C(q, qd) qd + g(q), (..., n)."""
        return evaluate.nonlinear_effects(self, q, qd)

    def gravity(self, q: ArrayLike) -> Array:
        """g(q), (..., n)."""
        return evaluate.gravity(self, q)

    @property
    def base_parameters(self) -> tuple[equations.BaseParameter, ...]:
        """Equation, unit and value of each entry of theta_b."""
        return equations.base_parameters(self)

    @property
    def content_hash(self) -> str:
        """SHA-256 of everything that a model file holds."""
        from psdmc.model.store import content_hash  # the store builds models: it cannot be imported first

        return content_hash(self)

    def save(self, path: str | Path) -> None:
        """Write a model file; see psdmc.model.store."""
        from psdmc.model.store import save

        save(self, path)

    def with_payload(
        self,
        mass: float,
        com: ArrayLike,
        inertia: ArrayLike | None = None,
        frame: Placement | str | None = None,
    ) -> DynamicsModel:
        """The model with a rigid load on its last link; see psdmc.model.payload."""
        return payload.with_payload(self, mass, com, inertia, frame)
