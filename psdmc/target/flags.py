"""Compiler flags for the generated C code on every target, for builds of packages and for psdmc's own builds."""

from __future__ import annotations

ARITHMETIC = ("-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math")
"""Fused multiply-adds, and no errno or floating-point traps, which the C does not use."""

GCC_ONLY = ("-fno-tree-slp-vectorize",)
"""GCC packs pairs of one state's scalars into vectors and spends more on packing than it saves: mass matrix 7 %,
regressor up to 6 %. clang's own packing saves time in code for lanes."""
