"""Generates C code for the friction and the motors of a calibrated robot, beside that for its bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from psdmc.backends.c.render import identifier, render
from psdmc.calibration.identify.state_friction import PARAMETERS, StateLawView
from psdmc.calibration.logs.log import Array
from psdmc.errors import InputError
from psdmc.friction.state import STATE_LAW
from psdmc.model.calibrated import Calibrated, by_joint


@dataclass(frozen=True, slots=True)
class ActuatorView(StateLawView):
    """The data for the templates of the C code of friction and motors.

    joint_names       names of the joints
    friction          values of the LuGre friction law, one vector for each joint
    torque_constants  N m/A, one for each joint; empty if they are unknown
    """

    robot: str = "robot"
    joint_names: tuple[str, ...] = ()
    friction: tuple[Array, ...] = ()
    torque_constants: tuple[float, ...] = field(default=())

    @property
    def name(self) -> str:
        return identifier(self.robot)

    @property
    def header(self) -> str:
        return f"{self.name}_actuators.h"

    @property
    def guard(self) -> str:
        return f"{self.name.upper()}_ACTUATORS_H"

    @property
    def n(self) -> int:
        return len(self.joint_names)

    @property
    def about(self) -> str:
        """One sentence that describes the friction law."""
        return STATE_LAW.about

    @property
    def headings(self) -> tuple[str, ...]:
        return PARAMETERS

    @property
    def friction_rows(self) -> list[list[str]]:
        return [[self.number(value) for value in joint.tolist()] for joint in self.friction]

    @property
    def constant_row(self) -> list[str]:
        return [self.number(value) for value in self.torque_constants]


def actuator_files(view: ActuatorView) -> dict[str, str]:
    """Return the C99 files include/R_actuators.h and src/R_actuators.c by path, for the identifier R."""
    if len(view.friction) != view.n or (view.torque_constants and len(view.torque_constants) != view.n):
        raise ValueError(
            f"{view.n} joints, {len(view.friction)} frictions, {len(view.torque_constants)} constants"
        )
    return {
        f"include/{view.header}": render("calibration/actuators.h.jinja", view=view),
        f"src/{view.name}_actuators.c": render("calibration/actuators.c.jinja", view=view),
    }


def calibrated_actuators(
    robot: str, joint_names: Sequence[str], found: Calibrated, real: str = "double"
) -> ActuatorView:
    """Return the data for the C code of friction and motors, from the results of a calibration. Raises InputError if a
    joint has no LuGre friction (a friction law with bristle deflection as its state)."""
    values = by_joint(found.friction)
    missing = [joint for joint in joint_names if any((joint, name) not in values for name in PARAMETERS)]
    if missing:
        raise InputError(
            f"{robot}: no friction with a state was identified for joint(s) {', '.join(missing)}",
            "calibrate with friction runs of every joint; friction of one log's fit is in `psdmc emit-c --friction`",
        )
    constants = {row.joint: row.value for row in found.motors}
    return ActuatorView(
        real=real,
        robot=robot,
        joint_names=tuple(joint_names),
        friction=tuple(
            STATE_LAW.require(np.array([values[joint, name] for name in PARAMETERS])) for joint in joint_names
        ),
        torque_constants=tuple(constants[joint] for joint in joint_names) if constants else (),
    )
