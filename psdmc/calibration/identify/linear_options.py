"""Options of a linear fit: filter, split for validation, friction terms, and the tables of a log description."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from psdmc.calibration.columns.columns import Columns, read_columns
from psdmc.calibration.identify.estimate import FitOptions
from psdmc.calibration.logs.filter import SplitOptions
from psdmc.calibration.logs.log import HELD_BYTES
from psdmc.calibration.logs.log_checks import CheckOptions
from psdmc.calibration.logs.log_survey import STRETCH_ROWS
from psdmc.calibration.logs.low_pass import FilterOptions
from psdmc.friction.law import Term
from psdmc.friction.terms import every_joint_s
from psdmc.model.calibrated import Matrix
from psdmc.robot.mechanism import Mechanism


@dataclass(frozen=True, slots=True)
class ElasticityOptions:
    """The statements of a log description about elastic joints.

    asked          whether the description asks for joint stiffnesses; then a log without two encoders is refused
    joints         joints whose stiffness is asked for; empty: all joints with two encoders
    drive_inertia  known drive inertias at the joint, kg m^2 (kg), by joint; the others are fitted with the stiffness
    """

    asked: bool = False
    joints: tuple[str, ...] = ()
    drive_inertia: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class LinearOptions:
    """Options of the linear fit of plain logs.

    filter      low-pass filter of the logs
    split       share of each log that is held out for validation
    exponents   exponents d of the viscous terms |qd|^d sign(qd), each with its own coefficient
    sign_speed  rad/s over which Coulomb friction changes sign: tanh(qd / sign_speed)
    offset      whether each joint has a constant torque
    coupling    matrix C of q_joint = C q_motor if several motors drive a joint; friction then acts on the motors.
                Empty: none
    stretch     number of rows of a log that are filtered at once
    held_bytes  largest number of bytes of columns in memory; more of them go to a temporary file
    tables      springs and friction of a log description, as TOML gives them (docs/how-to/springs-and-friction.md,
                priors.md)
    tables_from  name of the file with these tables, for messages
    columns     springs and further friction of a robot, made from these tables; each value is one more unknown
    elasticity  what is asked for and known of elastic joints
    """

    filter: FilterOptions = field(default_factory=lambda: FilterOptions(cutoff=8.0))
    split: SplitOptions = field(default_factory=lambda: SplitOptions(held_out=0.3, blocks=0))
    fit: FitOptions = field(default_factory=lambda: FitOptions(method="irls"))
    check: CheckOptions = field(default_factory=CheckOptions)
    exponents: tuple[float, ...] = (1.0,)
    sign_speed: float = 0.03
    offset: bool = True
    coupling: Matrix = ()
    stretch: int = STRETCH_ROWS
    held_bytes: int = HELD_BYTES
    tables: Mapping[str, Any] = field(default_factory=dict)
    tables_from: str = "description"
    columns: Columns = field(default_factory=Columns)
    elasticity: ElasticityOptions = field(default_factory=ElasticityOptions)

    @property
    def terms(self) -> tuple[Term, ...]:
        """Friction terms of every joint."""
        return every_joint_s(self.exponents, self.offset)

    def for_robot(self, chain: Mechanism) -> LinearOptions:
        """Return the options with one robot's springs and friction, from `tables`. Raises InputError if they are wrong."""
        folder = Path(self.tables_from).parent
        columns = read_columns(self.tables, chain, self.tables_from, self.offset, folder)
        return replace(self, columns=columns, offset=self.offset and columns.plain_offsets)
