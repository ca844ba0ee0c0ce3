"""The result of a calibration, as model files contain it and as other parts of psdmc read it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from psdmc.friction.law import Law, Term
from psdmc.friction.laws import LAWS
from psdmc.friction.own import laws_of
from psdmc.friction.terms import every_joint_s, named
from psdmc.model.grounds import Delay, Ground, OrInf
from psdmc.robot.mechanism import frozen_array

Array = NDArray[np.float64]
OrNaN = float
"""A number that may not exist: NaN, null in files."""
LINEAR = "linear"
"""The law of friction that is a sum of linear terms."""
Matrix = tuple[tuple[float, ...], ...]
"""C of q_joint = C q_motor; empty: every motor drives its own joint."""
Word = Literal["usable", "usable, with doubts", "not usable"]

NOT_USABLE_STATUS = 6
"""Exit status of `psdmc calibrate` where the verdict is `not usable`."""
LOG_INFORMATION = "log_information"
"""Name of the fact that holds the share of each log in the information of each parameter."""
FRICTION_DRIFT = "friction_drift"
"""Name of the fact that holds the change of each joint's friction over each log."""
PROPOSED_COUPLING = "proposed_coupling"
"""Name of the fact that holds motors which seem to drive several joints, and the lines of log.toml that say so."""
WHOLE = "All"
"""The step whose quality is that of the whole torque."""


class Remark(str):
    """A sentence for people, with `code`, a machine-readable identifier by which programs recognise the sentence.

    `code` is empty if no program depends on the sentence.
    """

    code: str

    def __new__(cls, text: str, code: str = "") -> Remark:
        found = super().__new__(cls, text)
        found.code = code
        return found


def code_of(text: str) -> str:
    """Return the machine-readable identifier of a sentence, such as 'weak', by which programs recognise the sentence.

    Only a Remark (a sentence with an identifier) has one. For any other sentence, the result is an empty string.
    """
    return getattr(text, "code", "")


IDENTIFIED = Remark("identified", "identified")
WEAK = Remark("weakly visible", "weak")
"""What the data show of a number; further codes stand where they are found (calibration's visibility)."""
SHOWN = (IDENTIFIED.code, WEAK.code)
"""Codes of numbers that the data determine, however weakly."""


@dataclass(frozen=True, slots=True)
class ParameterRow:
    """One base parameter in a calibration report: the calibrated value, its standard deviation, and what the data show
    of it.

    value         if the data do not determine the parameter alone, the value nearest to the prior that fits the data
    std           standard deviation; infinite if the data do not determine the parameter alone
    identifiable  whether the parameter is "identified": determined alone, with std less than half of its value
    visibility    what the data show of the parameter: a Remark
    file          value by the file that was calibrated; None if the file has none
    """

    name: str
    group: str
    value: float
    std: OrInf
    unit: str
    equation: str
    identifiable: bool
    visibility: str = IDENTIFIED
    file: float | None = None

    @property
    def relative(self) -> float:
        return self.std / abs(self.value) if self.value else math.inf


@dataclass(frozen=True, slots=True)
class NumberRow:
    """One calibrated number of a joint or of a spring, with its standard deviation.

    joint       name of the joint or of the spring
    parameters  the number in the name of a friction term: `exponent` of |v|^d, `speed` of exp(-(v / speed)^2)
    seen        whether the data determine the number
    visibility  what the data show of it: a Remark, empty if that is not known
    """

    joint: str
    name: str
    value: OrNaN
    std: OrInf
    unit: str
    seen: bool = True
    visibility: str = ""
    parameters: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Quality:
    """The errors of one joint's prediction in one calibration step: RMSE, in the unit of the predicted quantity, and
    R^2. R^2 is NaN if the measured quantity does not vary."""

    rmse: OrNaN
    r2: OrNaN


@dataclass(frozen=True, slots=True)
class JointQuality:
    """The errors of one joint's prediction in one calibration step: on fitted data, and on held-out data that the fit
    does not use."""

    fit: Quality
    held_out: Quality


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """A section of measured and predicted torque of one joint for plots. `held_out` marks the samples that the fit did
    not use."""

    joint: str
    abscissa: str
    x: Array
    measured: Array
    predicted: Array
    held_out: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class StepQuality:
    """The errors of the prediction in one calibration step, by joint name. The object also has samples for plots, which
    files do not store."""

    step: str
    joints: dict[str, JointQuality]
    samples: tuple[Sample, ...] = ()


@dataclass(frozen=True, slots=True)
class FrictionRunConstants:
    """Results of a joint's friction run (a log for friction only), apart from the friction.

    They are the inertia about the joint in the pose of the log (kg m^2), a constant torque (N m), and the delay between
    position and current (s).
    """

    inertia: float
    offset: float
    delay: float


