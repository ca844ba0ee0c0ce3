"""Rows of a calibration's record that both methods have: base parameters and torque constants."""

from __future__ import annotations

import numpy as np

from psdmc.calibration.identify.motor import MotorResult
from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.identify.visibility import IDENTIFIED, Visibility
from psdmc.calibration.logs.log import Array
from psdmc.calibration.verdict.record import NumberRow, ParameterRow
from psdmc.friction.law import unit_of as own_unit
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.mechanism import Joint
from psdmc.robot.missing_inertia import massless_words, unknown_option

MOVED = 1e-6
"""Distance from the prior, in units of what is believable, from which an invisible parameter counts as moved by
physical consistency."""


def kept_at(model: DynamicsModel, values: Array, scale: Array, start: Array | None = None) -> list[str]:
    """The value that each unseen parameter is kept at, in words: theta_b at the file's, what follows it at `start`, zero
    where that is None."""
    prior = np.zeros(len(values)) if start is None else start.copy()
    known, unknown = model.file_theta_b, model.unknown_base_parameters
    prior[: model.l] = 0.0 if known is None else known
    words = ["the known links' part" if k in unknown else "the file's value" for k in range(model.l)]
    names = ["zero"] * model.l if known is None else words
    names += [f"{start:g}" if start else "zero" for start in prior[model.l :]]
    moved = np.abs(values - prior) > MOVED * scale
    return [
        f"the physical value nearest to {name}" if m else name for name, m in zip(names, moved, strict=True)
    ]


def dropped_links(model: DynamicsModel) -> tuple[str, ...]:
    """A sentence on links without inertia in the file, which the model has no parameters for."""
    chain = model.mechanism
    if not chain.massless:
        return ()
    return (
        f"{massless_words(chain)}, so the model has no parameters to calibrate there; derive it again with "
        f"{unknown_option(chain)}",
    )


def unit_of(joint: Joint, turning: str) -> str:
    """The unit of a joint's number, given that of one that turns: for Nms/rad Ns/m where it slides."""
    return own_unit(joint.type.effort_unit, turning)


def by_joint(model: DynamicsModel, values: Array) -> dict[str, float]:
    """Values (n,) by their joints' names."""
    return dict(zip(model.joint_names, values.tolist(), strict=True))


def parameter_rows(
    model: DynamicsModel, theta: Array, std: Array, groups: list[str], seen: Visibility
) -> tuple[ParameterRow, ...]:
    """One row for each base parameter: theta and std (l,), the group of each, and what the data show of it."""
    return tuple(
        ParameterRow(
            name=f"theta_b[{k}]",
            group=groups[k],
            value=float(theta[k]),
            std=float(std[k]) if seen.determined[k] else float("inf"),
            unit=parameter.unit,
            equation=parameter.equation,
            identifiable=seen.words[k] == IDENTIFIED,
            visibility=seen.words[k],
            file=parameter.value,
        )
        for k, parameter in enumerate(model.base_parameters)
    )


def motor_rows(model: DynamicsModel, motors: Motors, step: MotorResult | None) -> tuple[NumberRow, ...]:
    """Rows of the torque constants; none where torques were logged. A given constant, which is exact, is marked as not
    seen."""
    constants, relative = motors.torque_constant, motors.relative_std
    if step is None and np.all(constants == 1.0):
        return ()
    seen = relative > 0.0 if step is None else step.identified
    own = zip(model.mechanism.joints, constants, relative, seen, strict=True)
    return tuple(
        NumberRow(
            joint.name,
            "torque_constant",
            float(value),
            float(abs(value) * share),
            unit_of(joint, "Nm/A"),
            bool(known),
        )
        for joint, value, share, known in own
    )
