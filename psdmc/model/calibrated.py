"""The result of a calibration, in the form in which model files contain it and other parts of psdmc read it."""

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
WHOLE = "All"
"""The step whose quality is that of the whole torque."""


class Remark(str):
    """A sentence for people with a code for programs. The code is empty if no program depends on it."""

    code: str

    def __new__(cls, text: str, code: str = "") -> Remark:
        found = super().__new__(cls, text)
        found.code = code
        return found


def code_of(text: str) -> str:
    """Return the code of a remark; empty for a sentence without a code."""
    return getattr(text, "code", "")


IDENTIFIED = Remark("identified", "identified")
WEAK = Remark("weakly visible", "weak")
"""What the data show of a number; further codes stand where they are found (calibration's visibility)."""
SHOWN = (IDENTIFIED.code, WEAK.code)
"""Codes of numbers that the data determine, however weakly."""


@dataclass(frozen=True, slots=True)
class ParameterRow:
    """One base parameter in table 4 of a calibration report.

    std           infinite if the data do not determine it by itself; value then as near to the prior as the data allow
    identifiable  whether it is "identified": determined by itself, with std less than half of its value
    visibility    what the data show of it: a Remark
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
    """One calibrated number of a joint (or of the spring with that name), with its standard deviation.

    parameters  the number in the name of a friction term: `exponent` of |v|^d, `speed` of exp(-(v / speed)^2)
    seen        whether the data determine it
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
    """RMSE (target's unit) and R^2 of one joint in one step; R^2 is NaN if the target does not vary."""

    rmse: OrNaN
    r2: OrNaN


@dataclass(frozen=True, slots=True)
class JointQuality:
    """The quality of the fit of one joint in one calibration step, on fitted and on held-out data."""

    fit: Quality
    held_out: Quality


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """A section of measured and predicted torque for plots, with the held-out part marked."""

    joint: str
    abscissa: str
    x: Array
    measured: Array
    predicted: Array
    held_out: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class StepQuality:
    """The fit quality of one calibration step, a column of table 3, by joint name. It also has samples for plots, which
    files do not store."""

    step: str
    joints: dict[str, JointQuality]
    samples: tuple[Sample, ...] = ()


@dataclass(frozen=True, slots=True)
class FrictionRunConstants:
    """Constants other than friction that a joint's friction run (a log for friction only) determines.

    They are the inertia in that pose (kg m^2), a constant torque (N m), and the time between position and current (s).
    """

    inertia: float
    offset: float
    delay: float


@dataclass(frozen=True, slots=True)
class StepUsed:
    """The low-pass filter and the validation split of a calibration step.

    They are the filter's cut-off (Hz), order and settling periods, and the share and blocks of data that are held out.
    """

    cutoff: float
    order: int = 8
    settle: float = 3.0
    held_out: float = 0.15
    blocks: int = 40


@dataclass(frozen=True, slots=True)
class Prediction:
    """All numbers for the prediction of torques except theta_b and the tables of friction and motors.

    law         of friction: "linear" (a sum of terms), or the name of a law with a state
    steps       by step: "all" for one log, else motor, gravity, friction, inertial
    sign_speed  rad/s over which friction changes sign, linear law
    exponents   of the terms of every joint, linear law;  offset  whether each joint has one
    coupling    of the motors, if friction is that of the motors, linear law
    runs        constants of the friction runs by joint, law with a state
    columns     tables of springs and further friction with users' own laws, linear law (calibration's read_columns)
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
        """Return the terms of each joint's linear friction. Raises ValueError if an exponent is out of range."""
        return every_joint_s(self.exponents, self.offset)

    @property
    def laws(self) -> dict[str, Law]:
        """Return the friction laws that can occur: psdmc's, and the user's own laws in the tables. Raises ValueError if
        the tables are damaged."""
        return LAWS | laws_of(self.columns.get("friction", {}).get("laws", ()))


