"""Output of `check` and `calibrate`: comparisons, the test of the mass matrix, the verdict, the accuracy."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from psdmc.cli.console import one_line
from psdmc.cli.tables import Table, print_line, print_table

if TYPE_CHECKING:
    from psdmc.model.calibrated import Calibrated, Verdict
    from psdmc.model.mass_check import MassCheck
    from psdmc.verification.check import CheckRow


def megabytes(size: int) -> str:
    """A size in bytes, in words."""
    return f"{size / 2**20:.1f} MiB"


def print_check(rows: Sequence[CheckRow]) -> None:
    """Print the result of each comparison, and which programs read the robot file."""
    from psdmc.verification.check import readers

    texts = []
    for row in rows:
        limit = "" if row.limit is None else f"{row.limit:.0e}"
        error = "" if math.isnan(row.error) and row.limit is None else f"{row.error:.1e}"
        verdict = "" if row.limit is None else "pass" if row.passed else "FAIL"
        remark = f" ({row.remark})" if row.remark else ""
        texts.append((verdict, error, limit, f"{row.name}: {row.against}{remark}"))
    print_table(
        Table(("result", "error", "limit", "relative error of what, against what"), texts, prose=True)
    )
    print_line(readers(rows))


def print_mass_check(mass: MassCheck | None) -> None:
    """Print whether the mass matrix is positive definite within the joint limits, or why that was not tested."""
    if mass is None:
        print("mass matrix: not tested, for the base parameters are unknown")
        return
    print(f"{'pass' if mass.passed else 'FAIL'}: {mass.reason}")


def print_verdict(verdict: Verdict) -> None:
    """Print whether a calibration can be used, with reasons and doubts."""
    for line in verdict.lines():
        print(one_line(line))


def print_proposal(record: Calibrated) -> None:
    """Print the lines of a log description that describe a coupling which the calibration found; nothing if it found
    none."""
    from psdmc.model.calibrated import PROPOSED_COUPLING

    proposed = record.facts.get(PROPOSED_COUPLING)
    if proposed is not None:
        print("# proposed for log.toml, not applied:")
        print(proposed["toml"])


def print_accuracy(record: Calibrated) -> None:
    """Print R^2 on held-out data for each joint and step of the calibration."""
    rows = []
    for joint in record.joint_names:
        both = [step.joints.get(joint) for step in record.steps]
        rows.append((joint, *("" if b is None else f"{b.held_out.r2:.4f}" for b in both)))
    print_table(Table(("joint", *(f"{step.step} R^2" for step in record.steps)), rows))


def print_elasticity(record: Calibrated) -> None:
    """Print stiffness and damping of the joints with two encoders; nothing if there are none."""
    rows = [
        (
            row.joint,
            row.name,
            f"{row.value:.6g}",
            f"{row.std:.2g}",
            f"{row.std / abs(row.value):.2%}",
            row.unit,
        )
        if math.isfinite(row.std)
        else (row.joint, row.name, "not determined", "", "", row.unit)
        for row in record.elasticity
    ]
    if rows:
        print_table(Table(("joint", "elasticity", "value", "standard deviation", "of it", "unit"), rows))


def print_torque_constants(record: Calibrated) -> None:
    """Print the torque constants that the calibration found, with standard deviations; nothing if it found none."""
    found = [row for row in record.motors if row.seen]
    rows = [
        (row.joint, f"{row.value:.6g}", f"{row.std:.2g}", f"{row.std / abs(row.value):.2%}") for row in found
    ]
    if rows:
        print_table(Table(("joint", "torque constant [N m/A]", "standard deviation", "of it"), rows))
