"""Finds what has changed on a robot: how all values of a calibrated file differ in new logs, and which few changes
explain this."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from psdmc.calibration.identify.estimate import Estimate
from psdmc.calibration.identify.least_squares import estimate_rows
from psdmc.calibration.identify.linear_fit import LinearResult
from psdmc.calibration.logs.log import Array
from psdmc.calibration.verdict.delivered import Delivered, PredictedRows
from psdmc.errors import InputError
from psdmc.model.bodies import load_map
from psdmc.model.calibrated import OrNaN, by_joint
from psdmc.model.grounds import OrInf

CHANCE = 1e-3
"""Probability of a chi-square as large in an unchanged robot, below which a change counts: one false alarm in a thousand
logs."""
NOTICED = 0.5
"""Torque of all changes, as a share of the error that remains, from which they count: some joint's RMS error is then larger
by an eighth than that of a new fit, on samples that this fit did not use. A smaller change does not matter."""
MINOR = 0.1
"""The same share for one of several changes to be named."""
FELT = 0.005
"""RMS torque of all changes of a joint, as a share of the joint's RMS torque, from which they count: torque sensors and
torque constants are hardly better. A controller notices ten times as much (compared.NOTICEABLE). Without noise, filters and
differences of samples alone cause up to a tenth of it."""
SMALLEST = 0.005
"""Share of its value in the file by which a named value has changed at least: less would be printed as 0 %."""
SURE = 3.0
"""Standard deviations that a named change has at least."""
MOST_NAMED = 8
"""Changes that an explanation may have. More than that is another robot, not a worn one."""
RESOLVED = 1e-3
"""Share of a load's mass that may be seen as something else."""


@dataclass(frozen=True, slots=True)
class Change:
    """One value of a calibrated file, such as a base parameter, and how much it differs in new logs.

    value   value in the file
    change  difference of the value that fits the logs from the value in the file
    std     standard deviation of the difference; infinite if the logs do not determine the value by itself
    torque  RMS over the samples of the torque that the difference causes, N m (N); largest of all joints
    """

    name: str
    equation: str
    unit: str
    value: float
    change: float
    std: OrInf
    torque: float

    @property
    def sigmas(self) -> float:
        return self.change / self.std if self.std else 0.0

    @property
    def words(self) -> str:
        share = f" ({self.change / self.value:+.0%})" if self.value else ""
        return (
            f"{self.name}: {self.value:.4g} -> {self.value + self.change:.4g} {self.unit}{share}, "
            f"{self.sigmas:+.1f} standard deviations"
        )


@dataclass(frozen=True, slots=True)
class LoadChange:
    """A load at the tip that explains the logs: mass, kg, and centre of mass (3,), m, in the tip frame. If a load was
    removed, the mass is negative. A value that the logs do not show is NaN."""

    mass: float
    mass_std: float
    com: tuple[OrNaN, ...]
    frame: str

    @property
    def words(self) -> str:
        place = ", ".join("not seen" if math.isnan(value) else f"{value:.3f}" for value in self.com)
        return f"a load of {self.mass:+.3g} +- {self.mass_std:.2g} kg on {self.frame!r}, its centre of mass at ({place}) m"


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """A load at the tip and changed values of the calibrated file that together explain new logs.

    values  (u,) differences of all u values of the file, theta_b first
    of_load (u,) those of them that the load makes
    load    the load; None: no load is needed
    named   the changed values
    left    chi-square of the differences that remain unexplained
    chosen  number of explaining items: each changed value, and the load, counts as one
    """

    values: Array
    of_load: Array
    load: LoadChange | None = None
    named: tuple[Change, ...] = ()
    left: OrNaN = float("nan")
    chosen: int = 0


