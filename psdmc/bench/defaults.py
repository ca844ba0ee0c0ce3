"""Default values of the benchmark's options, in a module without imports: the help loads quickly."""

from __future__ import annotations

SEED = 20_260
ROUNDS = 10
"""Trials that count; with 1,024 blocks each, the 99.99th percentile is taken from more than 10,000 blocks."""
