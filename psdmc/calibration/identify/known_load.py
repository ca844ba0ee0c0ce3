"""A known load on a robot: the torques that it causes along a log, and joints that it does not load."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from psdmc.calibration.logs.filter import stretches
from psdmc.calibration.logs.log import AnyLog, Array
from psdmc.calibration.logs.log_checks import CheckOptions
from psdmc.calibration.logs.low_pass import FilterOptions
from psdmc.calibration.logs.smoothed_rows import smoothed_rows
from psdmc.dynamics.frames import frames_of
from psdmc.dynamics.kinematics import forward_kinematics
from psdmc.model import recursive
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.payload import body_parameters, carrying_frame, load_parameters
from psdmc.robot.inertia import inertia_matrix
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, Mechanism

ALONG = 0.02
"""Sine of the angle between an axis and gravity below which the axis counts as along it, or for a sliding one across it:
one degree."""
SMALL_ARM = 0.005
"""m, from an axis to a load's centre of mass: below it the load counts as hanging on the axis. A hand cannot mount it
truer."""


@dataclass(frozen=True, slots=True, eq=False)
class KnownLoad:
    """A body of known mass that is fixed to a frame of a robot.

    mass     kg
    com      (3,) m, centre of mass in the frame
    inertia  (6,) kg m^2 about the centre of mass (xx, xy, yy, xz, yz, zz); zeros: a point mass
    frame    name of the frame; None: the tip
    """

    mass: float
    com: Array
    inertia: Array
    frame: str | None = None

    @property
    def is_point(self) -> bool:
        return not np.any(self.inertia)

    def added_to(self, model: DynamicsModel) -> DynamicsModel:
        """Return the model with this load. Raises InputError if no real body has it, or the model lacks the frame."""
        return model.with_payload(self.mass, self.com, inertia_matrix(self.inertia), self.frame)

    def parameters(self, chain: Mechanism) -> Array:
        """Return the standard parameters (11 n,) of a robot with n joints whose only body is the load. Each joint has
        eleven: mass, first moments, inertia, drive inertia. Raises InputError if no real body has the mass and inertia
        of the load."""
        place = carrying_frame(chain, self.frame)
        alone = np.zeros(PARAMETERS_PER_LINK * len(chain))
        alone[body_parameters(place.joint)] = load_parameters(
            chain, self.mass, self.com, inertia_matrix(self.inertia), self.frame
        )
        return alone

    def torques(
        self, chain: Mechanism, logs: Sequence[AnyLog], options: FilterOptions, check: CheckOptions, rows: int
    ) -> Array:
        """Return the joint torques (N, n joints), N m, that the load causes at N samples of checked logs. The samples
        are those that count as independent, and the torques are filtered as the measured torques are."""
        alone = self.parameters(chain)
        found = []
        for log in logs:
            for stretch in stretches(log, options, check, rows):
                states = stretch.states

                def needed(own: slice, states=states) -> Array:  # type: ignore[no-untyped-def]
                    return recursive.torques(chain, alone, [states.q[own], states.qd[own], states.qdd[own]])

                found.append(smoothed_rows(states, stretch.at, needed))
        return np.concatenate(found)


def unreached(chain: Mechanism, q: Array, load: KnownLoad) -> dict[str, str]:
    """Return, by joint name, why the weight of a load has (nearly) no effect on the joint in all poses q (N poses, n
    joints). An example is a joint axis along gravity. Joints on which the weight acts are left out."""
    down = chain.gravity / (np.linalg.norm(chain.gravity) or 1.0)
    weight = load.mass * float(np.linalg.norm(chain.gravity))
    still = np.zeros_like(q)
    felt = np.abs(recursive.torques(chain, load.parameters(chain), [q, still, still])).max(axis=0)
    axes = _axes(chain, q)
    reasons = {}
    for k, joint in enumerate(chain.joints):
        slides = bool(joint.type.length_order)
        if felt[k] >= (ALONG if slides else SMALL_ARM) * weight > 0.0:
            continue
        across = np.linalg.norm(np.cross(axes[k], down), axis=-1).max()
        if not weight:
            reasons[joint.name] = NO_GRAVITY
        elif slides:
            reasons[joint.name] = LEVEL
        else:
            reasons[joint.name] = UPRIGHT if across < ALONG else ON_AXIS
    return reasons


def _axes(chain: Mechanism, q: Array) -> Array:
    """(n, N, 3) the joints' axes in the base frame."""
    frames = frames_of(chain)
    states = [q[:, k] for k in range(len(chain))]
    placed = forward_kinematics(frames, states)
    shape = (len(q),)
    return np.array(
        [[np.broadcast_to(rotation[r][2], shape) for r in range(3)] for rotation, _ in placed]
    ).transpose(0, 2, 1)


NO_GRAVITY = "there is no gravity"
LEVEL = "it slides level"
UPRIGHT = "its axis is along gravity"
ON_AXIS = "the load hangs on its axis"
REMEDIES = {
    NO_GRAVITY: "accelerate it with the load far out",
    LEVEL: "accelerate it with the load on, or tilt the base",
    UPRIGHT: "accelerate it with the load far out, or tilt the base",
    ON_AXIS: "mount the load off that axis",
}
"""What to do where the weight is not felt."""
