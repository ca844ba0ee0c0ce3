"""Calibrates a model from log files: in four steps from a campaign, or by one linear fit from plain logs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from psdmc.calibration.campaign_file import plain_logs, read_campaign
from psdmc.calibration.description.description import FitChoice
from psdmc.calibration.identify.four_steps import (
    FourSteps,
    Runs,
    calibrate_four_steps,
    physical_steps,
)
from psdmc.calibration.identify.joint_elasticity import elastic_joints, joint_elasticity
from psdmc.calibration.identify.knowledge import Knowledge, knowledge_of, theta_covariance, with_prior
from psdmc.calibration.identify.linear_fit import LinearResult, calibrate_linear
from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.identify.log_information import (
    ALONE,
    MAIN_SHARE,
    LogInformation,
    friction_drift,
    log_information,
)
from psdmc.calibration.identify.motor_model import motors_of_logs
from psdmc.calibration.identify.physical import NotPhysical, Physical, nearest_physical
from psdmc.calibration.identify.predictor import ChainRegressor, Regressor
from psdmc.calibration.identify.steps import CalibrationOptions
from psdmc.calibration.identify.visibility import Essential, EssentialOptions, essential
from psdmc.calibration.known_load import KnownLoad
from psdmc.calibration.logs.log import AnyLog, Array
from psdmc.calibration.motors_of_loads import LoadedLogs, motors_with_load, with_loaded_logs
from psdmc.calibration.sources import LogNaming, campaign_of, log_sources
from psdmc.calibration.verdict.judge import (
    NOT_PHYSICAL,
    ODD_LOGS,
    with_verdict_on_campaign,
    with_verdict_on_logs,
)
from psdmc.calibration.verdict.record import (
    Calibration,
    four_step_record,
    judged_record,
    linear_record,
    with_data,
    with_model,
)
from psdmc.calibration.verdict.verdict_limits import VerdictOptions
from psdmc.errors import InputError, InternalError
from psdmc.links.pseudo_inertias import PhysicalOptions, require_cvxpy
from psdmc.model.calibrated import FRICTION_DRIFT, LOG_INFORMATION
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.progress import Progress
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import require_axes, require_no_loops

CAMPAIGN_FRICTION = (0.5, 1.0)
"""Exponents of viscous friction that is fitted with the stiffness of elastic joints in a campaign."""


@dataclass(frozen=True, slots=True)
class CalibrateOptions:
    """Options of `psdmc calibrate`.

    physical     True: the result must be physically possible, which means real bodies, and no negative drive inertia or
                 friction; False: the result is the unconstrained fit
    campaign     options of a calibration in four steps (motors, gravity, friction, inertia)
    linear       options of the linear fit of plain logs
    consistency  options of the search for a physically possible result
    verdict      limits from which the verdict (usable or not) follows
    choice       options of the linear fit that the user typed; they replace those of a log description. For plain logs
    prior_confidence  relative standard deviation of the file's masses and inertias about the centres of mass, which
                      then act as a prior. A centre of mass has this share of its link's radius of gyration. None: no
                      prior. For plain logs
    essential    how parameters that the data do not need are dropped; None: all are kept. For plain logs
    """

    physical: bool = True
    campaign: CalibrationOptions = field(default_factory=CalibrationOptions)
    linear: LinearOptions = field(default_factory=LinearOptions)
    consistency: PhysicalOptions = field(default_factory=PhysicalOptions)
    verdict: VerdictOptions = field(default_factory=VerdictOptions)
    choice: FitChoice = field(default_factory=FitChoice)
    prior_confidence: float | None = None
    essential: EssentialOptions | None = None


def calibrate(
    model: DynamicsModel,
    sources: str | Path | Sequence[str | Path],
    options: CalibrateOptions | None = None,
    *,
    regressor: Regressor | None = None,
    torque_constants: Mapping[str, float] | None = None,
    validation: str | Path | Sequence[str | Path] = (),
    naming: LogNaming | None = None,
    loaded: Sequence[str | Path] = (),
    load: KnownLoad | None = None,
    progress: Progress = lambda step: None,
) -> Calibration:
    """Calibrate a model from measured logs, and return the calibrated model with the identified values. The logs are a
    campaign (its folder or campaign.toml), a log description (log.toml) or plain log files.

    regressor         compiled regressor of the model, which is fast; None: psdmc computes the regressor in NumPy
    torque_constants  N m/A by joint name, for plain logs of currents, and for joints that no load affects; None: those
                      of the log description, or of a model that was calibrated before
    validation        plain logs that psdmc uses only to test the fit
    naming            topic, and joint names in plain logs
    loaded, load      further logs of currents with a known load on the robot, and this load; they determine torque
                      constants

    Raises InputError if a file is missing or a log cannot be used.
    """
    require_axes(model.mechanism, "calibration")
    require_no_loops(model.mechanism, "calibration")
    options, naming = options or CalibrateOptions(), naming or LogNaming()
    if options.physical:
        require_cvxpy()
    regressor = regressor or ChainRegressor(model)
    paths, held, with_load = _paths(sources), _paths(validation), _paths(loaded)
    if bool(with_load) != (load is not None):
        raise InputError(
            "logs with a load and the load's numbers belong together",
            "give --loaded LOG and --load MASS,X,Y,Z",
        )
    campaign = campaign_of(paths)
    plain = None
    if campaign is not None:
        with suppress(InputError):  # read_campaign says later why the campaign cannot be read
            plain = plain_logs(campaign, model.v_names)
    if plain is not None:
        paths, held, campaign = list(plain[0]), [*held, *plain[1]], None
    if campaign is not None:
        flags = _only_for_plain_logs(options, held, naming, with_load)
        if flags:
            raise InputError(
                f"{', '.join(flags)} {'is' if len(flags) == 1 else 'are'} for plain logs, {campaign} is a campaign",
                "leave it out: each step of a campaign has its cut-off, split and friction",
            )
        runs = read_campaign(campaign, model.v_names)
        return calibrate_campaign(model, runs, options, regressor, torque_constants, progress)
    naming.require_bag([*paths, *held, *with_load])
    progress("reading logs")
    found = log_sources(paths, held, model.v_names, options.linear, options.choice, naming, progress)
    full = None
    if load is not None:
        own = log_sources(with_load, [], model.v_names, options.linear, options.choice, naming, progress)
        full = LoadedLogs(own.logs, load)
    options = replace(options, linear=found.linear)
    given = {**found.constants, **(torque_constants or {})}
    known = model.calibrated
    constants = given
    if full is None and known is not None and found.logs[0].quantity == "current":
        constants = {**{row.joint: row.value for row in known.motors}, **given}
    result = calibrate_logs(model, found.logs, options, regressor, constants or None, progress, full)
    kept = [
        f"{name}={constants[name]:.6g}" for name in model.v_names if name in constants and name not in given
    ]
    if not kept:
        return result
    note = f"torque constants are those of the calibrated input model: {', '.join(kept)} N m/A"
    return with_model(replace(result, notes=(note, *result.notes)))


def _paths(sources: str | Path | Sequence[str | Path]) -> list[Path]:
    return [Path(source) for source in ([sources] if isinstance(sources, str | Path) else sources)]


def _only_for_plain_logs(
    options: CalibrateOptions, validation: list[Path], naming: LogNaming, loaded: list[Path]
) -> list[str]:
    """The given command-line options and tables that are for plain logs only."""
    given = [flag for flag, value in options.choice.by_flag().items() if value is not None]
    given += ["--validate"] if validation else []
    given += ["--loaded"] if loaded else []
    given += naming.flags
    given += [f"[{name}]" for name in options.linear.tables]
    given += ["--prior-confidence"] if options.prior_confidence is not None else []
    given += ["--essential"] if options.essential is not None else []
    return given


def calibrate_campaign(
    model: DynamicsModel,
    runs: Runs,
    options: CalibrateOptions,
    regressor: Regressor,
    torque_constants: Mapping[str, float] | None,
    progress: Progress,
) -> Calibration:
    """Calibrate a model from the logs of a campaign, in four steps: motors, gravity, friction, inertia.

    If the result must be physically possible, it is the vector of base parameters that is nearest to the result of the
    four steps. The distance is measured in standard deviations of the fit and the prior.
    """
    if model.mechanism.has_mimic_joints:
        raise InputError(
            f"{shown(model.mechanism.name)}: campaigns are for joints that follow no other",
            "calibrate from logs that do not belong to a campaign",
        )
    found = calibrate_four_steps(
        model.mechanism,
        regressor,
        model.l,
        runs,
        options.campaign,
        progress,
        torque_constants,
        model.file_theta_b,
    )

    def judged(
        steps: FourSteps, theta_b: Array, plain: Calibration | None = None, distance: float | None = None
    ) -> Calibration:
        record = with_data(four_step_record(model, steps, theta_b, options.campaign), found.logs)
        return judged_record(record, runs, plain, distance)

    progress("reading the result back")
    result = judged(found, found.inertial.theta_b)
    if options.physical:
        progress("physical consistency")
        try:
            near = physical_steps(model, found, options.consistency)
            result = judged(near.found, near.theta_b, result, near.distance)
        except NotPhysical as error:
            result = replace(result, facts={**result.facts, NOT_PHYSICAL: error.message})
    progress("verdict")
    step = options.campaign.inertial
    linear = replace(
        options.linear, filter=step.filter, split=step.split, fit=step.fit, exponents=CAMPAIGN_FRICTION
    )
    soft = joint_elasticity(
        model.mechanism,
        regressor,
        [run.log for run in runs.inertial],
        linear,
        found.motors,
        found.inertial.theta_b,
        found.friction,
    )
    result = with_model(replace(result, elasticity=soft.rows, notes=(*result.notes, *soft.notes)))
    return with_verdict_on_campaign(
        result, model, regressor, runs, found.motors, step.filter, options.verdict
    )


def calibrate_logs(
    model: DynamicsModel,
    logs: Sequence[AnyLog],
    options: CalibrateOptions,
    regressor: Regressor,
    torque_constants: Mapping[str, float] | None,
    progress: Progress,
    loaded: LoadedLogs | None = None,
) -> Calibration:
    """Calibrate a model from plain logs by one linear fit of base parameters, friction and torque offsets.

    loaded  further logs with a known load; torque constants are first determined from these and the other logs
    """
    linear, by_load = options.linear.for_robot(model.mechanism), None
    elastic_joints([log.ordered(model.v_names) for log in logs], linear)
    if loaded is not None:
        progress("torque constants")
        motors, by_load = motors_with_load(model, regressor, logs, loaded, linear, torque_constants, progress)
    else:
        motors = motors_of_logs(model.v_names, logs, torque_constants)
    known = knowledge_of(
        model, linear.tables, linear.tables_from, options.prior_confidence, options.essential
    )
    progress("linear fit")
    found = calibrate_linear(
        model.mechanism, regressor, model.l, logs, linear, motors, model.file_theta_b, progress
    )
    fit = LogFit(model, logs, linear, options, known, progress)
    result = fit.record(found)
    if loaded is not None and by_load is not None:
        result = with_loaded_logs(result, loaded, by_load, linear)
    soft = joint_elasticity(model.mechanism, regressor, logs, linear, motors, found.theta_b)
    result = with_model(replace(result, elasticity=soft.rows, notes=(*result.notes, *soft.notes)))
    progress("verdict")
    return with_verdict_on_logs(result, model, regressor, logs, motors, linear.filter, options.verdict)


# The logs of a fit
#
# The result of a linear fit is unconstrained or physically possible, and has all parameters or only those
# that the data need.


MOST_NAMED = 12
"""Dropped parameters that a note names."""
MOST_ALONE = 3
"""Parameters that depend on one log alone and that a note names."""


@dataclass(frozen=True, slots=True, eq=False)
class LogFit:
    """Data that all results of one linear fit need.

    logs     logs that were fitted
    linear   options of the fit, with the robot's springs and friction
    options  options of the calibration, such as whether the result must be physically possible
    known    what the user knows of the links before the fit, such as bounds of masses
    """

    model: DynamicsModel
    logs: Sequence[AnyLog]
    linear: LinearOptions
    options: CalibrateOptions
    known: Knowledge
    progress: Progress

    def record(self, found: LinearResult) -> Calibration:
        """Return the final result of a linear fit. As the options say, it uses what the user knows of the links, is
        physically possible, and drops parameters that the data do not need."""
        if len(self.known.bounds) and not self.options.physical:
            raise InputError(
                "[[bodies]] bounds masses or centres of mass, and the unconstrained fit knows none",
                "leave out --no-physical, or the bounds",
            )
        self.progress("comparing logs")
        logs = log_information(found.problem, found.estimate, [log.name for log in self.logs])
        drifts = friction_drift(found.problem, found.estimate, [log.name for log in self.logs])
        unstated, found = found, self._with_prior(found)
        self.progress("reading the result back")
        result, essential_options = self._consistent(found), self.known.essential
        if essential_options is not None:
            self.progress("essential parameters")
            lesser = essential(
                found.estimate, found.prior.values, found.samples, essential_options, self.linear.fit
            )
            fewer = self._consistent(replace(found, estimate=lesser.estimate, dropped=lesser.dropped))
            names = (*self.model.base_parameters.labels, *found.problem.names)
            result = with_price(fewer, result, lesser, names)
        result = result if logs is None else with_log_information(result, logs, unstated)
        if not drifts:
            return result
        facts = {**result.facts, FRICTION_DRIFT: [asdict(each) for each in drifts]}
        return with_model(replace(result, facts=facts))

    def _with_prior(self, found: LinearResult) -> LinearResult:
        if not self.known.confidence:
            return found
        known = self.model.file_theta_b
        if known is None:
            raise InternalError(f"{self.model.mechanism.name}: a confidence without values")
        covariance = theta_covariance(self.model, dict(self.known.confidence), found.prior.scale)
        joined = with_prior(found.estimate, known, covariance, self.model.unknown_base_parameters)
        return replace(found, estimate=joined, stated=True)

    def _consistent(self, found: LinearResult) -> Calibration:
        """The physically consistent record where it is wanted and exists; else the unconstrained one, with a note."""
        plain = judged_record(self._of(found, found.estimate.values), self.logs, check=self.linear.check)
        if not self.options.physical:
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
        options = self.options.consistency
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