@dataclass(frozen=True, slots=True)
class StepUsed:
    """The low-pass filter that a calibration step used, and how it divided the data into fitted and held-out parts.

    They are the filter's cut-off (Hz), order and settling time in periods, and the share and number of blocks of data
    that are held out.
    """

    cutoff: float
    order: int = 8
    settle: float = 3.0
    held_out: float = 0.15
    blocks: int = 40


@dataclass(frozen=True, slots=True)
class Prediction:
    """The results of a calibration that a prediction of torques needs, apart from theta_b and the tables of friction
    and motors. "Linear" means that the friction is a sum of terms.

    law         "linear", or the name of a friction law with an internal state, such as LuGre
    steps       filters by calibration step: "all" for one log, else motor, gravity, friction, inertial
    sign_speed  linear: speed near which the sign of the motion changes smoothly, rad/s
    exponents   linear: exponents of the viscous friction terms that every joint has
    offset      linear: whether every joint has a constant torque
    coupling    linear: matrix between motors and joints, if friction is that of the motors
    runs        law with a state: constants of the friction runs by joint
    columns     linear: tables of springs and of further friction with users' own laws (calibration's read_columns)
    """

    law: str
    steps: Mapping[str, StepUsed]
    sign_speed: float = 0.0
    exponents: tuple[float, ...] = ()
    offset: bool = False
    runs: Mapping[str, FrictionRunConstants] = field(default_factory=dict)
    coupling: Matrix = ()
    columns: Mapping[str, Any] = field(default_factory=dict)

    @property
    def is_linear(self) -> bool:
        return self.law == LINEAR

    @property
    def terms(self) -> tuple[Term, ...]:
        """Return the friction terms that every joint has, if friction is linear (a sum of terms). Raises ValueError if
        an exponent is out of range."""
        return every_joint_s(self.exponents, self.offset)

    @property
    def laws(self) -> dict[str, Law]:
        """Return the friction laws that can occur, by name: psdmc's laws, and the laws in a Python file of the user.
        Raises ValueError if the stored laws are damaged."""
        return LAWS | laws_of(self.columns.get("friction", {}).get("laws", ()))


