"""The record of one linear fit of plain logs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.identify.linear_fit import LinearResult
from psdmc.calibration.identify.linear_options import LinearOptions
from psdmc.calibration.identify.prediction import LINEAR, Prediction
from psdmc.calibration.identify.steps import StepOptions
from psdmc.calibration.identify.visibility import (
    IDENTIFIED,
    as_fitted,
    visibility,
    visibility_warnings,
    weak_notes,
)
from psdmc.calibration.logs.log import Array
from psdmc.calibration.verdict.record import Calibration, NumberRow, with_model
from psdmc.calibration.verdict.record_rows import (
    by_joint,
    dropped_links,
    kept_at,
    motor_rows,
    parameter_rows,
    unit_of,
)
from psdmc.model.dynamics_model import DynamicsModel


def linear_record(
    model: DynamicsModel, found: LinearResult, values: Array, options: LinearOptions
) -> Calibration:
    """The record of a linear fit with these values of the whole vector, without its quality."""
    problem, solved = found.problem, found.estimate
    names = (*model.base_parameters.labels, *problem.names)
    at = kept_at(model, values, found.prior.scale, found.prior.values)
    seen = visibility(names, values, solved.std, solved.unseen, at)
    dropped = np.zeros(len(values), dtype=bool) if found.dropped is None else found.dropped
    stated = np.arange(len(values)) < (model.l if found.stated else 0)
    stated[list(model.unknown_base_parameters)] = False
    seen = as_fitted(seen, at, dropped, stated)
    facts = {
        "rank": solved.rank,
        "unknowns": len(values),
        "condition": solved.condition,
        "singular_values": solved.singular_values.tolist(),
        "residual_correlation": by_joint(model, solved.correlation),
        "noise_factor": solved.noise_factor,
    }
    std = solved.std

    def row(k: int, owner: str, name: str, unit: str) -> NumberRow:
        word = seen.words[k]
        return NumberRow(owner, name, float(values[k]), float(std[k]), unit, word == IDENTIFIED, word)

    joints = {joint.name: joint for joint in model.mechanism.joints}
    turning = {
        name: unit for term in problem.terms for name, unit in zip(term.names, term.units(), strict=True)
    }
    friction = [
        row(k, owner, name, unit_of(joints[owner], turning[name]))
        for k, (owner, name) in enumerate(problem.plain, start=model.l)
    ]
    unknowns = enumerate(problem.columns.unknowns, start=problem.first_extra)
    extra = [row(k, unknown.owner, unknown.name, unknown.unit) for k, unknown in unknowns]
    of_springs = problem.columns.of_springs
    step = StepOptions(options.filter, options.split, options.fit)
    return with_model(
        Calibration(
            robot=model.mechanism.name,
            method="linear fit",
            joint_names=model.joint_names,
            model=model,
            parameters=parameter_rows(model, values, solved.std, ["all"] * model.l, seen),
            motors=motor_rows(model, found.motors, None),
            friction=(*friction, *_chosen(extra, ~of_springs)),
            springs=_chosen(extra, of_springs),
            steps=(),
            warnings=(
                *dropped_links(model),
                *found.warnings,
                *visibility_warnings("linear fit", names, seen),
            ),
            facts=facts,
            prediction=Prediction(
                LINEAR,
                {"all": step},
                options.sign_speed,
                options.exponents,
                options.offset,
                coupling=options.coupling,
                columns=problem.columns.content,
            ),
            notes=(*_coupled_notes(options), *weak_notes("linear fit", names, seen)),
        ),
        values[: model.l],
    )


def _coupled_notes(options: LinearOptions) -> tuple[str, ...]:
    if not options.coupling:
        return ()
    return (
        "friction is of the motors, which are called like the joints: some of them drive several together",
    )


def _chosen(rows: Sequence[NumberRow], wanted: NDArray[np.bool_]) -> tuple[NumberRow, ...]:
    return tuple(row for row, is_wanted in zip(rows, wanted.tolist(), strict=True) if is_wanted)
