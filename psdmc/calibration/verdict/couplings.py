"""Finds motors that drive several joints although no log description says so, as in many wrists.

The log's columns then belong to motors: q_joint = C q_motor and tau_motor = C^T tau_joint. An entry C[j, i] besides the
diagonal says that the motor of joint i also moves joint j: its torque is tau_i + C[j, i] tau_j. All entries of
neighbouring joints are hypotheses. First, the column of joint i is explained by that of joint j, in addition to its own
base parameters and friction; this gives a first value of C[j, i]. Gauss-Newton steps make the best entries exact, with
base parameters and friction of the motors fitted along. This is done for positions of joints and for positions of motors,
and likelihoods decide. The standard deviation is the larger of two: one from stretches of time whose residuals may be
dependent (Liang and Zeger 1986), and one from the residuals' autocorrelation (residuals.widening).
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from psdmc.calibration.identify.motor_model import Coupling
from psdmc.calibration.identify.residuals import quality, widening
from psdmc.calibration.logs.log import Array
from psdmc.calibration.verdict.effort_checks import RANK_TOLERANCE
from psdmc.calibration.verdict.evidence import SIGN_SPEED, Evidence
from psdmc.calibration.verdict.log_errors import Fit, Sums

ROWS = 1500
"""Samples on which entries are tried."""
REACH = 3
"""Largest distance of two coupled joints in the order of the model: those of a wrist are neighbours."""
TRIED = 3
"""Entries that are made exact, of those that explain the log best at first."""
MOST_ENTRIES = 4
"""Entries that one proposal has at most: each of them costs some fits."""
STEPS = 8
"""Gauss-Newton steps of an entry at most; three or four are usual."""
SETTLED = 1e-5
"""Change of all entries that ends them."""
LONGEST = 0.5
"""Step of an entry at most."""
DIFFERENCE = 1e-4
"""Step of the differences that give the slope by an entry."""
WORTH_TRYING = 0.1
"""Share of what is left of a joint's torque that an entry explains at first, to be made exact."""
LARGEST = 3.0
"""Of an entry: gears of a wrist have about the same ratio, and entries between 0.01 and 1."""
LEAST = 0.01
"""Smallest entry that is named."""
SURE = 10.0
"""Standard deviations that an entry has at least: the ratio of a real gear is found to a percent or so, a ratio that
stands for another fault of the log is not."""
EXPLAINS = 0.5
"""Share of what is left of a joint's torque that an entry explains at least ..."""
TOGETHER = 0.7
"""... and that all entries explain: of planted faults other than couplings, one reached 0.68."""
FOLLOWED = 0.8
"""R^2 of all coupled columns with the proposal, on samples that were not fitted: else the log has another fault."""
WORSE = 1.1
"""Factor by which the coupling may raise what is left of a column's variance on these samples."""
TRAINING = 0.7
"""Share of the samples that are fitted for this test."""

Entries = dict[tuple[int, int], float]
"""Values of C[j, i] by (j, i)."""


