"""Standard parameters from bodies that a user gives: masses, centres of mass, and inertias about these centres.

The bodies are all links of a robot, or a rigid load on one of its frames. A load adds to the standard parameters x of
the link that carries the frame. theta_b = B x changes; E, P and B do not.
"""

from __future__ import annotations

import shlex
import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from psdmc.dynamics.parameters import moved, moving_map
from psdmc.dynamics.parameters import standard_parameters as about_origin
from psdmc.errors import InputError
from psdmc.real_arrays import real_array
from psdmc.reproducible import times
from psdmc.robot import limits
from psdmc.robot.inertia import outside, physical_fault, six_of, standard_parameters
from psdmc.robot.mechanism import (
    BODY_PARAMETERS,
    PARAMETERS_PER_LINK,
    Array,
    Mechanism,
    NamedFrame,
    Placement,
    parameter_names,
)

SPAN_TOLERANCE = 1e-9
"""Largest share of a body's parameters outside those that the model admits: rounding only."""

SYMMETRY = 1e-9
"""Accepted difference of two products of inertia, relative to the larger."""

_SHAPES = {(): "a finite number", (3,): "three finite numbers", (3, 3): "3 x 3 finite numbers"}

ROTATION_SLACK = 1e-6
"""Largest error of the products of a rotation's rows: that of a matrix written with seven digits."""


