"""MODEL: inverse dynamics as monomials times constants, and everything known about where it came from."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from psdmc.errors import InputError
from psdmc.model import bodies, equations, evaluate, glance, payload, recursive, store, symbolic
from psdmc.model.answers import Answers
from psdmc.model.calibrated import Calibrated
from psdmc.model.expansion import Expansion
from psdmc.model.parameter_table import BaseParameters
from psdmc.real_arrays import real_array
from psdmc.reproducible import times
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, Mechanism, Placement, frozen_array, made_again
from psdmc.robot.zeros import leading_rows

if TYPE_CHECKING:
    import sympy
    from scipy import sparse

Array = NDArray[np.float64]

RENAMED = (
    "standard_parameters() has been renamed equivalent_parameters(); the old name still works for now. "
    "From masses, coms and inertias to theta_b: theta_for(...)"
)


@dataclass(frozen=True, slots=True, weakref_slot=True, eq=False)
class DynamicsModel(Answers):
    """Inverse dynamics as monomials times constants: tau[i] = y(state) @ P[i] @ theta_b.

    n joints, p monomials, l base parameters. Functions that are not below, such as forward_dynamics, are those of compiled
    robots (psdmc.functions), in NumPy.

    expansion    E and P; None where derived with --no-expand
    theta_b      (l,) float      base parameters, SI, units per entry; None while unknown
    B            (l, 11n) float  theta_b = B @ x for standard parameters x within the chain's parameter_span
    mechanism    the robot: joints, link frames, gravity, limits, standard parameters
    certificate  (nv,)           largest torque error against Newton-Euler on fresh samples, per rate of the joints,
                                 relative to that rate's largest torque there
    provenance   plain JSON values: source text, its hash and format, options, snapping and its effect, tolerances
    calibrated   what a calibration found; None: not calibrated
    """

    expansion: Expansion | None
    theta_b: Array | None
    B: Array
    mechanism: Mechanism
    certificate: Array
    provenance: Mapping[str, Any] = field(default_factory=dict)
    calibrated: Calibrated | None = None

    __reduce__ = made_again

    def __post_init__(self) -> None:
        n, l = len(self.mechanism), np.asarray(self.B).shape[0]
        object.__setattr__(self, "B", frozen_array(self.B, (l, PARAMETERS_PER_LINK * n), "B"))
        object.__setattr__(self, "certificate", frozen_array(self.certificate, (self.nv,), "certificate"))
        if self.theta_b is not None:
            object.__setattr__(self, "theta_b", frozen_array(self.theta_b, (l,), "theta_b"))
        if self.expansion is not None and (self.expansion.n, self.expansion.l) != (n, l):
            raise ValueError(
                f"E and P are for {self.expansion.n} joints and {self.expansion.l} base parameters, "
                f"expected {n} and {l}"
            )

    def __repr__(self) -> str:
        return glance.text(self)

    def _repr_html_(self) -> str:
        return glance.html(self)

    def _repr_latex_(self) -> str:
        return self.base_parameters._repr_latex_()

    @property
    def chain(self) -> Mechanism:
        """The mechanism, by its name in psdmc 0.1."""
        return self.mechanism

    @property
    def joint_names(self) -> tuple[str, ...]:
        return self.mechanism.joint_names

    @property
    def link_names(self) -> tuple[str, ...]:
        """n names: the link that moves with each joint, and with all that is fixed to it is a body."""
        return tuple(joint.link_name for joint in self.mechanism.joints)

    @property
    def q_names(self) -> tuple[str, ...]:
        """nq names of q's entries: a joint's own, or 'root_joint.x' and so on where it has several coordinates."""
        return self.mechanism.q_names

    @property
    def v_names(self) -> tuple[str, ...]:
        """nv names of the entries of rates, accelerations and torques: a joint's own, or 'root_joint.vx' and so on."""
        return self.mechanism.v_names

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Names of the frames that kinematic functions are about."""
        return tuple(frame.name for frame in self.mechanism.frames)

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.mechanism)

    @property
    def nq(self) -> int:
        """Length of q."""
        return self.mechanism.nq

    @property
    def nv(self) -> int:
        """Length of qd, qdd and tau."""
        return self.mechanism.nv

    @property
    def l(self) -> int:  # noqa: E743  the paper's letter
        """Number of base parameters."""
        return int(self.B.shape[0])

    @property
    def E(self) -> NDArray[np.uint8] | None:
        """(5n, p) exponents of the monomials; None where they were not expanded."""
        return None if self.expansion is None else self.expansion.E

    @property
    def P(self) -> tuple[sparse.csr_array, ...] | None:
        """n sparse reduction matrices (p, l), one per joint; None with E."""
        return None if self.expansion is None else self.expansion.P

    @property
    def p(self) -> int | None:
        """Number of monomials; None where they were not expanded."""
        return None if self.expansion is None else self.expansion.p

    @property
    def pivots(self) -> tuple[int, ...]:
        """For each base parameter the first standard parameter (index into x) that only this base parameter contains,
        with factor one."""
        return tuple(int(np.flatnonzero(row)[0]) for row in self._leads)

    @property
    def is_reduced(self) -> bool:
        """Whether every base parameter has such a pivot, as those from the derivation do."""
        return bool(self._leads.any(axis=1).all())

    @property
    def _leads(self) -> NDArray[np.bool_]:
        """(l, 11n) true where a standard parameter is contained in one base parameter alone, with factor one."""
        is_alone = (self.B != 0.0).sum(axis=0) == 1
        return np.asarray(is_alone & (self.B == 1.0))

    @property
    def representative(self) -> Array:
        """(11n, l) standard parameters from base parameters, within the chain's parameter_span.

        Each base parameter is placed on its pivot; the span's other coordinates are zero. B @ representative = 1.
        """
        leads = leading_rows(self.mechanism.parameter_span)
        column_of = {int(row): column for column, row in enumerate(leads)}
        return frozen_array(
            self.mechanism.parameter_span[:, [column_of[pivot] for pivot in self.pivots]],
            (PARAMETERS_PER_LINK * self.n, self.l),
            "representative",
        )

    def expanded(self) -> Expansion:
        """E and P; InputError where the model has none."""
        if self.expansion is None:
            raise InputError("this model was derived without E and P", "derive it again without --no-expand")
        return self.expansion

    def known_theta_b(self) -> Array:
        """theta_b; InputError while it is unknown."""
        if self.theta_b is None:
            raise InputError(
                f"the base parameters of '{self.mechanism.name}' are unknown",
                "calibrate, or give all inertias",
            )
        return self.theta_b

    @property
    def unknown_base_parameters(self) -> tuple[int, ...]:
        """Indices of the base parameters that contain an unknown standard parameter; none where theta_b is known."""
        if self.theta_b is not None:
            return ()
        is_unknown = np.isnan(self.mechanism.parameters.reshape(-1))
        return tuple(k for k, row in enumerate(self.B) if np.any(row[is_unknown]))

    @property
    def file_theta_b(self) -> Array | None:
        """(l,) theta_b; while it is unknown what links of known inertia add to it, None where there is no such link."""
        if self.theta_b is not None:
            return self.theta_b
        known = self.mechanism.known_parameters
        if not np.isnan(self.mechanism.parameters).any() or not known.any():
            return None
        return np.asarray(times(self.B, known.reshape(-1)))

    def equivalent_parameters(self) -> Array:
        """(11n,) standard parameters that have the model's theta_b: `representative @ theta_b`, one choice of many. They
        are not the links' own, and belong to no rigid bodies."""
        found: Array = times(self.representative, self.known_theta_b())
        return found

    def standard_parameters(self) -> Array:
        """`equivalent_parameters`, by its name in psdmc 0.1."""
        warnings.warn(RENAMED, DeprecationWarning, stacklevel=2)
        return self.equivalent_parameters()

    def theta_for(
        self,
        masses: ArrayLike,
        coms: ArrayLike,
        inertias: ArrayLike,
        drive_inertias: ArrayLike | None = None,
    ) -> Array:
        """(l,) base parameters of a robot with these bodies and the model's kinematics: `theta_b=` of its functions.

            masses          (n,) kg, a body for each joint in the order of `link_names`: the link and all that is fixed to it
            coms            (n, 3) m, centres of mass in the link frames
            inertias        (n, 3, 3) kg m^2 about the centres of mass, along the link frames' axes
            drive_inertias  (n,) kg m^2 (kg where a joint slides); None: the model's own

        Raises InputError for numbers that are not finite or outside the ranges of robot files, and for a negative mass.
        InputError also if an inertia is not symmetric or has no mass, or if the model's assumptions exclude the bodies.
        UserWarning if no rigid body has such an inertia.
        """
        x = bodies.parameters(self.mechanism, masses, coms, inertias, drive_inertias)
        return np.asarray(times(self.B, x))

    def inverse_dynamics(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        qdd: ArrayLike,
        theta_b: ArrayLike | None = None,
        *,
        out: Array | None = None,
    ) -> Array:
        """tau (..., nv), N m or N, directly from E, P and theta_b: slow, and the reference for faster code. Without E
        and P, by Newton-Euler on the same base parameters. `theta_b` (l,) replaces the model's own; `out` is written to."""
        return self._answer("inverse_dynamics", q, qd, qdd, theta_b, out=out)

    def torques_for(self, theta_b: ArrayLike, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
        """Inverse dynamics with base parameters (l,) that are not the model's own."""
        theta = real_array("theta_b", theta_b)
        if theta.shape != (self.l,):
            raise InputError(
                f"theta_b has shape {theta.shape}, expected ({self.l},)", "give one value per base parameter"
            )
        shape, arrays = evaluate.states(self.mechanism, q=q, qd=qd, qdd=qdd)
        if self.expansion is None:
            found = recursive.torques(self.mechanism, times(self.representative, theta), arrays)
        else:
            found = evaluate.torques(self.expansion, self.mechanism, theta, arrays)
        return found.reshape(*shape, self.nv)

    def regressor(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, *, out: Array | None = None) -> Array:
        """Y (..., nv, l) with tau = Y theta_b."""
        return self._answer("regressor", q, qd, qdd, out=out)

    def mass_matrix(
        self, q: ArrayLike, theta_b: ArrayLike | None = None, *, out: Array | None = None
    ) -> Array:
        """M(q), (..., nv, nv)."""
        return self._answer("mass_matrix", q, theta_b, out=out)

    def nonlinear_effects(
        self, q: ArrayLike, qd: ArrayLike, theta_b: ArrayLike | None = None, *, out: Array | None = None
    ) -> Array:
        """h(q, qd) = C(q, qd) qd + g(q), (..., nv)."""
        return self._answer("nonlinear_effects", q, qd, theta_b, out=out)

    def gravity(self, q: ArrayLike, theta_b: ArrayLike | None = None, *, out: Array | None = None) -> Array:
        """g(q), (..., nv)."""
        return self._answer("gravity", q, theta_b, out=out)

    @property
    def base_parameters(self) -> BaseParameters:
        """Equation, unit and value (None while unknown) of each entry of theta_b: a tuple, and `to_frame()` for pandas,
        `to_latex()`."""
        unknown, known = self.unknown_base_parameters, self.file_theta_b
        values = [None] * self.l if known is None else known.tolist()
        shown = [None if k in unknown else value for k, value in enumerate(values)]
        return BaseParameters(equations.base_parameters(self.mechanism, self.B, self.pivots, shown))

    def to_latex(self) -> str:
        """The base parameters' equations with values and units, as an `aligned` environment of amsmath: entries of theta_b
        are numbered from 0, joints from 1."""
        return self.base_parameters.to_latex()

    def torque_expression(self, joint: int | str, numbers: bool = False) -> sympy.Expr:
        """The torque of one joint as a SymPy expression, for robots of few joints; its `args` are the terms.

            joint    its number, 0 being the first, or its name
            numbers  whether theta_b's values stand in it; otherwise symbols theta_b0, theta_b1 and so on

        Symbols q1, qd1, qdd1 and so on are of joints numbered from 1, as in the base parameters' equations. InputError for
        an unknown joint, a model without E and P, or a torque of too many monomials; ToolchainError without SymPy.
        """
        values = self.known_theta_b() if numbers else None
        return symbolic.torque_expression(self.mechanism, self.expanded(), joint, values)

    @property
    def content_hash(self) -> str:
        """SHA-256 of everything that a model file holds, as hexadecimal digits."""
        return store.content_hash(self)

    def save(self, path: str | Path) -> None:
        """Write a model file, as `psdmc.save(model, path)` does."""
        store.save(self, path)

    def with_payload(
        self,
        mass: float,
        com: ArrayLike,
        inertia: ArrayLike | None = None,
        frame: Placement | str | None = None,
    ) -> DynamicsModel:
        """The model with a rigid load fixed to the link that carries its tip, or another named frame.

            mass      kg
            com       (3,) m, centre of mass in `frame`
            inertia   (3, 3) kg m^2 about the load's centre of mass along the frame's axes; None: a point mass
            frame     frame of `com` and `inertia`: the name of the tip or of another of the model's frames, or a Placement
                      in the tip frame; None: the tip

        Raises InputError if no rigid body has these numbers, if they are outside the ranges of robot files, or if the
        model's assumptions exclude the load.
        """
        load = payload.load_parameters(self.mechanism, mass, com, inertia, frame)
        body = payload.carrying_frame(self.mechanism, frame).joint
        chain = payload.loaded(self.mechanism, load, float(mass), body)
        if self.theta_b is None:
            raise InputError(
                f"the base parameters of '{self.mechanism.name}' are unknown",
                "calibrate before adding a load",
            )
        index = payload.body_parameters(body)
        return replace(self, theta_b=self.theta_b + times(self.B[:, index], load), mechanism=chain)