class Changes:
    """The differences of all u values of a calibrated file (theta_b first, then friction) that fit new logs best.

    white     (r,) the differences in r independent directions that the logs determine, in standard deviations. The
              standard deviations are those of file and logs together
    by_value  (r, u) the entries of `white` for a difference of one in each value
    noticed   whether some joint's torque differs by enough to matter
    """

    def __init__(self, found: Delivered, fit: LinearResult, rows: PredictedRows) -> None:
        problem = fit.problem
        self.found, self.fit, self.rows = found, fit, rows
        use = np.repeat(~problem.held_out[:, None], problem.chain.nv, axis=1)
        prior = replace(fit.prior, values=np.zeros_like(fit.prior.values))
        residual = rows.measured - rows.predicted
        options = found.linear.fit
        solved = estimate_rows(problem.rows, residual, options, None, use, prior)
        scale = solved.scale
        together = solved.total_covariance + _file_covariance(found, fit, solved)
        hidden = solved.unseen.shape[1]
        shown = np.linalg.qr(solved.unseen, mode="complete")[0][:, hidden:]
        lower = np.linalg.cholesky(shown.T @ (together / np.outer(scale, scale)) @ shown)
        self.by_value: Array = np.asarray(np.linalg.solve(lower, shown.T / scale))
        self.white: Array = self.by_value @ solved.values
        self.chi2, self.freedom, self.size = float(self.white @ self.white), len(self.white), len(scale)
        left = residual - self.torque(solved.values)
        self.noise: Array = np.maximum(np.sqrt(np.mean(left**2, axis=0)), np.finfo(float).tiny)
        before, after = (np.mean(part[problem.held_out] ** 2, axis=0) for part in (residual, left))
        self.felt: Array = FELT * np.sqrt(np.mean(rows.measured**2, axis=0))
        matters = (before > (1.0 + NOTICED**2) * after) & (before - after > self.felt**2)
        self.noticed = bool(np.any(matters))
        squares = sum(np.sum(block.columns**2, axis=0) for block in problem.rows)
        self.effect: Array = np.asarray(np.sqrt(squares / len(residual)))
        seen = np.sum(solved.unseen**2, axis=1) < options.unseen_share
        self.std: Array = np.where(seen, np.sqrt(np.diag(together)), np.inf)
        self.changes = tuple(
            self._change(k, float(solved.values[k]), float(self.std[k])) for k in range(len(scale))
        )

    @property
    def chance(self) -> float:
        """Probability that the logs of an unchanged robot differ from the calibrated file by at least as much.

        The measure of the difference is chi-square or the largest change of a single value, whichever is less probable.
        """
        sizes = np.linalg.norm(self.by_value, axis=0)
        alone = (self.by_value.T @ self.white) / np.where(sizes > 0.0, sizes, np.inf)
        single = len(sizes) * stats.chi2.sf(np.max(alone**2, initial=0.0), 1)
        return float(min(1.0, 2.0 * min(stats.chi2.sf(self.chi2, self.freedom), single)))

    def torque(self, values: Array) -> Array:
        """Return the torques (N, n) that given changes (u,) of all calibrated values cause at N samples of n joints."""
        return np.concatenate([block.columns @ values for block in self.fit.problem.rows])

    def _change(self, k: int, change: float, std: float) -> Change:
        model, problem = self.found.model, self.fit.problem
        torque = float(np.max(self.effect[:, k])) * abs(change)
        if k < model.l:
            row = model.base_parameters[k]
            value = float(model.known_theta_b()[k])
            return Change(f"theta_b[{k}]", row.equation, row.unit, value, change, std, torque)
        kept = model.calibrated
        assert kept is not None
        owner, name = problem.owners[k - model.l]
        rows = {(row.joint, row.name): row for row in (*kept.friction, *kept.springs)}
        row_of = rows.get((owner, name))
        unit = "" if row_of is None else row_of.unit
        value = 0.0 if row_of is None else row_of.value
        return Change(f"{name} of {owner}", "", unit, value, change, std, torque)

    def explanation(self) -> Explanation:
        """Return the load and the few changed values that explain the difference between a calibrated file and new
        logs.

        In each step, the item that explains most of chi-square is added. The search ends if the remaining differences
        are no more than chance. A load has more parameters than a single value, so it explains more by chance.
        Therefore each parameter has a cost. But a load changes more often than a link, so a base parameter costs as
        much as a load if a load is possible. A load that nobody would feel is no explanation.
        """
        found = self._search(with_load=True)
        if found.load is None:
            return found
        is_felt = np.any(np.sqrt(np.mean(self.torque(found.of_load) ** 2, axis=0)) > self.felt)
        return found if is_felt else self._search(with_load=False)

    def _search(self, with_load: bool) -> Explanation:
        price = float(stats.chi2.isf(CHANCE / self.size, 1))
        blocks = {k: self.by_value[:, [k]] for k in range(self.size) if self.by_value[:, k].any()}
        onto = self._load_onto_values() if with_load else None
        cost = price
        if onto is not None and self._mass_is_sure(load := self.by_value @ onto):
            blocks[LOAD] = load
            cost = price * float(
                np.linalg.matrix_rank(load / np.maximum(np.linalg.norm(load, axis=0), 1e-300))
            )
        chosen: list[int] = []
        while len(chosen) < MOST_NAMED:
            left = self._left(blocks, chosen)
            links = price if LOAD in chosen else cost
            gains = {
                k: left @ left - np.sum(self._left(blocks, [*chosen, k]) ** 2)
                for k in blocks
                if k not in chosen
            }
            gains = {
                k: gain - (links if k < self.found.model.l else price)
                for k, gain in gains.items()
                if gain > price
            }
            if not gains:
                break
            chosen.append(max(gains, key=lambda k: gains[k]))
        return self._delivered(blocks, chosen, onto)

    def _left(self, blocks: Mapping[int, Array], chosen: Sequence[int]) -> Array:
        """(r,) what changes of the chosen blocks leave."""
        if not chosen:
            return self.white
        return np.asarray(self.white - (a := _joined(blocks, chosen)) @ _solved(a, self.white)[0])

    def _mass_is_sure(self, block: Array) -> bool:
        """Whether the logs show a load's mass by itself, and it is not zero."""
        values, covariance = _solved(block, self.white)
        return bool(_resolved(block, 0) and abs(values[0]) > SURE * np.sqrt(covariance[0, 0]) > 0.0)

    @property
    def refuses_load(self) -> str:
        """Why no load at the tip can explain anything, as a sentence; empty if one can."""
        model = self.found.model
        try:
            load_map(model.mechanism, model.B, model.mechanism.tip_frame)
        except InputError as error:
            return f"{error.message}: {error.hint}"
        return ""

    def _load_onto_values(self) -> Array | None:
        """(u, 10) change of all values per load parameter; None if the model admits no load at its tip."""
        if self.refuses_load:
            return None
        model = self.found.model
        onto = load_map(model.mechanism, model.B, model.mechanism.tip_frame)
        return np.concatenate([onto, np.zeros((self.by_value.shape[1] - model.l, onto.shape[1]))])

    def _delivered(
        self, blocks: Mapping[int, Array], chosen: Sequence[int], onto: Array | None
    ) -> Explanation:
        whole = np.zeros(self.by_value.shape[1])
        if not chosen:
            return Explanation(whole, whole, left=self.chi2)
        values, covariance = _solved(_joined(blocks, chosen), self.white)
        std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        load, of_load, named, first = None, np.zeros_like(whole), [], 0
        for k in chosen:
            own = slice(first, first + blocks[k].shape[1])
            first = own.stop
            if k == LOAD and onto is not None:
                of_load = onto @ values[own]
                mass = float(values[own][0])
                shown = [_resolved(blocks[k], axis) for axis in (1, 2, 3)]
                com = tuple(np.where(shown, values[own][1:4] / mass, np.nan).tolist())
                load = LoadChange(mass, float(std[own][0]), com, self.found.model.mechanism.tip_name)
                continue
            whole[k] += values[own][0]
            change = self._change(k, float(values[own][0]), float(std[own][0]))
            if self._is_named(k, change):
                named.append(change)
        left = self._left(blocks, chosen)
        return Explanation(whole + of_load, of_load, load, tuple(named), float(left @ left), len(chosen))

    def _is_named(self, k: int, change: Change) -> bool:
        """Whether a change of value k is certain, changes some joint's torque by a share of what counts, and is not 0 %."""
        least = MINOR * np.maximum(self.noise, self.felt / NOTICED)
        felt = bool(np.any(self.effect[:, k] * abs(change.change) > least))
        return felt and abs(change.sigmas) > SURE and abs(change.change) > SMALLEST * abs(change.value)


