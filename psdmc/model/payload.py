"""A rigid load on a frame, added to the standard parameters x of the link that carries the frame. theta_b = B x
changes; E, P and B do not."""

from __future__ import annotations

import shlex
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from psdmc.dynamics.parameters import moved, moving_map, standard_parameters
from psdmc.errors import InputError
from psdmc.model.bodies import SPAN_TOLERANCE
from psdmc.reproducible import times
from psdmc.robot import limits
from psdmc.robot.inertia import outside, physical_fault, six_of
from psdmc.robot.mechanism import (
    BODY_PARAMETERS,
    PARAMETERS_PER_LINK,
    Array,
    Mechanism,
    NamedFrame,
    Placement,
)

ROTATION_SLACK = 1e-6
"""Largest error of the products of a rotation's rows: that of a matrix written with seven digits."""


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
    own = standard_parameters(kilograms, kilograms * centre, about_frame)
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
    if np.linalg.det(rotation) < 0.0:
        raise InputError("the rotation of the payload's frame is a reflection", "its determinant is one")
    _numbers(frame.translation, (3,), "translation of the payload's frame", limits.LENGTH)
    return frame


def _checked(mass: float, com: ArrayLike, inertia: ArrayLike | None) -> tuple[Array, Array]:
    kilograms = float(_numbers(mass, (), "payload mass", limits.MASS))
    centre = _numbers(com, (3,), "payload com", limits.LENGTH)
    if kilograms < 0.0:
        raise InputError(f"payload mass is {kilograms}, expected a number >= 0", "in kg")
    if inertia is None:
        return centre, np.zeros((3, 3))
    about_com = _numbers(inertia, (3, 3), "payload inertia", limits.INERTIA)
    if not np.allclose(about_com, about_com.T, rtol=1e-9, atol=0.0):
        raise InputError("payload inertia is not symmetric", "give Ixx Ixy Ixz, Ixy Iyy Iyz, Ixz Iyz Izz")
    fault = physical_fault(kilograms, six_of(about_com))
    if fault:
        raise InputError(
            f"payload inertia: {fault}: no rigid body has it", "in kg m^2, about the load's centre of mass"
        )
    return centre, about_com


def _numbers(values: ArrayLike, shape: tuple[int, ...], what: str, accepted: limits.Range) -> Array:
    """Finite numbers of that shape within their range; InputError says what was found."""
    found = array_of(values)
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


def array_of(values: ArrayLike) -> Array | None:
    """Return the values as float64; None if they are no numbers."""
    try:
        found = np.asarray(values)
    except ValueError:
        return None
    return found.astype(np.float64) if found.dtype.kind in "iuf" else None


_SHAPES = {(): "a finite number", (3,): "three finite numbers", (3, 3): "3 x 3 finite numbers"}


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
