"""Calibrates a model from log files: in four steps from a campaign, or by one linear fit from plain logs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from psdmc.calibration.campaign_file import plain_logs, read_campaign, validation_logs
from psdmc.calibration.description.table_fit import FitChoice
from psdmc.calibration.fitted_logs import LogFit
from psdmc.calibration.identify.essential import EssentialOptions
from psdmc.calibration.identify.four_steps import (
    FourSteps,
    Runs,
    calibrate_four_steps,
    checked_runs,
    physical_steps,
)
from psdmc.calibration.identify.knowledge import knowledge_of
from psdmc.calibration.identify.known_load import KnownLoad
from psdmc.calibration.identify.linear_fit import calibrate_linear
from psdmc.calibration.identify.linear_options import LinearOptions
from psdmc.calibration.identify.motor_model import motors_of_logs
from psdmc.calibration.identify.physical import NotPhysical
from psdmc.calibration.identify.predictor import ChainRegressor, Regressor
from psdmc.calibration.identify.steps import CalibrationOptions
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.stored_log import AnyLog
from psdmc.calibration.motors_of_loads import LoadedLogs, motors_with_load, with_loaded_logs
from psdmc.calibration.sources import LogNaming, campaign_of, log_sources
from psdmc.calibration.verdict.judge import NOT_PHYSICAL, with_verdict_on_campaign, with_verdict_on_logs
from psdmc.calibration.verdict.record import Calibration, four_step_record, judged_record, with_data
from psdmc.calibration.verdict.verdict_limits import VerdictOptions
from psdmc.errors import InputError
from psdmc.links.link_terms import PhysicalOptions, require_cvxpy
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.progress import Progress
from psdmc.robot.derivable import require_axes
from psdmc.robot.limits import shown


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
    torque_constants  N m/A by joint name, for plain logs of currents, and for joints that no load affects
    validation        plain logs that psdmc uses only to test the fit
    naming            topic, and joint names in plain logs
    loaded, load      further logs of currents with a known load on the robot, and this load; they determine torque
                      constants

    Raises InputError if a file is missing or a log cannot be used.
    """
    require_axes(model.mechanism, "calibration")
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
    plain = None if campaign is None else _exciting_logs(campaign, model.v_names)
    if plain is not None:
        held += validation_logs(paths[0])
        paths, campaign = list(plain), None
    if campaign is not None:
        _require_plain(campaign, options, held, naming, with_load)
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
    constants = {**found.constants, **(torque_constants or {})}
    return calibrate_logs(model, found.logs, options, regressor, constants or None, progress, full)


def _exciting_logs(campaign: Path, joint_names: Sequence[str]) -> tuple[Path, ...] | None:
    """The logs of a campaign of exciting motions alone; None also where it cannot be read, which is said later."""
    try:
        return plain_logs(campaign, joint_names)
    except InputError:
        return None


def _paths(sources: str | Path | Sequence[str | Path]) -> list[Path]:
    return [Path(source) for source in ([sources] if isinstance(sources, str | Path) else sources)]


def _require_plain(
    campaign: Path,
    options: CalibrateOptions,
    validation: list[Path],
    naming: LogNaming,
    loaded: list[Path],
) -> None:
    """InputError where what is for plain logs is given with a campaign."""
    given = [flag for flag, value in options.choice.by_flag().items() if value is not None]
    given += ["--validate"] if validation else []
    given += ["--loaded"] if loaded else []
    given += naming.flags
    given += [f"[{name}]" for name in options.linear.tables]
    given += ["--prior-confidence"] if options.prior_confidence is not None else []
    given += ["--essential"] if options.essential is not None else []
    if given:
        are = "is" if len(given) == 1 else "are"
        raise InputError(
            f"{', '.join(given)} {are} for plain logs, {campaign} is a campaign",
            "leave it out: each step of a campaign has its cut-off, split and friction",
        )


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
    if model.mechanism.has_followers:
        raise InputError(
            f"{shown(model.mechanism.name)}: campaigns are for joints that follow no other",
            "calibrate from logs that do not belong to a campaign",
        )
    progress("checking logs")
    logs = checked_runs(model.mechanism, runs, options.campaign)
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

    def record(steps: FourSteps, theta_b: Array) -> Calibration:
        return with_data(four_step_record(model, steps, theta_b, options.campaign), logs)

    progress("reading the result back")
    plain = judged_record(record(found, found.inertial.theta_b), runs)

    def consistent() -> Calibration:
        near = physical_steps(model, found, options.consistency)
        return judged_record(record(near.found, near.theta_b), runs, plain, near.distance)

    result = _physical(plain, consistent, options, progress)
    progress("verdict")
    step = options.campaign.inertial.filter
    return with_verdict_on_campaign(result, model, regressor, runs, found.motors, step, options.verdict)


def _physical(
    plain: Calibration, consistent: Callable[[], Calibration], options: CalibrateOptions, progress: Progress
) -> Calibration:
    """The physically consistent record where it is wanted and exists; else the unconstrained fit's, with a note."""
    if not options.physical:
        return plain
    progress("physical consistency")
    try:
        return consistent()
    except NotPhysical as error:
        return replace(plain, facts={**plain.facts, NOT_PHYSICAL: error.message})


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
    if loaded is None:
        motors = motors_of_logs(model.v_names, logs, torque_constants)
    else:
        progress("torque constants")
        motors, by_load = motors_with_load(model, regressor, logs, loaded, linear, torque_constants, progress)
    known = knowledge_of(
        model, linear.tables, linear.tables_from, options.prior_confidence, options.essential
    )
    progress("linear fit")
    found = calibrate_linear(
        model.mechanism, regressor, model.l, logs, linear, motors, model.file_theta_b, progress
    )
    fit = LogFit(model, logs, linear, options.physical, options.consistency, known, progress)
    result = fit.record(found)
    if loaded is not None and by_load is not None:
        result = with_loaded_logs(result, loaded, by_load, linear)
    progress("verdict")
    return with_verdict_on_logs(result, model, regressor, logs, motors, linear.filter, options.verdict)
