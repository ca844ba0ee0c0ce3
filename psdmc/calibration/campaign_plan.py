"""Plans a calibration campaign: the motions that the robot makes and records. They are checked against limits and
collisions, and come with notes for the user."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from psdmc.calibration.campaign_file import Step
from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.identify.steps import CalibrationOptions, Load
from psdmc.calibration.logs.formats import WRITTEN
from psdmc.calibration.motions.allowed import (
    SHARES,
    TRIES,
    Allowed,
    GivenLimits,
    TorqueLimits,
    Try,
    bounded,
    first_allowed,
    smaller_boxes,
)
from psdmc.calibration.motions.clearance import APART, Clearance, FloorPoints, clearance_of, floor_points
from psdmc.calibration.motions.criterion import all_columns, inertial_columns
from psdmc.calibration.motions.excite import Excitation, excite, motor_poses, unfelt
from psdmc.calibration.motions.excite_options import ExciteOptions
from psdmc.calibration.motions.formats import FORMATS
from psdmc.calibration.motions.limited_sines import from_rest_to_rest
from psdmc.calibration.motions.search import cpu_seconds
from psdmc.calibration.motions.sweeps import (
    SineOptions,
    SweepOptions,
    gravity_sweep,
    sine_series,
    single_joint_sweep,
    swept_range,
)
from psdmc.calibration.motions.trajectory import Trajectory, sliding_joints
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.linear_friction import linear_friction
from psdmc.progress import Progress
from psdmc.progress import Step as Share
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import Mechanism, require_no_loops

ROWS_PER_CUTOFF = 4.0
"""Rows per period of a filter's cut-off that logs need at least."""
HIGHEST_FLOOR = 1000.0
"""m above or below a robot's base."""
RANKED_POSES = 40
"""Poses of a motor sweep that are tried, those in which the load acts most first."""
SINE_SHARES = ((1.0, 0.9), (0.5, 0.6), (0.25, 0.4))
"""Of the sines' largest amplitude and of the speed and acceleration limits, tried one after the other."""


@dataclass(frozen=True, slots=True)
class CampaignOptions:
    """Options for the plan of a campaign.

    sweep         options of slow sweeps; sines, of sine motions for friction; excite, of the exciting motion
    load          known load with which torque constants are measured: mass (kg) and centre of mass (m, tip frame).
                  None: for robots that log torques; no runs with a load are planned
    gravity_runs  number of slow sweeps through the workspace, each forwards and backwards
    repeats       periods of the exciting motion
    one_log       True: plan only the exciting motion, for one linear fit of all base parameters, friction and offsets
    validation    True: also plan a second, different motion, on which the calibration only tests its result
    limits        limits of joints in addition to the file's
    shapes        folders of the collision shapes' meshes; None: collisions are not checked
    floor         height in m of a floor above the base's origin; None: no floor
    table         format of trajectories and logs: csv, npz or parquet
    formats       names of file formats of robots' controllers in which each trajectory is written as well
    """

    sweep: SweepOptions = field(default_factory=SweepOptions)
    sines: SineOptions = field(default_factory=SineOptions)
    excite: ExciteOptions = field(default_factory=ExciteOptions)
    load: Load | None = field(default_factory=lambda: Load(3.5, (0.08, 0.0, 0.06)))
    gravity_runs: int = 2
    repeats: int = 6
    one_log: bool = False
    validation: bool = False
    limits: GivenLimits = field(default_factory=GivenLimits)
    shapes: tuple[Path, ...] | None = ()
    floor: float | None = None
    table: str = "csv"
    formats: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in self.formats:
            if name not in FORMATS:
                raise InputError(f"--format is {name!r}", f"known formats: {', '.join(FORMATS)}")
        if f".{self.table}" not in WRITTEN:
            known = ", ".join(ending.removeprefix(".") for ending in WRITTEN)
            raise InputError(f"table is {self.table!r}, expected one of {known}", "choose one of these")
        if self.floor is not None and not abs(self.floor) <= HIGHEST_FLOOR:
            raise InputError(
                f"floor is at {self.floor:g} m, expected at most {HIGHEST_FLOOR:g} above or below the base",
                "give it in m",
            )
        fastest = (
            LinearOptions().filter.cutoff if self.one_log else CalibrationOptions().friction.filter.cutoff
        )
        rate, needed = 1.0 / max(self.sweep.period, self.sines.period), ROWS_PER_CUTOFF * fastest
        if not rate >= needed * (1.0 - 1e-9):
            kind = "of one log (--one-log)" if self.one_log else "of four kinds of runs (without --one-log)"
            raise InputError(
                f"--rate is {rate:g} rows a second, expected at least {needed:g} for a plan {kind}: the fit filters logs at"
                f" {fastest:g} Hz",
                "give a higher --rate" if self.one_log else f"--rate {needed:g}, or plan one log: --one-log",
            )