LOAD = -2
"""The block of a load's ten parameters among those of single values."""


def _joined(blocks: Mapping[int, Array], chosen: Sequence[int]) -> Array:
    return np.concatenate([blocks[k] for k in chosen], axis=1)


def _solved(columns: Array, white: Array) -> tuple[Array, Array]:
    """Least-squares values of columns, and their covariance; of what the columns do not show nothing."""
    sizes = np.linalg.norm(columns, axis=0)
    sizes[sizes == 0.0] = 1.0
    inverse = np.linalg.pinv(columns / sizes, rcond=1e-9) / sizes[:, None]
    return np.asarray(inverse @ white), np.asarray(inverse @ inverse.T)


def _resolved(columns: Array, k: int) -> bool:
    """Whether the value of column k shows by itself."""
    return bool(abs(_solved(columns, columns[:, k])[0][k] - 1.0) < RESOLVED)


def _file_covariance(found: Delivered, fit: LinearResult, solved: Estimate) -> Array:
    """(u, u) of the file's values. Friction, of which files keep standard deviations only, is taken as correlated like the
    new logs' friction is, and as independent of theta_b; what the file does not know as far off as is believable.

    Standard deviations of the file are those of noise in the fitted motion. They are widened by how much larger the errors
    of the calibration's test are: friction's by those of its joint, theta_b's by the worst of all joints.
    """
    kept, l = found.model.calibrated, found.model.l
    assert kept is not None
    believable = found.linear.fit.seen * solved.scale
    stds = by_joint(replace(row, value=row.std) for row in (*kept.friction, *kept.springs))
    owners = fit.problem.owners
    worst = max(found.misfit.values(), default=1.0)
    wider = [found.misfit.get(owner, worst) for owner, _ in owners]
    std = np.array([*kept.std, *(stds.get(owner, np.inf) for owner in owners)]) * [*[worst] * l, *wider]
    std = np.where(np.isfinite(std) & (std > 0.0), std, believable)
    sizes = np.sqrt(np.diag(solved.total_covariance))
    sizes[sizes == 0.0] = np.inf
    covariance = solved.total_covariance / np.outer(sizes, sizes)
    np.fill_diagonal(covariance, 1.0)
    covariance *= np.outer(std, std)
    covariance[:l, l:] = covariance[l:, :l] = 0.0
    covariance[:l, :l] = np.diag(std[:l] ** 2)
    if kept.covariance is not None:
        own = np.sqrt(np.diag(kept.covariance))
        missing = np.where(own > 0.0, 0.0, believable[:l])
        covariance[:l, :l] = worst**2 * kept.covariance + np.diag(missing**2)
    return np.asarray(covariance)
