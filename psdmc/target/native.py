"""The default target: fixed figures, and C that takes the vectors of whatever machine its compiler is told of."""

from __future__ import annotations

from psdmc.target.costs import Costs, Latency
from psdmc.target.target import FORMS, Target
from psdmc.target.vectors import WIDEST_FIRST

COSTS = Costs(
    latency=Latency(load=5, add=3, mul=3, fused=4, div=13, neg=1, sincos=60),
    div=8.0,
    neg=0.1,
    fused=0.5,
    sincos=30.0,
    angle=1.0,
    angles_per_sincos=8,
    registers=32,
    spills_wait=False,
    crowded=1.08,
    worth_two_bodies=1.03,
    longest_of_two=1500.0,
)
"""About a current x86 or Arm core with 64-byte vectors. Never detected, so that every machine lowers alike. `crowded`
lets forward dynamics alone have an order for lanes (KR6: 21 % more alive in the other; 8 lanes take 13.7 ns a state so,
12.8 ns in their own); `worth_two_bodies` weighs the length of the C, `longest_of_two` too: KR6's package
with derivatives has 626 KiB of source instead of 662, and 3 % more arithmetic in one function's `_theta_batch`."""

NATIVE = Target(
    name="native",
    about="any machine: C that takes the widest vectors its compiler is told of",
    real="float64",
    trig="inline",
    vectors=WIDEST_FIRST,
    forms=FORMS,
    texts=True,
    hosted=True,
    cache_line=64,
    blocks_ahead=2,
    flags=(),
    host_flags=("-march=native", "-mcpu=native"),
    costs=COSTS,
)
"""The package's bytes are the same on every machine: it is psdmc.compile, and a package's user, who ask the compiler for
the machine at hand."""
