"""A calibration's record with its verdict, whose evidence is the logs that were fitted."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.calibration.identify.coupling import coupling_of
from psdmc.calibration.identify.four_steps import Runs
from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.logs.low_pass import FilterOptions
from psdmc.calibration.logs.stored_log import AnyLog
from psdmc.calibration.verdict.delivered import delivered, sprung
from psdmc.calibration.verdict.evidence import Motion, evidence_of
from psdmc.calibration.verdict.findings import Demand
from psdmc.calibration.verdict.judge import judge
from psdmc.calibration.verdict.record import Calibration, with_verdict
from psdmc.calibration.verdict.verdict_limits import VerdictOptions
from psdmc.model.dynamics_model import DynamicsModel


def with_verdict_on_logs(
    record: Calibration,
    model: DynamicsModel,
    regressor: Regressor,
    logs: Sequence[AnyLog],
    motors: Motors,
    options: FilterOptions,
    limits: VerdictOptions,
) -> Calibration:
    """The record of a fit of plain logs, with its verdict.

    model   as it was given, whose theta_b is the file's; record holds the calibrated one
    """
    matrix = () if record.prediction is None else record.prediction.coupling
    springs = sprung(delivered(record.model))
    motions = [Motion(log) for log in logs]
    evidence = evidence_of(model, regressor, motions, motors, options, coupling_of(matrix), springs)
    demand = Demand("linear fit", _fitted(record, "All"), record.facts["rank"])
    return with_verdict(record, judge(record, evidence, [demand], limits))


def with_verdict_on_campaign(
    record: Calibration,
    model: DynamicsModel,
    regressor: Regressor,
    runs: Runs,
    motors: Motors,
    options: FilterOptions,
    limits: VerdictOptions,
) -> Calibration:
    """The record of a campaign with its verdict: gains and friction are judged on its exciting motions."""
    motions = [Motion(run.log, run.tool) for run in runs.inertial]
    evidence = evidence_of(model, regressor, motions, motors, options)
    demands = [
        Demand("gravity", _fitted(record, "Gravity"), record.facts["gravity_rank"]),
        Demand("inertial", _fitted(record, "All"), record.facts["inertial_rank"]),
    ]
    return with_verdict(record, judge(record, evidence, demands, limits))


def _fitted(record: Calibration, step: str) -> int:
    """Independent samples that a step was fitted to, all joints together."""
    samples = next(found.samples for found in record.steps if found.step == step)
    return sum(int((~sample.held_out).sum()) for sample in samples)
