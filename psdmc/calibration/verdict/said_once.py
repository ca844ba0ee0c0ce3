"""Warnings that the verdict does not repeat."""

from __future__ import annotations

from psdmc.calibration.verdict.record import Calibration

SAME = (
    ("the residual is no noise", "the model lacks an effect"),
    ("not positive definite", "not positive definite"),
    ("torque constant is negative", "the torque constant is negative"),
    ("stand still", "hardly move"),
)
"""Words of a warning, and of the doubt with the same meaning."""


def unsaid_warnings(record: Calibration) -> tuple[str, ...]:
    """A record's warnings without those that a doubt of its verdict repeats."""
    if record.verdict is None:
        return record.warnings
    doubts = record.verdict.doubts
    said = [warned for warned, doubted in SAME if any(doubted in doubt for doubt in doubts)]
    return tuple(text for text in record.warnings if not any(words in text for words in said))
