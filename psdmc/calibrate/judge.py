"""The verdict on a calibration, from its record and from the log's own evidence.

What refuses: too few samples, a joint whose torque has the wrong size or sign beside the file's, friction that gives
power, held-out data that the model does not follow. What raises a doubt only: a fit that is fair, a joint that hardly
moves, an effect that the model lacks, parameters that the data leave open. docs/calibration.md lists the limits, decision
0021 says why.
"""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.calibrate.doubts import doubts, fits_poorly
from psdmc.calibrate.evidence import Evidence
from psdmc.calibrate.findings import Demand, Findings
from psdmc.calibrate.reasons import reasons
from psdmc.calibrate.record import Calibration
from psdmc.calibrate.suspects import suspect
from psdmc.calibrate.units import unit_suspect
from psdmc.calibrate.verdict import Verdict
from psdmc.calibrate.verdict_limits import VerdictOptions


def judge(
    record: Calibration,
    evidence: Evidence,
    demands: Sequence[Demand],
    options: VerdictOptions | None = None,
) -> Verdict:
    """The verdict; `evidence` holds the model as it was before, whose theta_b is the file's."""
    found = Findings(record, evidence, tuple(demands), options or VerdictOptions())
    against, doubted = list(reasons(found)), list(doubts(found))
    likely = _suspects(found)
    if likely and not against:
        (against if fits_poorly(found) else doubted).append("the log contradicts the model's joints")
    return Verdict(
        reasons=tuple(against),
        doubts=tuple(doubted),
        suspects=likely,
        joints=tuple(found.figures(k) for k in range(len(found.names))),
        samples_per_unknown=min((demand.per_unknown for demand in found.demands), default=float("inf")),
    )


def _suspects(found: Findings) -> tuple[str, ...]:
    """None of a log too short to tell."""
    if found.starved:
        return ()
    named = (suspect(found.evidence), unit_suspect(found.gains))
    return tuple(text for text in named if text is not None)