@dataclass(frozen=True, slots=True, eq=False)
class PlannedRun:
    """One run of the robot in a campaign: a recorded motion of all joints or of one joint, with or without a load."""

    step: Step
    name: str
    motion: Trajectory
    joint: str = ""
    load: Load | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """All runs of a campaign, the exciting motion, and notes for the user, one sentence each.

    runs        motions for the robot, in their order
    found       the exciting motion
    chain       the robot with the limits that the motions keep
    looked      sentences on the collisions that were checked, and on those that were not
    remarks     differences from what the user asked for, and values that the campaign cannot determine
    """

    runs: tuple[PlannedRun, ...]
    found: Excitation
    chain: Mechanism
    looked: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()


def plan_campaign(
    model: DynamicsModel,
    regressor: Regressor,
    options: CampaignOptions,
    progress: Progress = lambda step: None,
    began: float | None = None,
) -> Plan:
    """Return the plan of a campaign: the runs for a calibration in four steps, or only the exciting motion for one log.
    Each motion is checked against joint limits, torque limits and collisions, also during the search for the exciting
    motion.

    began  value of cpu_seconds() from which the time of the search counts; None: now

    Raises InputError if a joint has no limits, or if no motion is allowed. Motions that need no search are checked
    first.
    """
    if model.mechanism.has_mimic_joints:
        raise InputError(
            f"{shown(model.mechanism.name)}: campaigns are for joints that follow no other",
            "derive the model with such joints held: --lock JOINT=0",
        )
    require_no_loops(model.mechanism, "a campaign")
    began = cpu_seconds() if began is None else began
    chain = bounded(model.mechanism, options.limits)
    for name in options.formats:
        FORMATS[name].require(chain.joint_names, sliding_joints(chain))
    progress("shapes")
    allowed = allowed_of(model, chain, regressor, options.excite.torque_margin, options.shapes, options.floor)
    planner = _Planner(chain, options, allowed)
    if not options.one_log:
        for step, plan in (
            ("motor sweeps", planner.motors),
            ("gravity sweeps", planner.gravity),
            ("sine series", planner.sines),
        ):
            progress(step)
            plan()
    progress("exciting motion")
    columns = (
        all_columns(regressor, model.l, LinearOptions())
        if options.one_log
        else inertial_columns(chain, regressor, model.l)
    )
    found = excite(chain, columns, options.excite, _spoken(progress), allowed, began)
    planner.exciting(found)
    if options.validation:
        other = replace(options.excite, seed=options.excite.seed + 1, random=FOR_VALIDATION, seconds=0.0)
        planner.exciting(excite(chain, columns, other, allowed=allowed), "validation")
    said = (
        []
        if not found.ended_by_clock
        else [
            "the search stopped at the limit of --seconds: another run may find another motion, more seconds a better one"
        ]
    )
    return Plan(
        tuple(planner.runs),
        found,
        chain,
        (
            _of_torques(allowed, model),
            _of_shapes(allowed, model, options.shapes),
            _of_floor(allowed, options.floor),
        ),
        (*planner.remarks, *said),
    )


FOR_VALIDATION = 50
"""Random motions, the best of which becomes the motion for validation: it need not excite much, but differ."""