@dataclass(frozen=True, slots=True, eq=False)
class ProposedCoupling:
    """Motors that seem to drive several joints: m joints, with q_joint = matrix q_motor.

    joints         names of the joints, in the order of the model
    matrix, std    (m, m) C and the standard deviations of its entries; zero for entries that are given
    of_motors      whether the positions of the log belong to the motors, as its efforts do
    explains       largest share of what is left of a joint's torque that the coupling explains
    before, after  (m,) R^2 of the joints' columns without and with the coupling, on samples that were not fitted
    """

    joints: tuple[str, ...]
    matrix: Array
    std: Array
    of_motors: bool
    explains: float
    before: tuple[float, ...]
    after: tuple[float, ...]

    @property
    def values(self) -> dict[str, Any]:
        """Return the proposal as plain numbers and texts, for a verdict's doubt, the report and the JSON."""
        n = len(self.joints)
        entries = [
            {
                "motor": self.joints[i],
                "joint": self.joints[j],
                "ratio": float(self.matrix[j, i]),
                "std": float(self.std[j, i]),
            }
            for j in range(n)
            for i in range(n)
            if self.std[j, i] > 0.0
        ]
        quality = [
            {"joint": name, "before": before, "after": after}
            for name, before, after in zip(self.joints, self.before, self.after, strict=True)
        ]
        return {
            "items": entries,
            "r2": quality,
            "explains": self.explains,
            "positions_of_motors": self.of_motors,
            "toml": self.toml,
        }

    @property
    def toml(self) -> str:
        """Return the lines of a log description that describe the coupling."""
        names = json.dumps(self.joints, ensure_ascii=False)
        rows = ", ".join(
            "[" + ", ".join(rounded(x, s) for x, s in zip(row, spread, strict=True)) + "]"
            for row, spread in zip(self.matrix.tolist(), self.std.tolist(), strict=True)
        )
        lines = ["[[coupling]]", f"joints = {names}", f"matrix = [{rows}]"]
        return "\n".join(lines if self.of_motors else [*lines, 'quantities = ["effort"]'])


def rounded(value: float, std: float) -> str:
    """Return a number with two digits of its standard deviation; an exact number as short as possible."""
    if not std > 0.0:
        return f"{value:g}"
    return f"{value:.{min(max(0, 1 - int(np.floor(np.log10(std)))), 9)}f}"


def proposed_coupling(evidence: Evidence) -> ProposedCoupling | None:
    """Return the coupling of motors that explains the log far better than motors which drive one joint each; None if
    there is none, or if the log description describes one."""
    if evidence.coupling is not None or evidence.n < 2 or not np.any(evidence.torque):
        return None
    samples = _Samples(evidence)
    plain = samples.fitted({}, False)
    if plain.sums.freedom <= 0:
        return None
    tried = [
        _entries(samples, replace(plain, of_motors=kind), towards)
        for kind in (False, True)
        for towards in (1, -1)
    ]
    tried.sort(key=lambda one: plain.likelier(one[0]), reverse=True)
    proposed = (_proposed(samples, plain, found, spread) for found, spread in tried)
    return next((one for one in proposed if one is not None), None)


def _proposed(samples: _Samples, plain: _Coupled, found: _Coupled, spread: Array) -> ProposedCoupling | None:
    """The proposal of these entries; None where the coupled joints' torques are not predicted far better with them."""
    if not found.entries or not plain.explained(found.fit) > TOGETHER:
        return None
    places = sorted({k for entry in found.entries for k in entry})
    before, after = (samples.held_out(one)[places] for one in (plain, found))
    left = (1.0 - after) / np.maximum(1.0 - before, 1e-12)
    if not np.all(after > FOLLOWED) or left.max() > WORSE or left.min() > 1.0 - EXPLAINS:
        return None
    n, values = samples.n, dict(zip(found.entries, spread.tolist(), strict=True))
    own = np.ix_(places, places)
    return ProposedCoupling(
        tuple(samples.names[k] for k in places),
        _matrix(n, found.entries)[own],
        (_matrix(n, values) - np.eye(n))[own],
        found.of_motors,
        plain.explained(found.fit),
        tuple(before.tolist()),
        tuple(after.tolist()),
    )


def _matrix(n: int, entries: Entries) -> Array:
    matrix = np.eye(n)
    for place, value in entries.items():
        matrix[place] = value
    return matrix


@dataclass(frozen=True, slots=True, eq=False)
class _Coupled:
    """A fit of the samples with some entries, and its design (N, n, p): torques of the motors per unit of unknowns."""

    entries: Entries
    of_motors: bool
    design: Array
    sums: Sums
    fit: Fit

    def likelier(self, other: _Coupled) -> float:
        """Return the logarithm of the ratio of the other fit's likelihood to this one's."""
        return self.sums.likelier(self.fit, other.fit)

    def explained(self, fit: Fit) -> float:
        """Return the largest share of what is left of a joint's torque that another fit explains."""
        return float(np.max(1.0 - (fit.scatter / self.fit.scatter) ** 2))