def link_parameters(
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


def loaded(chain: Mechanism, load: Array, mass: float, body: int) -> Mechanism:
    """Return the robot with a rigid load on one of its links. Raises InputError if the load has parameters that the
    robot's assumptions set to zero.

    load  (10,) standard parameters of the load about the link's frame, from `load_parameters`
    mass  mass of the load, kg, for the note in the model
    body  number of the joint that moves the link
    """
    _check_admitted(chain, load, body)
    parameters = chain.parameters.copy()
    parameters[body, :BODY_PARAMETERS] += load
    note = f"payload of {mass:g} kg on link '{chain.joints[body].link_name}'"
    return replace(chain, parameters=parameters, notes=(*chain.notes, note))


def body_parameters(body: int) -> NDArray[np.int64]:
    """Return the (10,) indices in x of the mass, first moments and inertias of the link that joint `body` moves."""
    return PARAMETERS_PER_LINK * body + np.arange(BODY_PARAMETERS)


def load_parameters(
    chain: Mechanism,
    mass: float,
    com: ArrayLike,
    inertia: ArrayLike | None = None,
    frame: Placement | str | None = None,
) -> Array:
    """Return the (10,) standard parameters of a load, about the frame of the link that carries the load.
    DynamicsModel.with_payload explains the arguments."""
    centre, about_com = _checked(mass, com, inertia)
    kilograms = float(mass)
    about_frame = about_com + kilograms * (times(centre, centre) * np.eye(3) - np.outer(centre, centre))
    own = about_origin(kilograms, kilograms * centre, about_frame)
    place = carrying_frame(chain, frame)
    return moved(own, chain.joints[place.joint].link_frame.inverse() @ place.placement)


def load_map(chain: Mechanism, B: Array, frame: NamedFrame) -> Array:
    """Return the (l, 10) matrix that computes the change of theta_b by a load at a frame. The load is given by its
    mass, first moment and inertia about the frame's origin.

    Raises InputError if a load there can have parameters that the robot's assumptions set to zero.
    """
    place = chain.joints[frame.joint].link_frame.inverse() @ frame.placement
    moving = moving_map(place.rotation, place.translation)
    for load in moving.T:
        _check_admitted(chain, load, frame.joint)
    return np.asarray(times(B[:, body_parameters(frame.joint)], moving))


def carrying_frame(chain: Mechanism, frame: Placement | str | None) -> NamedFrame:
    """Return the frame about which a load's numbers are given, placed in the joint frame of the link that carries the
    load. The numbers are the centre of mass and the inertia."""
    tip = chain.tip_frame
    if isinstance(frame, Placement):
        return replace(tip, placement=tip.placement @ _checked_frame(frame))
    known = {each.name: each for each in (tip, *chain.frames)}
    if frame is None or frame in known:
        return tip if frame is None else known[frame]
    raise InputError(
        f"payload frame {limits.shown(frame)} is not the tip {limits.shown(chain.tip_name)} or another frame of the model",
        f"give one of {', '.join(map(limits.shown, known))}, or a Placement in the tip frame",
    )


def _checked_frame(frame: Placement) -> Placement:
    rotation = frame.rotation
    is_rotation = np.isfinite(rotation).all() and np.abs(rotation).max() < 2.0
    if not is_rotation or np.abs(rotation @ rotation.T - np.eye(3)).max() > ROTATION_SLACK:
        raise InputError("the rotation of the payload's frame is none", "its rows are orthonormal")
    if times(np.cross(rotation[0], rotation[1]), rotation[2]) < 0.0:
        raise InputError("the rotation of the payload's frame is a reflection", "its determinant is one")
    _load_numbers(frame.translation, (3,), "translation of the payload's frame", limits.LENGTH)
    return frame


def _checked(mass: float, com: ArrayLike, inertia: ArrayLike | None) -> tuple[Array, Array]:
    kilograms = float(_load_numbers(mass, (), "payload mass", limits.MASS))
    centre = _load_numbers(com, (3,), "payload com", limits.LENGTH)
    if kilograms < 0.0:
        raise InputError(f"payload mass is {kilograms}, expected a number >= 0", "in kg")
    if inertia is None:
        return centre, np.zeros((3, 3))
    about_com = _load_numbers(inertia, (3, 3), "payload inertia", limits.INERTIA)
    if not np.allclose(about_com, about_com.T, rtol=1e-9, atol=0.0):
        raise InputError("payload inertia is not symmetric", "give Ixx Ixy Ixz, Ixy Iyy Iyz, Ixz Iyz Izz")
    fault = physical_fault(kilograms, six_of(about_com))
    if fault:
        raise InputError(
            f"payload inertia: {fault}: no rigid body has it", "in kg m^2, about the load's centre of mass"
        )
    return centre, about_com


def _load_numbers(values: ArrayLike, shape: tuple[int, ...], what: str, accepted: limits.Range) -> Array:
    """Finite numbers of that shape within their range; InputError says what was found."""
    try:
        found: Array | None = np.asarray(values)
    except ValueError:
        found = None
    if found is not None:
        found = found.astype(np.float64) if found.dtype.kind in "iuf" else None
    if found is None or found.shape != shape:
        form = f"has shape {found.shape}" if found is not None else f"is {limits.shown(values)}"
        raise InputError(f"{what} {form}, expected {_SHAPES[shape]}", f"in {accepted.unit}")
    for value in found.reshape(-1).tolist():
        if not np.isfinite(value):
            raise InputError(
                f"{what} is {limits.shown(found.tolist())}, expected {_SHAPES[shape]}", f"in {accepted.unit}"
            )
        fault = accepted.fault(value)
        if fault:
            raise InputError(f"{what}: {value:g} {fault}", f"in {accepted.unit}")
    return found


def _check_admitted(chain: Mechanism, load: Array, body: int) -> None:
    """InputError unless the load lies in the span: a link whose mx is assumed zero cannot carry one off its axis."""
    x = np.zeros(PARAMETERS_PER_LINK * len(chain))
    x[body_parameters(body)] = load
    if outside(chain.parameter_span, x).max() > SPAN_TOLERANCE * np.abs(x).max(initial=0.0):
        link = chain.joints[body].link_name
        if link in chain.massless:
            raise InputError(
                f"cannot add this load to link {limits.shown(link)}: the model treats it as massless, "
                "as it has no <inertial>",
                f"add <inertial> and derive again; or derive again with --unknown {shlex.quote(link)}, then calibrate",
            )
        raise InputError(
            f"link '{link}' cannot carry this load: the model assumes some of its parameters zero",
            f"derive again with the link's inertia in the robot file, with --unknown {shlex.quote(link)}, or without "
            "--assume-zero",
        )
