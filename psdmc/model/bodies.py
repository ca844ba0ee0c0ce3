"""Standard parameters of a robot from bodies that a user gives: masses, centres of mass, and inertias about these
centres."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from psdmc.errors import InputError
from psdmc.real_arrays import real_array
from psdmc.robot import limits
from psdmc.robot.inertia import outside, physical_fault, six_of, standard_parameters
from psdmc.robot.mechanism import BODY_PARAMETERS, PARAMETERS_PER_LINK, Array, Mechanism, parameter_names

SPAN_TOLERANCE = 1e-9
"""Largest share of a body's parameters outside those that the model admits: rounding only."""

SYMMETRY = 1e-9
"""Accepted difference of two products of inertia, relative to the larger."""


def parameters(
    chain: Mechanism,
    masses: ArrayLike,
    coms: ArrayLike,
    inertias: ArrayLike,
    drive_inertias: ArrayLike | None = None,
) -> Array:
    """Return the robot's standard parameters (11 n,) about the link frames, from masses, centres of mass and inertias
    of the links. DynamicsModel.theta_for explains the arguments and errors."""
    n, links = len(chain), [joint.link_name for joint in chain.joints]
    kilograms = _numbers("masses", masses, (n,), limits.MASS, links)
    centres = _numbers("coms", coms, (n, 3), limits.LENGTH, links)
    about_com = _numbers("inertias", inertias, (n, 3, 3), limits.INERTIA, links)
    drives = _drives(chain, drive_inertias)
    rows = np.zeros((n, PARAMETERS_PER_LINK))
    for row, link, mass, centre, matrix in zip(rows, links, kilograms, centres, about_com, strict=True):
        row[:BODY_PARAMETERS] = _body(link, float(mass), centre, matrix)
    rows[:, BODY_PARAMETERS] = drives
    x = rows.reshape(-1)
    refuse_outside(chain, [x], "these bodies:")
    return x


def refuse_outside(chain: Mechanism, vectors: Sequence[Array], who: str) -> None:
    """Raise InputError if the robot's assumptions exclude one of the given vectors of standard parameters, (11 n,)
    each. The message lists the excluded parameters.

    who  text with which the message begins
    """
    excluded: set[int] = set()
    for x in vectors:
        missed = outside(chain.parameter_span, x).reshape(len(chain), -1)
        largest = np.abs(x.reshape(missed.shape)).max(axis=1, keepdims=True)
        excluded |= set(np.flatnonzero(missed > SPAN_TOLERANCE * largest).tolist())
    if excluded:
        names = parameter_names([joint.link_name for joint in chain.joints])
        remedy = (
            "derive the model again without those assumptions; drive inertias (Im) by --drive-inertia all"
        )
        if chain.massless:
            remedy += "; links without <inertial> by --unknown missing"
        verb, them = ("is", "it") if len(excluded) == 1 else ("are", "them")
        listed = limits.joined([names[k] for k in sorted(excluded)])
        raise InputError(
            f"{who} {listed} {verb} not zero, but the model was derived with {them} assumed zero", remedy
        )


def _body(link: str, mass: float, centre: Array, matrix: Array) -> Array:
    """(10,)"""
    if mass < 0.0:
        raise InputError(
            f"masses: that of link {limits.shown(link)} is {mass:g}, expected no less than zero", "in kg"
        )
    if not np.allclose(matrix, matrix.T, rtol=SYMMETRY, atol=0.0):
        raise InputError(
            f"inertias: that of link {limits.shown(link)} is not symmetric",
            "give Ixx Ixy Ixz, Ixy Iyy Iyz, Ixz Iyz Izz",
        )
    six = six_of(matrix)
    fault = physical_fault(mass, six)
    if fault:
        text = f"link {limits.shown(link)}: {fault}: no rigid body has it, and the mass matrix may not be positive definite"
        warnings.warn(text, stacklevel=4)
    return standard_parameters(mass, centre, six)


def _drives(chain: Mechanism, given: ArrayLike | None) -> Array:
    joints = chain.joint_names
    if given is not None:
        return _numbers("drive_inertias", given, (len(chain),), limits.DRIVE_INERTIA, joints)
    own = chain.parameters[:, BODY_PARAMETERS]
    unknown = [limits.shown(name) for name, value in zip(joints, own, strict=True) if np.isnan(value)]
    if unknown:
        raise InputError(
            f"the drive inertias of {', '.join(unknown)} are unknown",
            f"give theta_for drive_inertias=, {len(chain)} numbers, or derive the model with --drive-inertia",
        )
    return own


def _numbers(
    what: str, values: ArrayLike, shape: tuple[int, ...], accepted: limits.Range, names: Sequence[str]
) -> Array:
    """Finite numbers of that shape within their range, a row for each name; a data frame's rows by their names."""
    axes = ("bodies", "xyz", "columns")[: len(shape)]
    found = real_array(what, values, axes=axes, names={"bodies": names, "xyz": "xyz"})
    if found.shape != shape:
        raise InputError(
            f"{what} has shape {found.shape}, expected {shape}", f"a row for each of {', '.join(names)}"
        )
    for name, row in zip(names, found.reshape(len(names), -1).tolist(), strict=True):
        for value in row:
            fault = accepted.fault(value) if np.isfinite(value) else "is not finite"
            if fault:
                raise InputError(f"{what}: {value:g} of {limits.shown(name)} {fault}", f"in {accepted.unit}")
    return found
