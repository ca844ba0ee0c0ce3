"""Compiler flags that suit psdmc's C on every target, in packages' own builds and in psdmc's."""

from __future__ import annotations

ARITHMETIC = ("-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math")
"""Fused multiply-adds; nothing in the C asks for errno or floating-point traps."""

GCC_ONLY = ("-fno-tree-slp-vectorize",)
"""GCC packs pairs of one state's scalars into vectors and spends more on packing than it saves: mass matrix 7 %,
regressor up to 6 %. clang's own packing pays in code for lanes."""
