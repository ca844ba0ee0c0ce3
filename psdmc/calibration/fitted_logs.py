"""Makes the final result of a linear fit of plain logs. It is unconstrained or physically possible, and has all
parameters or only those that the data need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

from psdmc.calibration.identify.essential import Essential, EssentialOptions, essential
from psdmc.calibration.identify.friction_drift import FrictionDrift, friction_drift
from psdmc.calibration.identify.knowledge import Knowledge
from psdmc.calibration.identify.linear_fit import LinearResult
from psdmc.calibration.identify.linear_options import LinearOptions
from psdmc.calibration.identify.log_information import ALONE, MAIN_SHARE, LogInformation, log_information
from psdmc.calibration.identify.physical import NotPhysical, Physical, nearest_physical
from psdmc.calibration.identify.stated_prior import theta_covariance, with_prior
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.stored_log import AnyLog
from psdmc.calibration.verdict.judge import NOT_PHYSICAL, ODD_LOGS
from psdmc.calibration.verdict.record import Calibration, judged_record, linear_record, with_data, with_model
from psdmc.errors import InputError, InternalError
from psdmc.links.link_terms import PhysicalOptions
from psdmc.model.calibrated import FRICTION_DRIFT, LOG_INFORMATION
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.progress import Progress

MOST_NAMED = 12
"""Dropped parameters that a note names."""
MOST_ALONE = 3
"""Parameters that depend on one log alone and that a note names."""


@dataclass(frozen=True, slots=True, eq=False)
class LogFit:
    """Data that all results of one linear fit need.

    logs         logs that were fitted
    physical     whether the result must be physically possible
    consistency  options of the search for a physically possible result
    known        what the user knows of the links before the fit, such as bounds of masses
    """

    model: DynamicsModel
    logs: Sequence[AnyLog]
    linear: LinearOptions
    physical: bool
    consistency: PhysicalOptions
    known: Knowledge
    progress: Progress

    def record(self, found: LinearResult) -> Calibration:
        """Return the final result of a linear fit. As the options say, it uses what the user knows of the links, is
        physically possible, and drops parameters that the data do not need."""
        if len(self.known.bounds) and not self.physical:
            raise InputError(
                "[[bodies]] bounds masses or centres of mass, and the unconstrained fit knows none",
                "leave out --no-physical, or the bounds",
            )
        self.progress("comparing logs")
        logs = log_information(found.problem, found.estimate, [log.name for log in self.logs])
        drifts = friction_drift(found.problem, found.estimate, [log.name for log in self.logs])
        unstated, found = found, self._with_prior(found)
        self.progress("reading the result back")
        result = self._consistent(found)
        if self.known.essential is not None:
            result = self._essential(found, result, self.known.essential)
        result = result if logs is None else with_log_information(result, logs, unstated)
        return with_drift(result, drifts)

    def _with_prior(self, found: LinearResult) -> LinearResult:
        if not self.known.confidence:
            return found
        known = self.model.file_theta_b
        if known is None:
            raise InternalError(f"{self.model.mechanism.name}: a confidence without values")
        covariance = theta_covariance(self.model, dict(self.known.confidence), found.prior.scale)
        joined = with_prior(found.estimate, known, covariance, self.model.unknown_base_parameters)
        return replace(found, estimate=joined, stated=True)

    def _essential(self, found: LinearResult, whole: Calibration, options: EssentialOptions) -> Calibration:
        self.progress("essential parameters")
        lesser = essential(found.estimate, found.prior.values, found.samples, options, self.linear.fit)
        fewer = self._consistent(replace(found, estimate=lesser.estimate, dropped=lesser.dropped))
        return with_price(fewer, whole, lesser, (*self.model.base_parameters.labels, *found.problem.names))

    def _consistent(self, found: LinearResult) -> Calibration:
        """The physically consistent record where it is wanted and exists; else the unconstrained one, with a note."""
        plain = judged_record(self._of(found, found.estimate.values), self.logs, check=self.linear.check)
        if not self.physical:
            return plain
        self.progress("physical consistency")
        try:
            near = self._nearest(found)
        except NotPhysical as error:
            return replace(plain, facts={**plain.facts, NOT_PHYSICAL: error.message})
        record = self._of(found, near.values)
        reached = self.known.bounds.reached(near.x)
        if reached:
            record = replace(
                record, notes=(*record.notes, f"bounds of [[bodies]] that are reached: {'; '.join(reached)}")
            )
        return judged_record(record, self.logs, plain, near.distance, self.linear.check)

    def _nearest(self, found: LinearResult) -> Physical:
        options = self.consistency
        if found.stated:  # the file's bodies are in the estimate: resembling them must not count twice
            options = replace(options, known_body=options.unknown_body)
        problem, solved = found.problem, found.estimate
        return nearest_physical(
            self.model,
            solved.values,
            solved.whitening,
            problem.never_negative,
            options,
            problem.limits,
            found.dropped,
            self.known.bounds,
        )

    def _of(self, found: LinearResult, values: Array) -> Calibration:
        return with_data(linear_record(self.model, found, values, self.linear), self.logs)


def with_price(
    fewer: Calibration, whole: Calibration, lesser: Essential, names: Sequence[str]
) -> Calibration:
    """Return the result `fewer`, which has essential parameters only, with a note for the user. The note says which
    parameters were dropped, and how the accuracy on held-out data changed compared with the result `whole`. Both
    accuracies are computed from the contents of model files.

    lesser  the estimate in which parameters were dropped
    names   names of all parameters
    """
    gone = [name for name, is_dropped in zip(names, lesser.dropped.tolist(), strict=True) if is_dropped]
    before, after = whole.steps[-1].joints, fewer.steps[-1].joints
    cost = {name: before[name].held_out.r2 - after[name].held_out.r2 for name in after}
    facts = {"dropped": gone, "essential_cost_r2": cost, "f_of_dropped": lesser.f, "f_limit": lesser.limit}
    words = ", ".join(f"{name} {-price:+.4f}" for name, price in cost.items())
    more = f" and {len(gone) - MOST_NAMED} more" if len(gone) > MOST_NAMED else ""
    note = (
        f"essential parameters: {len(names) - len(gone)} of {len(names)} are kept; {len(gone)} keep their "
        "prior values, from which the log does not differ significantly"
        + (
            f" (F = {lesser.f:.2f}, at most {lesser.limit:.2f}): {', '.join(gone[:MOST_NAMED])}{more}"
            if gone
            else ""
        )
        + f"; change of held-out R^2: {words}"
    )
    return with_model(replace(fewer, facts={**fewer.facts, **facts}, notes=(*fewer.notes, note)))


def with_log_information(record: Calibration, logs: LogInformation, found: LinearResult) -> Calibration:
    """Return the result of a fit of several logs with the share of each log in the information of each parameter.

    The result also has the logs that contradict the others, from which the verdict's doubts follow. Notes name
    parameters that depend on one log alone, and logs with a larger residual than the others.
    """
    of_bodies = [row.name for row in record.parameters]
    names = (*of_bodies, *found.problem.names)
    seen = [k for k, is_seen in enumerate(found.estimate.identifiable.tolist()) if is_seen]
    rows = [
        {
            "name": names[k],
            "shares": logs.shares[:, k].tolist(),
            "std_without": logs.std_without[:, k].tolist(),
        }
        for k in seen
    ]
    notes = []
    grown, share = logs.std_without.max(axis=0), logs.shares.max(axis=0)
    alone = [k for k in seen if grown[k] > ALONE and share[k] > MAIN_SHARE]
    alone.sort(key=lambda k: (-grown[k], -share[k]))
    if alone:
        named = [
            f"{names[k]} ({logs.logs[i]}: {logs.shares[i, k]:.0%} of its information)"
            for k in alone[:MOST_ALONE]
            for i in [int(logs.shares[:, k].argmax())]
        ]
        more = f" and {len(alone) - MOST_ALONE} more" if len(alone) > MOST_ALONE else ""
        notes.append(f"parameters that depend on one log alone: {', '.join(named)}{more}")
    notes += [
        f"{name}: its residual is {ratio:.1f} times that of the other logs (median), which agree with it"
        for name, ratio in logs.noisier
        if name not in [each["log"] for each in logs.odd]
    ]
    facts = {
        **record.facts,
        LOG_INFORMATION: {
            "logs": list(logs.logs),
            "chi_square_per_degree": logs.statistics.tolist(),
            "parameters": rows,
        },
        ODD_LOGS: {"disagree": logs.disagree, "items": [dict(each) for each in logs.odd]},
    }
    return with_model(replace(record, facts=facts, notes=(*record.notes, *notes)))


def with_drift(record: Calibration, drifts: Sequence[FrictionDrift]) -> Calibration:
    """Return the result with the change of each joint's friction over each log, from which a doubt may follow."""
    if not drifts:
        return record
    return with_model(
        replace(record, facts={**record.facts, FRICTION_DRIFT: [asdict(each) for each in drifts]})
    )
