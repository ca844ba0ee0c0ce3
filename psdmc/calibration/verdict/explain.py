"""How well a joint explains a column of efforts, with either sign.

Where the file states parameters: by the joint's torque times a gain that is not negative. Else by the joint's
regressor, fitted to the first part of the data and judged on the rest. Both include friction that takes power, so that
signs are found where the rigid torque does not show them.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from psdmc.calibration.logs.log import Array
from psdmc.calibration.verdict.evidence import Evidence
from psdmc.calibration.verdict.gains import RANK_TOLERANCE, basis
from psdmc.robot.mechanism import DRIVE

TRAINING = 0.7
"""Share of the samples that a joint's own parameters are fitted to, where the file states none."""


class Explainer:
    """explain(k, torque) -> share of a column's variation that joint k explains as it is, and turned: each 0 to 1."""

    def __init__(self, evidence: Evidence) -> None:
        evidence = evidence.of_motors()
        columns = evidence.columns()
        theta_b = evidence.model.theta_b
        self._joints: list[_ByFile | _ByFit] = [
            _ByFit(evidence, columns[:, k], k)
            if theta_b is None
            else _ByFile(evidence, columns[:, k] @ theta_b, k)
            for k in range(evidence.n)
        ]

    def __call__(self, k: int, torque: Array) -> tuple[float, float]:
        if not np.ptp(torque):
            return 0.0, 0.0
        return self._joints[k].share(torque), self._joints[k].share(-torque)


class _ByFile:
    """Torque by the file with a gain, friction, drive inertia (none of them negative) and an offset."""

    def __init__(self, evidence: Evidence, by_file: Array, k: int) -> None:
        columns = [by_file, evidence.sign[:, k], evidence.qd[:, k]]
        if not evidence.model.mechanism.parameters[k, DRIVE] > 0:
            columns.append(evidence.qdd[:, k])
        design = np.stack(columns, axis=1)
        design = design - design.mean(axis=0)
        scale = np.linalg.norm(design, axis=0)
        self._q, self._r = np.linalg.qr(design / np.where(scale > 0, scale, 1.0))

    def share(self, torque: Array) -> float:
        y = torque - torque.mean()
        seen = self._q.T @ y
        _, left = nnls(self._r, seen)
        power = float(y @ y)
        return 1.0 - (float(left) ** 2 + max(power - float(seen @ seen), 0.0)) / power


class _ByFit:
    """The joint's own regressor, free, with friction that takes power: fitted to the first rows, judged on the last."""

    def __init__(self, evidence: Evidence, rigid: Array, k: int) -> None:
        self._first = round(TRAINING * len(evidence))
        columns = np.column_stack([rigid, np.ones(len(evidence))])
        self._rigid = columns
        self._friction = np.stack([evidence.sign[:, k], evidence.qd[:, k]], axis=1)
        self._basis = basis(columns[: self._first])
        train = self._friction[: self._first]
        self._left = train - self._basis @ (self._basis.T @ train)
        self._fit = np.linalg.pinv(columns[: self._first], rcond=RANK_TOLERANCE)

    def share(self, torque: Array) -> float:
        first = self._first
        y = torque[:first]
        friction, _ = nnls(self._left, y - self._basis @ (self._basis.T @ y))
        rigid = self._fit @ (y - self._friction[:first] @ friction)
        error = torque[first:] - self._rigid[first:] @ rigid - self._friction[first:] @ friction
        spread = float(np.sum((torque[first:] - torque[first:].mean()) ** 2))
        return max(1.0 - float(error @ error) / spread, 0.0) if spread > 0 else 0.0
