"""The default target. It has the same costs on every machine, and C code that uses the SIMD vectors of the machine for
which the compiler builds."""

from __future__ import annotations

from psdmc.target.costs import Costs, Latency
from psdmc.target.target import FORMS, Target
from psdmc.target.vectors import WIDEST_FIRST

COSTS = Costs(
    latency=Latency(load=5, add=3, mul=3, fused=4, div=13, neg=1, sincos=60, choice=5, call=60),
    div=8.0,
    neg=0.1,
    fused=0.5,
    sincos=30.0,
    choice=2.0,
    call=40.0,
    angle=1.0,
    angles_per_sincos=8,
    registers=32,
    spills_wait=False,
    crowded=1.08,
    worth_two_bodies=1.03,
    worth_sharing=1.003,
    shared_from=1000.0,
    longest_of_two=1500.0,
    worth_limbs=1.05,
    limb_real=1.0,
    limb_shared=0.5,
    limb_sum=4.0,
    loops_from=6,
)
"""For a current x86 or Arm core with 64-byte vectors. Never detected, so that lowering gives the same result on every
machine. With this `crowded`, forward dynamics alone has an order for lanes (KR6: the other order keeps 21 % more
values alive; 8 lanes take 13.7 ns a state with it and 12.8 ns with their own). `worth_two_bodies` and
`longest_of_two` limit the length of the C: KR6's package with derivatives has 626 KiB of source instead of 662, and
3 % more arithmetic in one function's `_theta_batch`."""

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
"""The package's bytes are the same on every machine. psdmc.compile, or a package's user, asks the compiler for the
machine at hand."""