class _Planner:
    """Runs so far, and remarks on them."""

    def __init__(self, chain: Mechanism, options: CampaignOptions, allowed: Allowed) -> None:
        self.chain, self.options, self.allowed = chain, options, allowed
        self.runs: list[PlannedRun] = []
        self.remarks: list[str] = []

    def motors(self) -> None:
        """Plan the runs that determine torque constants. Each joint on which the weight of the known load acts makes
        two sweeps, without and with the load."""
        load = self.options.load
        if load is None:
            self.remarks.append(
                "no motor runs: torque constants stay unknown, so the robot has to log torques"
            )
            return
        poses, effect = motor_poses(self.chain, load)
        left_out = unfelt(self.chain, load, effect)
        for k, name in enumerate(self.chain.joint_names):
            if k in left_out:
                continue
            order = np.argsort(-effect[:, k], kind="stable")[:RANKED_POSES]
            ranked = poses[order]
            sweep = self._first(
                f"motor sweep of joint {shown(name)}",
                _sweeps(self.chain, k, ranked, self.options.sweep),
                load,
            )
            self.runs.append(PlannedRun("motor", f"motor_{name}", sweep, name))
            self.runs.append(PlannedRun("motor", f"motor_{name}_loaded", sweep, name, load))
        for name in (shown(self.chain.joint_names[k]) for k in left_out):
            self.remarks.append(
                f"joint {name}: the load acts on it in no pose (its axis is along gravity, or the load lies on it): no motor"
                f" runs; give its torque constant when you calibrate (--torque-constants {name}=NM_PER_A), or take another"
                " load"
            )

    def gravity(self) -> None:
        for seed in range(1, self.options.gravity_runs + 1):
            tries: Iterator[Try] = (
                (share, partial(gravity_sweep, part, seed + 1000 * number, self.options.sweep))
                for share, number, part in smaller_boxes(self.chain, seed)
            )
            motion = self._first(f"gravity sweep {seed}", tries)
            self.runs.append(PlannedRun("gravity", f"gravity_{seed}", motion))

    def sines(self) -> None:
        for k, name in enumerate(self.chain.joint_names):
            tries = _sine_tries(self.chain, k, self.options.sines)
            series = self._first(f"sine series of joint {shown(name)}", tries)
            self.runs.append(PlannedRun("friction", f"friction_{name}", series, name))

    def exciting(self, found: Excitation, step: Step = "inertial") -> None:
        options = self.options
        motion = from_rest_to_rest(
            found.motion, self.chain, options.sweep.period, options.repeats, self.allowed.faults
        )
        motion = replace(motion, sliding=sliding_joints(self.chain))
        name = "exciting" if options.one_log and step == "inertial" else step
        self.runs.append(PlannedRun(step, name, motion))

    def _first(self, what: str, tries: Iterator[Try], load: Load | None = None) -> Trajectory:
        """The first motion that is allowed, with the load and without; a remark where it is smaller than the first."""

        def faults(motion: Trajectory) -> list[str]:
            return self.allowed.faults(motion) or ([] if load is None else self.allowed.faults(motion, load))

        motion, share = first_allowed(what, tries, faults)
        if share < 1.0:
            self.remarks.append(f"{what}: at {share:.0%} of its size, larger ones are not allowed")
        return motion


def _sweeps(chain: Mechanism, k: int, poses: np.ndarray, options: SweepOptions) -> Iterator[Try]:
    """Sweeps of one joint in several poses of the others; then of parts of its range."""
    for pose in poses:
        yield 1.0, partial(single_joint_sweep, chain, k, pose, options)
    for share, number, part in smaller_boxes(chain, k):
        if share < 1.0:
            yield share, partial(single_joint_sweep, part, k, poses[number % len(poses)], options)


def _sine_tries(chain: Mechanism, k: int, options: SineOptions) -> Iterator[Try]:
    """Sines about the middle of the ranges; then in other poses; then smaller and slower ones."""
    middle = np.array([sum(swept_range(joint, 1.0)) / 2 for joint in chain.joints])
    low, high = np.array([swept_range(joint, SHARES[1]) for joint in chain.joints]).T
    others = np.random.default_rng(k).uniform(low, high, (3 * TRIES, len(chain)))
    others[:TRIES, k] = middle[k]
    for share, margin in SINE_SHARES:
        largest = share * options.largest
        own = replace(options, largest=max(largest, options.smallest), margin=min(margin, options.margin))
        for pose in (middle, *others):
            yield share, partial(sine_series, chain, k, pose, own)


