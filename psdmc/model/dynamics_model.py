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

    A model has all functions of compiled robots as methods, computed in NumPy. Their arrays are (..., nq) for q and
    (..., nv) for rates and torques, in SI units; leading axes are states. n joints, p monomials, l base parameters.

    expansion    E and P; None if derived with --no-expand
    theta_b      (l,) float      base parameters, SI units as in `base_parameters`; None if unknown
    B            (l, 11n) float  theta_b = B @ x, for standard parameters x that the assumptions allow
    mechanism    the robot: joints, link frames, gravity, limits, standard parameters
    certificate  (nv,)           largest torque error against Newton-Euler at random states, per joint rate, relative to
                                 the largest torque of that rate
    provenance   plain JSON values: source text, its hash and format, options, snapping and its effect, tolerances
    calibrated   what a calibration found, with the covariance of theta_b and the verdict; None if not calibrated
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
        """The mechanism; psdmc 0.1 called it `chain`."""
        return self.mechanism

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the n joints, from base to tip."""
        return self.mechanism.joint_names

    @property
    def link_names(self) -> tuple[str, ...]:
        """Names of the n links that the joints move. A link with everything fixed to it is a body."""
        return tuple(joint.link_name for joint in self.mechanism.joints)

    @property
    def q_names(self) -> tuple[str, ...]:
        """Names of the nq entries of q: the joint's name, or 'root_joint.x' and so on for a joint with several entries."""
        return self.mechanism.q_names

    @property
    def v_names(self) -> tuple[str, ...]:
        """Names of the nv entries of rates, accelerations and torques, such as 'elbow' or 'root_joint.vx'."""
        return self.mechanism.v_names

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Names of the frames of poses, Jacobians, wrenches and loads, in the order of results."""
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
        """Exponents of the monomials, (5n, p) uint8; None if the model was derived without them."""
        return None if self.expansion is None else self.expansion.E

    @property
    def P(self) -> tuple[sparse.csr_array, ...] | None:
        """Sparse reduction matrices (p, l), one per joint; None if the model was derived without them."""
        return None if self.expansion is None else self.expansion.P

    @property
    def p(self) -> int | None:
        """Number of monomials; None if the model was derived without them."""
        return None if self.expansion is None else self.expansion.p

    @property
    def pivots(self) -> tuple[int, ...]:
        """Index into x, per base parameter, of the first standard parameter that only this base parameter contains, with
        factor one."""
        return tuple(int(np.flatnonzero(row)[0]) for row in self._leads)

    @property
    def is_reduced(self) -> bool:
        """True if every base parameter has a pivot, as in every derived model."""
        return bool(self._leads.any(axis=1).all())

    @property
    def _leads(self) -> NDArray[np.bool_]:
        """Shape (l, 11n): true if a standard parameter is contained in one base parameter alone, with factor one."""
        is_alone = (self.B != 0.0).sum(axis=0) == 1
        return np.asarray(is_alone & (self.B == 1.0))

    @property
    def representative(self) -> Array:
        """Matrix (11n, l) that gives standard parameters with a given theta_b: B @ representative = 1.

        Each base parameter is placed on its pivot. The other free coordinates are zero.
        """
        leads = leading_rows(self.mechanism.parameter_span)
        column_of = {int(row): column for column, row in enumerate(leads)}
        return frozen_array(
            self.mechanism.parameter_span[:, [column_of[pivot] for pivot in self.pivots]],
            (PARAMETERS_PER_LINK * self.n, self.l),
            "representative",
        )

    def expanded(self) -> Expansion:
        """Return E and P; InputError if the model has none."""
        if self.expansion is None:
            raise InputError("this model was derived without E and P", "derive it again without --no-expand")
        return self.expansion

    def known_theta_b(self) -> Array:
        """Return theta_b, (l,); InputError if it is unknown."""
        if self.theta_b is None:
            raise InputError(
                f"the base parameters of '{self.mechanism.name}' are unknown",
                "calibrate, or give all inertias",
            )
        return self.theta_b

    @property
    def unknown_base_parameters(self) -> tuple[int, ...]:
        """Indices of the base parameters that contain an unknown standard parameter; empty if theta_b is known."""
        if self.theta_b is not None:
            return ()
        is_unknown = np.isnan(self.mechanism.parameters.reshape(-1))
        return tuple(k for k, row in enumerate(self.B) if np.any(row[is_unknown]))

    @property
    def file_theta_b(self) -> Array | None:
        """theta_b, (l,), or the part of it that comes from links of known inertia; None if no link has one."""
        if self.theta_b is not None:
            return self.theta_b
        known = self.mechanism.known_parameters
        if not np.isnan(self.mechanism.parameters).any() or not known.any():
            return None
        return np.asarray(times(self.B, known.reshape(-1)))

    def equivalent_parameters(self) -> Array:
        """Return standard parameters (11n,) that have the model's theta_b: one choice of many, `representative @ theta_b`.

        They are not the links' parameters, and no rigid bodies need have them. InputError if theta_b is unknown.
        """
        found: Array = times(self.representative, self.known_theta_b())
        return found

    def standard_parameters(self) -> Array:
        """Return `equivalent_parameters()`; this is its name in psdmc 0.1."""
        warnings.warn(RENAMED, DeprecationWarning, stacklevel=2)
        return self.equivalent_parameters()

    def theta_for(
        self,
        masses: ArrayLike,
        coms: ArrayLike,
        inertias: ArrayLike,
        drive_inertias: ArrayLike | None = None,
    ) -> Array:
        """Return theta_b (l,) of a robot with these bodies, for the argument `theta_b` of functions.

            masses          (n,) kg, one body per joint, in the order of `link_names`: the link and all that is fixed to it
            coms            (n, 3) m, centres of mass in the link frames
            inertias        (n, 3, 3) kg m^2 about the centres of mass, along the link frames' axes
            drive_inertias  (n,) kg m^2 (kg for a sliding joint); None: the model's

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
        """Return torques tau (..., nv) in N m, or N for sliding joints.

        q (..., nq), qd and qdd (..., nv). `theta_b` (l,) replaces the model's base parameters, `out` takes the result.
        psdmc evaluates E, P and theta_b, or Newton-Euler if the model has no E. This is slow: `psdmc.compile` is faster.
        """
        return self._answer("inverse_dynamics", q, qd, qdd, theta_b, out=out)

    def torques_for(self, theta_b: ArrayLike, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
        """Return torques (..., nv) as `inverse_dynamics` does, with the base parameters theta_b (l,)."""
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
        """Return the regressor Y (..., nv, l), with tau = Y theta_b."""
        return self._answer("regressor", q, qd, qdd, out=out)

    def mass_matrix(
        self, q: ArrayLike, theta_b: ArrayLike | None = None, *, out: Array | None = None
    ) -> Array:
        """Return the mass matrix M(q), (..., nv, nv), both triangles."""
        return self._answer("mass_matrix", q, theta_b, out=out)

    def nonlinear_effects(
        self, q: ArrayLike, qd: ArrayLike, theta_b: ArrayLike | None = None, *, out: Array | None = None
    ) -> Array:
        """Return h(q, qd) = C(q, qd) qd + g(q), (..., nv): Coriolis, centrifugal and gravity torques."""
        return self._answer("nonlinear_effects", q, qd, theta_b, out=out)

    def gravity(self, q: ArrayLike, theta_b: ArrayLike | None = None, *, out: Array | None = None) -> Array:
        """Return the gravity torques g(q), (..., nv)."""
        return self._answer("gravity", q, theta_b, out=out)

    @property
    def base_parameters(self) -> BaseParameters:
        """Equation, unit and value of each entry of theta_b, a tuple; the value is None if it is unknown.

        `to_frame()` returns a pandas data frame, `to_latex()` LaTeX.
        """
        unknown, known = self.unknown_base_parameters, self.file_theta_b
        values = [None] * self.l if known is None else known.tolist()
        shown = [None if k in unknown else value for k, value in enumerate(values)]
        return BaseParameters(equations.base_parameters(self.mechanism, self.B, self.pivots, shown))

    def to_latex(self) -> str:
        """Return the base parameters' equations, values and units as an `aligned` environment of amsmath.

        Entries of theta_b are numbered from 0, joints from 1.
        """
        return self.base_parameters.to_latex()

    def torque_expression(self, joint: int | str, numbers: bool = False) -> sympy.Expr:
        """Return the torque of one joint as a SymPy expression, for small robots; its `args` are the terms.

            joint    name of the joint, or its number from 0
            numbers  True: use the values of theta_b; False: the symbols theta_b0, theta_b1 and so on

        The symbols q1, qd1, qdd1 belong to the first joint. Raises InputError for an unknown joint, a model without E and
        P, or a torque of more than 2,000 monomials. Raises ToolchainError if SymPy is missing.
        """
        values = self.known_theta_b() if numbers else None
        return symbolic.torque_expression(self.mechanism, self.expanded(), joint, values)

    @property
    def content_hash(self) -> str:
        """SHA-256 of the content of the model file, as hexadecimal digits."""
        return store.content_hash(self)

    def save(self, path: str | Path) -> None:
        """Write the model to a file, as `psdmc.save(model, path)` does."""
        store.save(self, path)

    def with_payload(
        self,
        mass: float,
        com: ArrayLike,
        inertia: ArrayLike | None = None,
        frame: Placement | str | None = None,
    ) -> DynamicsModel:
        """Return a model with a rigid load fixed to the tip, or to another named frame.

            mass      kg
            com       (3,) m, centre of mass in `frame`
            inertia   (3, 3) kg m^2 about the load's centre of mass along the frame's axes; None: a point mass
            frame     frame of `com` and `inertia`: a name of `frame_names`, or a Placement in the tip frame; None: the tip

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
