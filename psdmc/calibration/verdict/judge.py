"""The verdict on a calibration, from its record and from the log's own evidence.

A calibration is refused for too few samples, a joint whose torque has the wrong size or sign compared with the file's,
friction that gives power, and held-out data that the model does not predict. Doubts only are a fair fit, a joint that
hardly moves, an effect that the model lacks, and parameters that the data leave open. docs/calibration.md lists the
limits, decision 0021 their reasons.
"""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.calibration.verdict.doubts import doubts, fits_poorly
from psdmc.calibration.verdict.evidence import Evidence
from psdmc.calibration.verdict.findings import Demand, Findings
from psdmc.calibration.verdict.reasons import reasons
from psdmc.calibration.verdict.record import Calibration
from psdmc.calibration.verdict.suspects import suspect
from psdmc.calibration.verdict.units import unit_suspect
from psdmc.calibration.verdict.verdict import Verdict
from psdmc.calibration.verdict.verdict_limits import VerdictOptions


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
        delays=found.delays,
    )


def _suspects(found: Findings) -> tuple[str, ...]:
    """Explanations of a bad fit; none for a log too short to tell."""
    if found.starved:
        return ()
    named = (suspect(found.evidence), unit_suspect(found.gains))
    return tuple(text for text in named if text is not None)