def _spoken(progress: Progress) -> Callable[[float, float, float], None]:
    """A function that reports the progress of a search, every few seconds."""
    said = 0.0

    def say(share: float, seconds: float, score: float) -> None:
        nonlocal said
        if seconds - said >= SPOKEN_EVERY:
            said = seconds
            progress(Share(f"exciting motion: criterion {score:.4g} after {seconds:.0f} s of CPU", share))

    return say


SPOKEN_EVERY = 5.0
"""Seconds of CPU between two reports on the search."""


# What planned motions are checked for
#
# Sentences describe the limits and collisions, which checks were not possible, and why.


LISTED = 4
"""Names in a sentence; the others are counted."""


def allowed_of(
    model: DynamicsModel,
    chain: Mechanism,
    regressor: Regressor,
    torque_margin: float,
    shapes: Sequence[Path] | None,
    floor: float | None,
) -> Allowed:
    """Return the limits and collision checks for planned motions of a model's robot.

    Torques are limited if the base parameters theta_b are known and a joint has a torque limit. Collisions are checked
    if the model contains collision shapes.

    chain          the model's robot, with the limits that the motions must keep
    regressor      object that computes the regressor of the robot
    torque_margin  share of the torque limits that a motion may use
    shapes         folders of meshes; None: shapes are not checked
    floor          m, height of a floor above the base's origin; None: no floor

    Raises InputError if a floor that cannot be checked is given, or if meshes are missing.
    """
    clearance: Clearance | FloorPoints | None = None
    if shapes is not None:
        try:
            clearance = clearance_of(model, shapes, floor)
        except InputError:
            if shapes:
                raise
    if clearance is None and floor is not None:
        clearance = floor_points(chain, floor)
    return Allowed(chain, _torques(model, chain, regressor), torque_margin, clearance)


def _torques(model: DynamicsModel, chain: Mechanism, regressor: Regressor) -> TorqueLimits | None:
    largest = np.array([joint.limits.effort for joint in chain.joints])
    largest = np.where(largest > 0, largest, np.inf)
    if model.theta_b is None or not np.isfinite(largest).any():
        return None
    try:
        friction = linear_friction(model).by_speed if model.calibrated else None
    except InputError:
        friction = None  # of a campaign: it has a state
    return TorqueLimits(chain, regressor, largest, model.theta_b, friction)


def _of_torques(allowed: Allowed, model: DynamicsModel) -> str:
    if allowed.torques is None:
        why = (
            "theta_b is unknown"
            if model.theta_b is None
            else "no joint has an effort limit (--effort JOINT=NM)"
        )
        return f"not checked: torques, {why}"
    bare = [
        name
        for name, value in zip(allowed.chain.joint_names, allowed.torques.largest, strict=True)
        if np.isinf(value)
    ]
    beside = f"; joint(s) {_listed(bare)} have no limit" if bare else ""
    with_friction = "with" if allowed.torques.friction is not None else "without"
    return f"torques: by theta_b {with_friction} friction, at most {allowed.torque_margin:.0%} of the limits{beside}"


def _of_shapes(allowed: Allowed, model: DynamicsModel, shapes: Sequence[Path] | None) -> str:
    found = allowed.clearance
    if isinstance(found, Clearance):
        beside = f"; not {_listed(found.always)}, which touch in every pose" if found.always else ""
        return (
            f"self-collision: {len(found.pairs)} pairs of shapes stay {1000 * APART:g} mm apart, neighbours aside{beside};"
            " a load or cables have no shape"
        )
    if shapes is None:
        return "not checked: self-collision, as asked for (--no-collisions)"
    try:
        clearance_of(model, shapes)
    except InputError as error:
        return f"not checked: self-collision, {error.message}{f' ({error.hint})' if error.hint else ''}"
    return "not checked: self-collision"


def _of_floor(allowed: Allowed, floor: float | None) -> str:
    if floor is None:
        return "not checked: floor and surroundings (give the floor's height above the base's origin, m: --floor HEIGHT)"
    by = (
        "shapes"
        if isinstance(allowed.clearance, Clearance)
        else "origins of joints and the tip, not their bodies,"
    )
    return f"floor at {floor:g} m: {by} stay {1000 * APART:g} mm above; other surroundings are not checked"


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return ", ".join(shown(name) if " and " not in name else name for name in names[:LISTED]) + more