@dataclass(frozen=True, slots=True)
class JointFigures:
    """The figures by which the calibration of one joint is judged; NaN where a figure does not exist.

    r2, rmse            of the whole torque on held-out data; rmse in N m, or N for a sliding joint
    gain                ratio of the measured torque, without friction, to the torque by the theta_b of the robot file:
                        one if the file is right
    gain_std            standard deviation of the gain
    visible             whether the torque by the file is large enough for the gain to count
    friction_power      W, mean power that friction takes: positive on any real joint
    friction_power_std  standard deviation of this power
    noise_ratio         residual, divided by the sensor noise that passes the filter
    speed               rad/s (m/s), RMS
    """

    joint: str
    r2: OrNaN
    rmse: OrNaN
    gain: OrNaN
    gain_std: OrNaN
    visible: bool
    friction_power: OrNaN
    friction_power_std: OrNaN
    noise_ratio: OrNaN
    speed: OrNaN


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a calibration can be used, with all reasons.

    against              why the calibration is not usable; empty if it is usable
    doubted              what a user should know before using the calibration
    suspected            possible explanations of a bad fit: joints swapped, signs reversed, units
    joints               figures of each joint, in the model's order
    samples_per_unknown  independent samples per fitted unknown, the smallest of all steps
    delays               of torques relative to the motion, log by log
    """

    against: tuple[Ground, ...]
    doubted: tuple[Ground, ...]
    suspected: tuple[Ground, ...]
    joints: tuple[JointFigures, ...]
    samples_per_unknown: float
    delays: tuple[Delay, ...] = ()

    @property
    def reasons(self) -> tuple[str, ...]:
        """`against` in words."""
        return tuple(ground.words for ground in self.against)

    @property
    def doubts(self) -> tuple[str, ...]:
        """`doubted` in words."""
        return tuple(ground.words for ground in self.doubted)

    @property
    def suspects(self) -> tuple[str, ...]:
        """`suspected` in words."""
        return tuple(ground.words for ground in self.suspected)

    @property
    def usable(self) -> bool:
        return not self.against

    @property
    def word(self) -> Word:
        if self.against:
            return "not usable"
        return "usable, with doubts" if self.doubted else "usable"

    @property
    def exit_status(self) -> int:
        """Return the exit status of a psdmc command with this verdict: 0 if the calibration is usable, with or without
        doubts."""
        return 0 if self.usable else NOT_USABLE_STATUS

    @property
    def grounds(self) -> tuple[tuple[str, str], ...]:
        """Return every reason of the verdict as a pair (kind, sentence): first why the calibration is not usable, then
        suspicions, then doubts."""
        kinds = (("not usable", self.reasons), ("likely", self.suspects), ("doubt", self.doubts))
        return tuple((kind, text) for kind, texts in kinds for text in texts)

    def lines(self) -> list[str]:
        """Return the verdict as lines of text: first "usable", "usable, with doubts" or "not usable", then the
        reasons."""
        return [f"verdict: {self.word}", *(f"  {kind}: {text}" for kind, text in self.grounds)]


@dataclass(frozen=True, slots=True)
class LogUsed:
    """A log that a calibration used: its name, number of rows, length in seconds, date, and how the calibration used
    it.

    use  "fit"; "validate" if the whole log was held out; "with_load" if it was recorded with the known load
    """

    log: str
    rows: int
    seconds: float
    date: str = ""
    use: str = "fit"


@dataclass(frozen=True, slots=True)
class LoadUsed:
    """The known load with which a log was recorded.

    mass     kg
    com      (3,) m, centre of mass in the frame
    inertia  (6,) kg m^2, about the centre of mass
    frame    name of the frame that carries the load
    """

    mass: float
    com: tuple[float, ...]
    inertia: tuple[float, ...]
    frame: str


SAME = {
    "residual": "lacking_effect",
    "indefinite": "indefinite",
    "negative_constant": "negative_constants",
    "standing": "hardly_moving",
}
"""Code of a warning, and of the doubt with the same meaning."""


@dataclass(frozen=True, slots=True, eq=False)
class Calibrated:
    """The whole result of a calibration.

    parameters  l base parameters in the model's order
    motors      torque constants
    friction    values of each joint's friction law or terms
    steps       errors of the prediction in each calibration step, computed from the content of the model file
    warnings    sentences that a user should read; Remarks if a rule depends on one
    facts       plain figures for people: ranks, condition numbers, singular values
    prediction  further numbers for the prediction of torques
    notes       remarks without consequences for the use of the calibration
    verdict     whether the calibration can be used; None before it was judged, and for files of psdmc 0.1
    springs     values of springs, with the spring's name in place of a joint's
    covariance  (l, l) of the base parameters; in directions that the data do not show, that of the prior; None: not
                kept
    elasticity  of joints with two encoders: stiffness and damping between motor and link, and drive inertia
    logs, load  the logs of the calibration, and the known load
    versions    of the programs that made the result
    """

    robot: str
    method: str
    joint_names: tuple[str, ...]
    parameters: tuple[ParameterRow, ...]
    motors: tuple[NumberRow, ...]
    friction: tuple[NumberRow, ...]
    steps: tuple[StepQuality, ...]
    warnings: tuple[str, ...]
    facts: Mapping[str, Any] = field(default_factory=dict)
    prediction: Prediction | None = None
    notes: tuple[str, ...] = ()
    verdict: Verdict | None = None
    springs: tuple[NumberRow, ...] = ()
    covariance: Array | None = None
    logs: tuple[LogUsed, ...] = ()
    load: LoadUsed | None = None
    versions: Mapping[str, str] = field(default_factory=dict)
    elasticity: tuple[NumberRow, ...] = ()

    def __post_init__(self) -> None:
        if self.covariance is not None:
            l = len(self.parameters)
            both = np.asarray(self.covariance, dtype=np.float64)
            object.__setattr__(self, "covariance", frozen_array(0.5 * (both + both.T), (l, l), "covariance"))

    @property
    def std(self) -> Array:
        """Return the standard deviations of the base parameters, (l,); infinite for a parameter that the data do not
        determine alone."""
        return np.array([row.std for row in self.parameters])

    @property
    def unsaid(self) -> tuple[str, ...]:
        """Return the warnings that do not say what a doubt of the verdict already says."""
        doubts = () if self.verdict is None else self.verdict.doubted
        said = {ground.code for ground in doubts}
        return tuple(text for text in self.warnings if SAME.get(code_of(text)) not in said)

    def kept(self) -> Calibrated:
        """Return the part of the result that a model file contains: everything except samples for plots."""
        values = {each.name: getattr(self, each.name) for each in fields(Calibrated)}
        steps = tuple(StepQuality(step.step, step.joints) for step in self.steps)
        return Calibrated(**values | {"steps": steps})


def by_joint(rows: Iterable[NumberRow]) -> dict[tuple[str, str], float]:
    """Values of rows by joint and name."""
    return {(row.joint, row.name): row.value for row in rows}


def parameters_of(name: str) -> dict[str, float]:
    """Return the number in the name of a friction term, such as 0.5 in 'viscous^0.5', by its meaning: `exponent` or
    `speed`. Return an empty mapping if the name has no number, or if the number is the usual one."""
    term, _ = named(name, LAWS) or (None, 0)
    if term is None or term.number is None or term.law.number is None or term.number == term.law.number.usual:
        return {}
    return {term.law.number.key.removesuffix("s"): term.number}
