"""Compiler flags for psdmc's C on every target, in packages' own builds and in psdmc's."""

from __future__ import annotations

ARITHMETIC = ("-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math")
"""Fused multiply-adds, and no errno or floating-point traps, which the C does not use."""

GCC_ONLY = ("-fno-tree-slp-vectorize",)
"""GCC packs pairs of one state's scalars into vectors and spends more on packing than it saves: mass matrix 7 %,
regressor up to 6 %. clang's own packing saves time in code for lanes."""