class _Samples:
    """Samples that are fitted with entries of C."""

    def __init__(self, evidence: Evidence) -> None:
        def joined(name: str) -> Array:
            whole = np.concatenate([getattr(log, name) for log in evidence.shifted])
            return np.asarray(whole[:: max(1, -(-len(whole) // ROWS))])

        self.n, self.names, self.regressor = evidence.n, evidence.model.v_names, evidence.regressor
        self.units = [joint.type.position_unit for joint in evidence.model.mechanism.leading_joints]
        self.q, self.qd, self.qdd, self.sign = (joined(name) for name in ("q", "qd", "qdd", "sign"))
        self.speeds, self.kernel = joined("speeds"), evidence.shifted[0].kernel
        now = int(np.abs(evidence.shifted[0].lags).argmin())
        self.torque = joined("torque")[:, :, now]
        self.as_logged = self.regressor.regressor(self.q, self.qd, self.qdd)

    def alike(self, j: int, i: int) -> bool:
        """Return whether both joints exist, and both turn or both slide."""
        return 0 <= j < self.n and self.units[j] == self.units[i]

    def design(self, entries: Entries, of_motors: bool) -> Array:
        """Return the torques of the motors (N, n, l + 3 n) per unit of each unknown. The unknowns are base parameters,
        and Coulomb friction, viscous friction and offset of each motor."""
        n = self.n
        coupling = Coupling.of(_matrix(n, entries).tolist())
        speed, sign, rigid = self.qd, self.sign.copy(), self.as_logged
        if of_motors and entries:
            motion = (coupling.to_joints(part) for part in (self.q, self.qd, self.qdd))
            rigid = self.regressor.regressor(*motion)
        elif entries:
            speed = coupling.to_motors(speed)
            changed = np.flatnonzero(np.any(coupling.inverse != np.eye(n), axis=1))
            speeds = self.speeds @ coupling.inverse[changed].T
            sign[:, changed] = np.einsum("tkm,k->tm", np.tanh(speeds / SIGN_SPEED), self.kernel)
        own = [part[:, :, None] * np.eye(n) for part in (sign, speed, np.ones_like(speed))]
        return np.concatenate([np.einsum("tjl,jk->tkl", rigid, coupling.matrix), *own], axis=2)

    def fitted(self, entries: Entries, of_motors: bool) -> _Coupled:
        """Return the fit of base parameters and friction with some entries."""
        design = self.design(entries, of_motors)
        sums = Sums(design, [], self.torque)
        return _Coupled(entries, of_motors, design, sums, sums.fitted(()))

    def slopes(self, found: _Coupled) -> Array:
        """Return the change of the motors' torques (N, n, entries) per unit of each entry, at the fitted values."""
        values = found.sums.values((), found.fit.weights)
        slopes = [
            (self.design(found.entries | {place: value + DIFFERENCE}, found.of_motors) - found.design)
            @ values
            for place, value in found.entries.items()
        ]
        return np.stack(slopes, axis=2) / DIFFERENCE

    def exact(self, entries: Entries, of_motors: bool) -> _Coupled:
        """Return the best fit of some entries, by Gauss-Newton steps from these values."""
        best = found = self.fitted(entries, of_motors)
        for _ in range(STEPS):
            sums = Sums(found.design, [self.slopes(found)], self.torque)
            change = sums.values((0,), found.fit.weights)[-len(entries) :].clip(-LONGEST, LONGEST)
            values = np.array(list(found.entries.values())) + change
            if not np.all(np.abs(values) < LARGEST):
                break
            found = self.fitted(dict(zip(entries, values.tolist(), strict=True)), of_motors)
            best = found if best.likelier(found) > 0.0 else best
            if np.all(np.abs(change) < SETTLED):
                break
        return best

    def std(self, found: _Coupled) -> Array:
        """Return the standard deviations of the entries: the larger of that from stretches of time and that from the
        residuals' autocorrelation."""
        slopes, w, m = self.slopes(found), found.fit.weights, len(found.entries)
        sums = Sums(found.design, [slopes], self.torque)
        _, covariance = sums.last(found.fit, (0,), found.design, slopes, self.torque)
        whole = np.concatenate([found.design, slopes], axis=2) * w[:, None]
        left = self.torque * w - whole @ sums.values((0,), w)
        level = np.mean(left**2, axis=0) * widening(left, np.ones(left.shape, dtype=bool)) ** 2
        sizes = np.linalg.norm(whole.reshape(-1, whole.shape[2]), axis=0)
        unit = np.where(sizes > 0.0, sizes, 1.0)
        scaled = whole / unit
        squares = np.stack([scaled[:, k].T @ scaled[:, k] for k in range(self.n)])
        inverse = np.linalg.pinv(squares.sum(axis=0), rcond=RANK_TOLERANCE**2, hermitian=True)
        by_noise = np.diag(inverse @ np.tensordot(level, squares, axes=1) @ inverse) / unit**2
        # Torques that an entry does not change say nothing of it.
        by_noise = np.where(sizes > 0.0, by_noise, np.inf)
        return np.asarray(np.sqrt(np.maximum(np.diag(covariance), by_noise[-m:])))

    def held_out(self, found: _Coupled) -> Array:
        """Return R^2 (n,) of the motors' columns in the last samples, by a fit to the first."""
        first = round(TRAINING * len(self.torque))
        sums = Sums(found.design[:first], [], self.torque[:first])
        predicted = found.design[first:] @ sums.values((), sums.fitted(()).weights)
        return np.array([quality(self.torque[first:, k], predicted[:, k]).r2 for k in range(self.n)])


def _entries(samples: _Samples, found: _Coupled, towards: int) -> tuple[_Coupled, Array]:
    """The fit with all entries that are significant and explain enough, and their standard deviations.

    towards  1: motors also move later joints, 2, 3 ... after theirs; -1: earlier ones. C is then triangular, and has an
             inverse.
    """
    spread = np.zeros(0)
    for _ in range(MOST_ENTRIES):
        near = [(i + towards * k, i) for i in range(samples.n) for k in range(1, REACH + 1)]
        pairs = [(j, i) for j, i in near if (j, i) not in found.entries and samples.alike(j, i)]
        starts = _first_values(samples, found, pairs) if pairs else []
        tried = [samples.exact(found.entries | start, found.of_motors) for start in starts]
        if not tried:
            break
        best = max(tried, key=found.likelier)
        std, value = samples.std(best), list(best.entries.values())[-1]
        if not abs(value) > max(LEAST, SURE * std[-1]) or not found.explained(best.fit) > EXPLAINS:
            break
        found, spread = best, std
    return found, spread


def _first_values(samples: _Samples, found: _Coupled, pairs: Sequence[tuple[int, int]]) -> list[Entries]:
    """The entries that explain most at first, with their first values: coefficients of measured torques of the joints.

    Beside it, friction of either joint is allowed in the column of the other.
    """
    columns = []
    torque = Coupling.of(_matrix(samples.n, found.entries).tolist()).torque_of_joints(samples.torque)
    for j, i in pairs:
        own = np.zeros((len(torque), samples.n, 5))
        own[:, i, :3] = np.stack([torque[:, j], samples.sign[:, j], samples.qd[:, j]], axis=1)
        own[:, j, 3:] = np.stack([samples.sign[:, i], samples.qd[:, i]], axis=1)
        columns.append(own)
    sums = Sums(found.design, columns, samples.torque)
    fits = [sums.fitted((k,)) for k in range(len(pairs))]
    gained = [sums.likelier(found.fit, fit) for fit in fits]
    order = [k for k in np.argsort(gained)[::-1].tolist() if found.explained(fits[k]) > WORTH_TRYING]
    first = {k: float(sums.values((k,), fits[k].weights)[-5]) for k in order[:TRIED]}
    return [{pairs[k]: min(max(value, -LARGEST), LARGEST)} for k, value in first.items()]