@dataclass(frozen=True, slots=True)
class JointFigures:
    """The figures by which one joint is judged; NaN where a figure does not exist.

    r2, rmse            on held-out data, whole torque (N m, N where the joint slides)
    gain, gain_std      measured torque, without friction, per torque by the file's own theta_b: one if the file is
                        right
    visible             whether the file's torque is large enough for its gain to count
    friction_power      W, mean power that friction takes: positive on any real joint
    friction_power_std  its standard deviation
    noise_ratio         residual over the sensor noise that passes the filter
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

    against    why it is not usable; empty if it is
    doubted    what a user should know before using it
    suspected  possible explanations of a bad fit: joints swapped, signs reversed, units
    joints     figures, in the model's order
    samples_per_unknown   independent samples per fitted unknown, the smallest of all steps
    delays     of torques relative to the motion, log by log
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
        """The command line's exit status for this verdict: 0 if the calibration is usable, with or without doubts."""
        return 0 if self.usable else NOT_USABLE_STATUS

    @property
    def grounds(self) -> tuple[tuple[str, str], ...]:
        """Every reason of the verdict as (kind, sentence), the gravest first."""
        kinds = (("not usable", self.reasons), ("likely", self.suspects), ("doubt", self.doubts))
        return tuple((kind, text) for kind, texts in kinds for text in texts)

    def lines(self) -> list[str]:
        """The verdict as lines of text: first the word, then its reasons."""
        return [f"verdict: {self.word}", *(f"  {kind}: {text}" for kind, text in self.grounds)]


@dataclass(frozen=True, slots=True)
class LogUsed:
    """A log of a calibration: name, rows, length in seconds, date, and how it was used.

    use  "fit", "validate": held out as a whole, or "with_load": recorded with the known load
    """

    log: str
    rows: int
    seconds: float
    date: str = ""
    use: str = "fit"


@dataclass(frozen=True, slots=True)
class LoadUsed:
    """The known load with which a log was recorded: kg, (3,) m in the frame, (6,) kg m^2 about the centre of mass."""

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

    parameters  base parameters in the model's order: l of them
    motors      torque constants
    friction    values of each joint's friction law or terms
    steps       table 3's columns, computed from the model file's content
    warnings    a user should read; Remarks if a rule depends on one
    facts       plain figures for people: ranks, condition numbers, singular values
    prediction  further numbers for the prediction of torques
    notes       remarks without consequences for its use
    verdict     whether it can be used; None before it was judged, and for files of psdmc 0.1
    springs     values of springs, with the spring's name in place of a joint's
    covariance  (l, l) of the base parameters, with the prior's in directions that the data do not show; None: not kept
    logs, load, versions   its sources: logs, known load, versions of programs
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

    def __post_init__(self) -> None:
        if self.covariance is not None:
            l = len(self.parameters)
            both = np.asarray(self.covariance, dtype=np.float64)
            object.__setattr__(self, "covariance", frozen_array(0.5 * (both + both.T), (l, l), "covariance"))

    @property
    def std(self) -> Array:
        """(l,) standard deviations of the base parameters; infinite if the data do not determine one by itself."""
        return np.array([row.std for row in self.parameters])

    @property
    def unsaid(self) -> tuple[str, ...]:
        """The warnings that are not also doubts of the verdict."""
        doubts = () if self.verdict is None else self.verdict.doubted
        said = {ground.code for ground in doubts}
        return tuple(text for text in self.warnings if SAME.get(code_of(text)) not in said)

    def kept(self) -> Calibrated:
        """The part of the result that a model file contains: everything except samples."""
        values = {each.name: getattr(self, each.name) for each in fields(Calibrated)}
        steps = tuple(StepQuality(step.step, step.joints) for step in self.steps)
        return Calibrated(**values | {"steps": steps})


def by_joint(rows: Iterable[NumberRow]) -> dict[tuple[str, str], float]:
    """Values of rows by joint and name."""
    return {(row.joint, row.name): row.value for row in rows}


def parameters_of(name: str) -> dict[str, float]:
    """Return the number in the name of a friction term, by its meaning: `exponent` or `speed`."""
    term, _ = named(name, LAWS) or (None, 0)
    if term is None or term.number is None or term.law.number is None or term.number == term.law.number.usual:
        return {}
    return {term.law.number.key.removesuffix("s"): term.number}
