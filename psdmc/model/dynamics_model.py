"""A MODEL: the inverse dynamics of a robot as data, monomials times constants, with the robot and the origin of the
data."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from psdmc.errors import InputError
from psdmc.model import bodies, equations, evaluate, store, summary
from psdmc.model.answers import Answers
from psdmc.model.calibrated import Calibrated
from psdmc.model.equations import BaseParameters
from psdmc.model.expansion import Expansion, torque_expression
from psdmc.model.loop_base_parameters import LoopBaseParameters, loop_base_parameters
from psdmc.real_arrays import real_array
from psdmc.reproducible import times
from psdmc.robot.inertia import leading_rows
from psdmc.robot.mechanism import (
    PARAMETERS_PER_LINK,
    ROW_NAMES,
    Array,
    Mechanism,
    Placement,
    frozen_array,
    made_again,
)

if TYPE_CHECKING:
    import sympy
    from scipy import sparse


RENAMED = (
    "standard_parameters() has been renamed equivalent_parameters(); the old name still works for now. "
    "From masses, coms and inertias to theta_b: theta_for(...)"
)


@dataclass(frozen=True, slots=True, weakref_slot=True, eq=False)
class DynamicsModel(Answers):
    """A model contains a robot's inverse dynamics as data: the torque of joint i is tau[i] = y(state) @ P[i] @ theta_b.

    `psdmc.derive` makes models. The vector y(state) holds the values of p monomials, which are products of powers of q,
    sin q, cos q, qd and qdd. The matrices P[i] and the l base parameters theta_b, which are combinations of masses and
    inertias, are constants of the robot. A model that was derived with `expand=False` has no matrices P[i].

    A model has the same methods as a compiled robot (the result of `psdmc.compile`), such as `forward_dynamics`, but it
    computes them in NumPy. In arguments and results, q has the shape (..., nq), and rates, accelerations and torques have
    the shape (..., nv). The dots (...) stand for batch axes, if any. All numbers are in SI units.

    expansion    the exponents E of the monomials, and the matrices P; None if the model was derived with `expand=False`
    theta_b      (l,) base parameters, SI units as in `base_parameters`; None if unknown
    B            (l, 11n) matrix that computes the base parameters: theta_b = B @ x. The vector x has 11 standard
                 parameters for each of the n links: mass, first moments (3), inertias (6) and drive inertia
    mechanism    the robot: joints, link frames, gravity, limits, and standard parameters
    certificate  (nv,) largest difference between the torques of the model and of the Newton-Euler algorithm at random
                 states, divided by the largest torque; one number per entry of tau
    provenance   plain JSON values: text, hash and format of the robot file, options, tolerances, and the angles
                 that psdmc replaced by exact right angles (option `snap` of `derive`)
    calibrated   what a calibration found: base parameters with their covariance, friction, springs, torque constants,
                 verdict and logs; None if not calibrated
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
        if self.expansion is not None and (self.expansion.n, self.expansion.l) != (self.nv, l):
            raise ValueError(
                f"E and P are for {self.expansion.n} joints and {self.expansion.l} base parameters, "
                f"expected {self.nv} and {l}"
            )

    def __repr__(self) -> str:
        return summary.text_summary(self)

    def _repr_html_(self) -> str:
        return summary.html_summary(self)

    def _repr_latex_(self) -> str:
        return self.base_parameters._repr_latex_()

    @property
    def chain(self) -> Mechanism:
        """Return the attribute `mechanism`, which psdmc 0.1 called `chain`."""
        return self.mechanism

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the names of the n joints, from base to tip."""
        return self.mechanism.joint_names

    @property
    def link_names(self) -> tuple[str, ...]:
        """Return the names of the n links that the joints move, in the order of the joints."""
        return tuple(joint.link_name for joint in self.mechanism.joints)

    @property
    def q_names(self) -> tuple[str, ...]:
        """Return the names of the nq entries of q, such as 'elbow', or 'root_joint.x' if a joint has several entries."""
        return self.mechanism.q_names

    @property
    def v_names(self) -> tuple[str, ...]:
        """Return the names of the nv entries of rates, accelerations and torques, such as 'elbow' or 'root_joint.vx'."""
        return self.mechanism.v_names

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Return the names of the named frames, in the order in which `forward_kinematics` returns their positions.

        The options `frames`, `tool` and `contacts` of `derive` choose the named frames. Without them, they are the tip,
        or the end of each branch.
        """
        return tuple(frame.name for frame in self.mechanism.frames)

    @property
    def contacts(self) -> dict[str, int]:
        """Return a dictionary from each contact's name to the number of its force components.

        A contact is a link or frame that can touch the world (option `contacts` of `derive`). A contact point has three
        components (force), a contact surface six (force, then moment).

        `constrained_forward_dynamics` and other functions return contact forces in the order of this dictionary.
        """
        return {frame.name: frame.rows for frame in self.mechanism.contacts}

    @property
    def loops(self) -> dict[str, tuple[str, ...]]:
        """Return a dictionary from each closed loop's name to the directions of relative motion that the loop blocks.

        A closed loop keeps two frames of the robot together. A direction is 'x', 'y' or 'z' (along an axis of the loop's
        first frame), or 'rx', 'ry' or 'rz' (about an axis).

        `constrained_forward_dynamics` returns the contact forces first, then the forces of the loops, in the order of this
        dictionary.
        """
        return {
            name: tuple(ROW_NAMES[row] for row in rows)
            for name, rows in ((loop.name, loop.rows) for loop in self.mechanism.loops)
        }

    @property
    def loop_base_parameters(self) -> LoopBaseParameters:
        """Return the combinations of base parameters that the motors' torques identify, for a mechanism with closed loops.

        The result has the attributes `count`, `matrix` and `kept`. If the base floats, its force and moment count, too.
        psdmc finds the count by the numerical rank of a regressor at random states, in a few seconds. Keep the result.

        Raises InputError if no closed position of the loops is found.
        """
        return loop_base_parameters(self.mechanism, self.representative)

    @property
    def n(self) -> int:
        """Return the number of joints. Mimic joints, which follow another joint, are counted, too."""
        return len(self.mechanism)

    @property
    def nq(self) -> int:
        """Return the number of entries of q. A joint with one coordinate has one entry, and a quaternion has four."""
        return self.mechanism.nq

    @property
    def nv(self) -> int:
        """Return the length of qd, qdd and tau: the number of joint rates."""
        return self.mechanism.nv

    @property
    def l(self) -> int:  # noqa: E743  the paper's letter
        """Return the number of base parameters, the length of theta_b."""
        return int(self.B.shape[0])

    @property
    def E(self) -> NDArray[np.uint8] | None:
        """Return the matrix E of exponents: each column describes one of the p monomials in the robot's torques.

        A monomial is a product of powers of q, sin q, cos q, qd and qdd. E has the shape (5n, p) and the type uint8: n rows
        of exponents of q, one per entry of q, then n rows of sin q, and so on. E is None if the model was derived with
        `expand=False`.
        """
        return None if self.expansion is None else self.expansion.E

    @property
    def P(self) -> tuple[sparse.csr_array, ...] | None:
        """Return sparse matrices P[i] of shape (p, l), one for each joint torque: tau[i] = y(state) @ P[i] @ theta_b.

        The vector y(state) holds the values of p monomials. Monomials are products of powers of q, sin q, cos q, qd and
        qdd. theta_b are the l base parameters. P is None if the model was derived with `expand=False`.
        """
        return None if self.expansion is None else self.expansion.P

    @property
    def p(self) -> int | None:
        """Return the number of monomials in the model's torques.

        A monomial is a product of powers of q, sin q, cos q, qd and qdd.

        p is None if the model was derived with `expand=False`.
        """
        return None if self.expansion is None else self.expansion.p

    @property
    def pivots(self) -> tuple[int, ...]:
        """Return for each base parameter the index of one standard parameter, its pivot.

        Each of the n links has 11 standard parameters: mass, first moments (3), inertias (6) and drive inertia. The index
        is the place in the vector of all 11n standard parameters. A base parameter is a linear combination of standard
        parameters. Its pivot is the first one that appears in no other base parameter, and that has the coefficient 1.
        """
        return tuple(int(np.flatnonzero(row)[0]) for row in self._leads)

    @property
    def is_reduced(self) -> bool:
        """Return whether each base parameter has a pivot, a standard parameter that appears in no other base parameter.

        This is true for every model that psdmc derives. Standard parameters are the masses, first moments and inertias of
        the links. A base parameter is a linear combination of standard parameters. Its pivot has the coefficient 1.
        """
        return bool(self._leads.any(axis=1).all())

    @property
    def _leads(self) -> NDArray[np.bool_]:
        """Shape (l, 11n): true if a standard parameter is contained in one base parameter alone, with factor one."""
        is_alone = (self.B != 0.0).sum(axis=0) == 1
        return np.asarray(is_alone & (self.B == 1.0))

    @property
    def representative(self) -> Array:
        """Return the matrix R, (11n, l), that computes standard parameters x = R @ theta_b from base parameters theta_b.

        Each of the n links has 11 standard parameters: mass, first moments (3), inertias (6) and drive inertia. Many
        vectors x give the same base parameters and therefore the same torques. R computes one of these vectors: one
        entry of x for each base parameter (its pivot, see `pivots`) has the value of the base parameter. Without the
        option `assume_zero` of `derive`, all other entries are zero.

        With `assume_zero`, entries that are no pivots can differ from zero. For example, `assume_zero` can make a link a
        point mass on its z axis. Its inertias Ixx and Iyy are then equal. If Ixx is a pivot, Iyy has the same value.
        """
        leads = leading_rows(self.mechanism.parameter_span)
        column_of = {int(row): column for column, row in enumerate(leads)}
        return frozen_array(
            self.mechanism.parameter_span[:, [column_of[pivot] for pivot in self.pivots]],
            (PARAMETERS_PER_LINK * self.n, self.l),
            "representative",
        )

    def expanded(self) -> Expansion:
        """Return an object with the matrices E and P. They give each joint torque as a sum of monomials.

        A monomial is a product of powers of q, sin q, cos q, qd and qdd. E holds the exponents of the monomials. P[i] times
        the base parameters gives the coefficients of the monomials in the torque of joint i.

        Raises InputError if the model was derived with `expand=False`, without E and P.
        """
        if self.expansion is None:
            raise InputError("this model was derived without E and P", "derive it again without --no-expand")
        return self.expansion

    def known_theta_b(self) -> Array:
        """Return the base parameters theta_b, (l,), SI units. Raises InputError if some inertias are unknown."""
        if self.theta_b is None:
            raise InputError(
                f"the base parameters of '{self.mechanism.name}' are unknown",
                "calibrate, or give all inertias",
            )
        return self.theta_b

    @property
    def unknown_base_parameters(self) -> tuple[int, ...]:
        """Return the indices in theta_b of the base parameters that depend on an unknown mass or inertia.

        The tuple is empty if all base parameters are known.
        """
        if self.theta_b is not None:
            return ()
        is_unknown = np.isnan(self.mechanism.parameters.reshape(-1))
        return tuple(k for k, row in enumerate(self.B) if np.any(row[is_unknown]))

    @property
    def file_theta_b(self) -> Array | None:
        """Return the base parameters theta_b, (l,), also if the robot file lacks masses or inertias of some links.

        Missing masses and inertias count as zero. The result is None if the file has no mass and no inertia at all.
        """
        if self.theta_b is not None:
            return self.theta_b
        known = self.mechanism.known_parameters
        if not np.isnan(self.mechanism.parameters).any() or not known.any():
            return None
        return np.asarray(times(self.B, known.reshape(-1)))

    def equivalent_parameters(self) -> Array:
        """Return masses and inertias of the links, as one vector, with which the robot has the same torques as the model.

        The vector has 11 numbers for each of the n links: mass, first moments (3), inertias (6) and drive inertia. Many
        vectors give the same torques. This one is `representative` @ theta_b. It does not describe the real links, and can
        contain negative masses.

        Raises InputError if theta_b is unknown.
        """
        found: Array = times(self.representative, self.known_theta_b())
        return found

    def standard_parameters(self) -> Array:
        """Do the same as `equivalent_parameters`, and give a DeprecationWarning: use `equivalent_parameters` instead."""
        warnings.warn(RENAMED, DeprecationWarning, stacklevel=2)
        return self.equivalent_parameters()

    def theta_for(
        self,
        masses: ArrayLike,
        coms: ArrayLike,
        inertias: ArrayLike,
        drive_inertias: ArrayLike | None = None,
    ) -> Array:
        """Compute the base parameters theta_b, (l,), of this robot with other masses and inertias.

            masses          (n,) kg, one per link of `link_names`; each includes everything that is fixed to the link
            coms            (n, 3) m, centres of mass in the link frames
            inertias        (n, 3, 3) kg m^2 about the centres of mass, along the axes of the link frames
            drive_inertias  (n,) inertias of motor and gear as seen at the joint, kg m^2 (kg for a sliding joint); None:
                            those of the model

        Pass the result as the argument `theta_b` of a function. Warns if no rigid body can have a given inertia.

        Raises InputError in each of these cases:

        - a mass is negative, or a number is not finite or exceeds a limit of psdmc, such as 1e6 kg
        - an inertia is not symmetric, or belongs to a link without mass
        - a parameter is not zero, but the model was derived with the assumption that it is (option `assume_zero`)
        """
        x = bodies.link_parameters(self.mechanism, masses, coms, inertias, drive_inertias)
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
        """Compute the joint torques tau, (..., nv), of a motion: N m, or N for sliding joints.

            q          (..., nq) joint positions, rad or m; ... are batch axes, if any
            qd, qdd    (..., nv) joint rates and accelerations, rad/s and rad/s^2, or m/s and m/s^2
            theta_b    (l,) base parameters for all states, or (..., l), one set per state; None: those of the model
            out        array into which psdmc writes the result; optional

        This method computes with NumPy. The method of a compiled robot (`psdmc.compile`) is hundreds of times faster.

        The torque of joint i is y @ P[i] @ theta_b. The vector y holds the values of the model's p monomials, products of
        powers of q, sin q, cos q, qd and qdd. P[i] is a constant matrix of the model, (p, l) (attribute `P`). A model that
        was derived with `expand=False` has no monomials. The method then uses the Newton-Euler algorithm.
        """
        return self._answer("inverse_dynamics", q, qd, qdd, theta_b, out=out)

    def torques_for(self, theta_b: ArrayLike, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
        """Compute the joint torques tau, (..., nv), of a motion: N m, or N for sliding joints.

        The result is that of `inverse_dynamics` with the argument `theta_b`, which is required here.

        theta_b    (l,) base parameters for all states, SI units: combinations of masses and inertias
        q          (..., nq) joint positions, rad or m; ... are batch axes, if any
        qd, qdd    (..., nv) joint rates and accelerations, rad/s and rad/s^2, or m/s and m/s^2
        """
        theta = real_array("theta_b", theta_b)
        if theta.shape != (self.l,):
            raise InputError(
                f"theta_b has shape {theta.shape}, expected ({self.l},)", "give one value per base parameter"
            )
        shape, arrays = evaluate.states(self.mechanism, q=q, qd=qd, qdd=qdd)
        if self.expansion is None:
            found = evaluate.torques(self.mechanism, times(self.representative, theta), arrays)
        else:
            found = evaluate.expanded_torques(self.expansion, self.mechanism, theta, arrays)
        return found.reshape(*shape, self.nv)

    def regressor(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, *, out: Array | None = None) -> Array:
        """Compute the regressor Y, (..., nv, l), of a motion: the joint torques are tau = Y theta_b.

        The l base parameters theta_b are combinations of masses and inertias.

        q          (..., nq) joint positions, rad or m; ... are batch axes, if any
        qd, qdd    (..., nv) joint rates and accelerations, rad/s and rad/s^2, or m/s and m/s^2
        out        array into which psdmc writes the result; optional
        """
        return self._answer("regressor", q, qd, qdd, out=out)

    def mass_matrix(
        self, q: ArrayLike, theta_b: ArrayLike | None = None, *, out: Array | None = None
    ) -> Array:
        """Compute the joint-space mass matrix M(q), (..., nv, nv), with both triangles filled. Units are kg m^2, kg m or kg.

        q          (..., nq) joint positions, rad or m; ... are batch axes, if any
        theta_b    (l,) base parameters for all states, or (..., l), one set per state; None: those of the model
        out        array into which psdmc writes the result; optional
        """
        return self._answer("mass_matrix", q, theta_b, out=out)

    def nonlinear_effects(
        self, q: ArrayLike, qd: ArrayLike, theta_b: ArrayLike | None = None, *, out: Array | None = None
    ) -> Array:
        """Compute h(q, qd), (..., nv), the sum of Coriolis, centrifugal and gravity torques: N m, or N for sliding joints.

        q          (..., nq) joint positions, rad or m; ... are batch axes, if any
        qd         (..., nv) joint rates, rad/s or m/s
        theta_b    (l,) base parameters for all states, or (..., l), one set per state; None: those of the model
        out        array into which psdmc writes the result; optional
        """
        return self._answer("nonlinear_effects", q, qd, theta_b, out=out)

    def gravity(self, q: ArrayLike, theta_b: ArrayLike | None = None, *, out: Array | None = None) -> Array:
        """Compute the gravity torques g(q), (..., nv), which keep the robot at rest: N m, or N for sliding joints.

        q          (..., nq) joint positions, rad or m; ... are batch axes, if any
        theta_b    (l,) base parameters for all states, or (..., l), one set per state; None: those of the model
        out        array into which psdmc writes the result; optional
        """
        return self._answer("gravity", q, theta_b, out=out)

    @property
    def base_parameters(self) -> BaseParameters:
        """Return a tuple with one entry per base parameter: the equation, unit and value. An unknown value is None.

        The tuple has two methods: `to_frame()` returns a pandas data frame, and `to_latex()` returns LaTeX.
        """
        unknown, known = self.unknown_base_parameters, self.file_theta_b
        values = [None] * self.l if known is None else known.tolist()
        shown = [None if k in unknown else value for k, value in enumerate(values)]
        return equations.base_parameters(self.mechanism, self.B, self.pivots, shown)

    def to_latex(self) -> str:
        """Return the equations, values and units of the base parameters as LaTeX, in amsmath's environment `aligned`.

        In the equations, the first entry of theta_b has the number 0, and the first joint has the number 1.
        """
        return self.base_parameters.to_latex()

    def torque_expression(self, joint: int | str, numbers: bool = False) -> sympy.Expr:
        """Return the torque of one joint as a SymPy sum. The attribute `args` of the sum is the tuple of its terms.

            joint    name of the joint, or its number: 0 is the first joint
            numbers  True: the sum contains the values of theta_b; False: the symbols theta_b0, theta_b1 and so on

        In the sum, the symbols q1, qd1 and qdd1 belong to the first joint.

        Raises InputError if the robot has no such joint, if the torque has more than 2,000 monomials, or if the model was
        derived with `expand=False`. Raises ToolchainError if SymPy is missing.
        """
        values = self.known_theta_b() if numbers else None
        return torque_expression(self.mechanism, self.expanded(), joint, values)

    @property
    def content_hash(self) -> str:
        """Return the SHA-256 hash of the model as 64 hexadecimal digits. Equal models have equal hashes.

        psdmc computes the hash from the content of the model file: the arrays and the manifest (a JSON text).
        """
        return store.content_hash(self)

    def save(self, path: str | Path) -> None:
        """Write the model to a file, as `psdmc.save(model, path)` does. `psdmc.load` reads the file."""
        store.save(self, path)

    def with_payload(
        self,
        mass: float,
        com: ArrayLike,
        inertia: ArrayLike | None = None,
        frame: Placement | str | None = None,
    ) -> DynamicsModel:
        """Return a new model of the robot with a rigid load that is fixed to a named frame.

            mass      mass of the load, kg
            com       (3,) m, centre of mass of the load in the frame
            inertia   (3, 3) kg m^2 about the load's centre of mass, along the axes of the frame; None: a point mass
            frame     the frame: a name from `frame_names`, or a psdmc.robot.placement.Placement, which is a rotation
                      matrix and a translation (m) relative to the tip frame; None: the tip frame

        Raises InputError if no rigid body has such a mass and inertia, or if a number is unusually large. Raises
        InputError also if the load needs a parameter that the model assumes to be zero (option `assume_zero` of `derive`).
        """
        load = bodies.load_parameters(self.mechanism, mass, com, inertia, frame)
        body = bodies.carrying_frame(self.mechanism, frame).joint
        chain = bodies.loaded(self.mechanism, load, float(mass), body)
        if self.theta_b is None:
            raise InputError(
                f"the base parameters of '{self.mechanism.name}' are unknown",
                "calibrate before adding a load",
            )
        index = bodies.body_parameters(body)
        return replace(self, theta_b=self.theta_b + times(self.B[:, index], load), mechanism=chain)
