"""What a planned run may not do: leave its joints' limits, ask too much of the motors, or hit something."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from psdmc.calibration.identify.steps import Load
from psdmc.calibration.motions.clearance import Clearance, FloorPoints
from psdmc.calibration.motions.torque_limits import TorqueLimits
from psdmc.calibration.motions.trajectory import Trajectory, limit_faults
from psdmc.robot.mechanism import Mechanism

LOOKED_AT = 0.01
"""s between the rows whose torque is computed: a hundred per second, ten per period of the fastest sine."""


@dataclass(frozen=True, slots=True, eq=False)
class Allowed:
    """Limits of motions.

    torques        None: not looked at
    torque_margin  share of them that a motion may take
    clearance      shapes that may not touch; None: not looked at
    """

    chain: Mechanism
    torques: TorqueLimits | None = None
    torque_margin: float = 1.0
    clearance: Clearance | FloorPoints | None = None

    def faults(self, motion: Trajectory, load: Load | None = None) -> list[str]:
        """One sentence for each thing that the motion does and may not do; the cheapest to find out come first, and what
        follows is not looked at."""
        found = limit_faults(motion, self.chain)
        if not found and self.torques is not None:
            taken = slice(None, None, max(1, round(LOOKED_AT / motion.period)))
            q, qd, qdd = (np.ascontiguousarray(part[taken]) for part in (motion.q, motion.qd, motion.qdd))
            found = self.torques.faults(self.torques.torque(q, qd, qdd, load), self.torque_margin)
        if not found and self.clearance is not None:
            touch = self.clearance.first_touch(motion.q)
            found = [] if touch is None else [touch]
        return found
