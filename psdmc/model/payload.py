"""A rigid load on the tip: new base parameters from the same E, P and B, because theta_b = B x."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from psdmc.dynamics.parameters import BODY_PARAMETERS, moved, standard_parameters
from psdmc.errors import InputError
from psdmc.robot.chain import PARAMETERS_PER_LINK, Placement

if TYPE_CHECKING:
    from psdmc.model.dynamics_model import DynamicsModel

Array = NDArray[np.float64]

SPAN_TOLERANCE = 1e-9
"""Share of the load by which it may miss the parameters that the model admits: rounding only."""


def with_payload(
    model: DynamicsModel,
    mass: float,
    com: ArrayLike,
    inertia: ArrayLike | None = None,
    frame: Placement | str | None = None,
) -> DynamicsModel:
    """The model with a rigid load fixed to its last link.

    mass      kg
    com       (3,) m, centre of mass in `frame`
    inertia   (3, 3) kg m^2 about the load's centre of mass along the frame's axes; None: a point mass
    frame     where the load's numbers are given: a Placement in the tip frame, or the tip's name; None: the
    tip InputError where the numbers are no rigid body's or the model's assumptions do not admit the load.
    """
    load = load_parameters(model, mass, com, inertia, frame)
    index = PARAMETERS_PER_LINK * (model.n - 1) + np.arange(BODY_PARAMETERS)
    _check_admitted(model, load, index)
    if model.theta_b is None:
        raise InputError(
            f"the base parameters of '{model.chain.name}' are unknown", "calibrate before adding a load"
        )
    parameters = model.chain.parameters.copy()
    parameters[-1, :BODY_PARAMETERS] += load
    note = f"payload of {mass:g} kg on link '{model.chain.joints[-1].link_name}'"
    chain = replace(model.chain, parameters=parameters, notes=(*model.chain.notes, note))
    return replace(model, theta_b=model.theta_b + model.B[:, index] @ load, chain=chain)


def load_parameters(
    model: DynamicsModel,
    mass: float,
    com: ArrayLike,
    inertia: ArrayLike | None = None,
    frame: Placement | str | None = None,
) -> Array:
    """(10,) the load's standard parameters about the last link's frame."""
    centre, about_com = _checked(mass, com, inertia)
    about_frame = about_com + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    own = standard_parameters(float(mass), mass * centre, about_frame)
    in_tip = model.chain.tip @ _frame(model, frame)
    return moved(own, model.chain.joints[-1].link_frame.inverse() @ in_tip)


def _frame(model: DynamicsModel, frame: Placement | str | None) -> Placement:
    if isinstance(frame, Placement):
        return frame
    if frame is None or frame == model.chain.tip_name:
        return Placement.identity()
    raise InputError(
        f"payload frame '{frame}' is not the tip '{model.chain.tip_name}'",
        "give the tip's name, or a Placement in the tip frame",
    )


def _checked(mass: float, com: ArrayLike, inertia: ArrayLike | None) -> tuple[Array, Array]:
    centre = np.asarray(com, dtype=np.float64)
    about_com = np.zeros((3, 3)) if inertia is None else np.asarray(inertia, dtype=np.float64)
    if not np.isfinite(mass) or mass < 0:
        raise InputError(f"payload mass is {mass}, expected a number >= 0", "in kg")
    if centre.shape != (3,) or not np.isfinite(centre).all():
        raise InputError(f"payload com is {centre.tolist()}, expected three finite numbers", "in m")
    if about_com.shape != (3, 3) or not np.isfinite(about_com).all():
        raise InputError(f"payload inertia has shape {about_com.shape}, expected (3, 3)", "in kg m^2")
    if not np.allclose(about_com, about_com.T, rtol=1e-9, atol=0.0):
        raise InputError("payload inertia is not symmetric", "give Ixx Ixy Ixz, Ixy Iyy Iyz, Ixz Iyz Izz")
    return centre, about_com


def _check_admitted(model: DynamicsModel, load: Array, index: NDArray[np.int64]) -> None:
    """The load must lie in the span: a link whose mx is assumed zero cannot carry one off its axis."""
    x = np.zeros(PARAMETERS_PER_LINK * model.n)
    x[index] = load
    span = model.chain.parameter_span
    leads = np.argmax(span != 0.0, axis=0)
    missed = np.abs(x - span @ x[leads]).max()
    if missed > SPAN_TOLERANCE * np.abs(x).max(initial=0.0):
        link = model.chain.joints[-1].link_name
        raise InputError(
            f"link '{link}' cannot carry this load: the model assumes some of its parameters zero",
            "derive the model again without those assumptions",
        )
