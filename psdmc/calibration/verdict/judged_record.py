"""A calibration's record with the figures of its model file: R^2, the price of physical consistency, the mass matrix."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from psdmc.calibration.identify.four_steps import Runs
from psdmc.calibration.identify.steps import StepQuality
from psdmc.calibration.logs.log_checks import CheckOptions
from psdmc.calibration.logs.stored_log import AnyLog
from psdmc.calibration.verdict.delivered import delivered_quality, reread
from psdmc.calibration.verdict.record import Calibration, with_model
from psdmc.model.mass_check import check_mass_matrix

WHOLE = "All"
"""The step whose quality is that of the whole torque."""


def judged_record(
    record: Calibration,
    source: Sequence[AnyLog] | Runs,
    plain: Calibration | None = None,
    distance: float | None = None,
    check: CheckOptions | None = None,
) -> Calibration:
    """The record with its quality on these logs or runs, read back from its model's file.

    plain     the unconstrained fit's record, where this one is physically consistent; distance from it in standard
              deviations
    """
    model = reread(record.model)
    steps = delivered_quality(model, source, check)
    mass = check_mass_matrix(model)
    facts = {**record.facts, "physically_consistent": plain is not None}
    notes, warnings = list(record.notes), list(record.warnings)
    if plain is not None and distance is not None:
        cost = _cost(plain.steps, steps)
        facts["physical_cost_r2"] = cost
        facts["physical_distance_std"] = distance
        notes.append(_price(cost, distance, _cost_of_friction(plain.steps, steps)))
    if mass is not None:
        facts["mass_matrix"] = {"poses": mass.poses, "failing": mass.failing, "smallest": mass.smallest}
        if not mass.passed:
            warnings.append(f"{mass.reason}: there is no forward dynamics")
    method = f"{record.method}, physically consistent" if plain is not None else record.method
    whole = replace(
        record, method=method, steps=steps, facts=facts, notes=tuple(notes), warnings=tuple(warnings)
    )
    return with_model(whole)


def _cost(before: Sequence[StepQuality], after: Sequence[StepQuality]) -> dict[str, float]:
    """Held-out R^2 of the whole torque that is lost, by joint."""
    was, now = ({step.step: step for step in steps}[WHOLE].joints for steps in (before, after))
    return {name: was[name].held_out.r2 - now[name].held_out.r2 for name in now}


def _cost_of_friction(before: Sequence[StepQuality], after: Sequence[StepQuality]) -> float | None:
    """The largest loss of held-out R^2 in any joint's friction run; None where there are no such runs."""
    was, now = ({step.step: step for step in steps}.get("Friction") for steps in (before, after))
    if was is None or now is None:
        return None
    return max(
        (was.joints[name].held_out.r2 - now.joints[name].held_out.r2 for name in now.joints), default=0.0
    )


def _price(cost: dict[str, float], distance: float, of_friction: float | None) -> str:
    words = ", ".join(f"{name} {-price:+.4f}" for name, price in cost.items())
    rubbed = "" if of_friction is None else f"; of friction runs by {-of_friction:+.4f} at worst"
    return (
        f"physical consistency moved the parameters by {distance:.3g} standard deviations in all and held-out R^2 by "
        f"{words}{rubbed}"
    )
