"""The default target, and the others that users choose by name, such as "cortex-m4f".

The default has the same costs on every machine. Its C code uses the vectors of the machine for which it is compiled."""

from __future__ import annotations

from dataclasses import replace

from psdmc.errors import InputError
from psdmc.target.target import AVX, AVX512, FORMS, NEON, SSE2, WIDEST_FIRST, Costs, Latency, Target

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


X86_64_V2 = replace(
    NATIVE,
    name="x86-64-v2",
    about="x86-64 with SSE4.2 (2009), no multiply-add: vectors of 16 bytes alone",
    vectors=(SSE2,),
    flags=("-march=x86-64-v2",),
    host_flags=(),
    costs=replace(
        COSTS,
        latency=Latency(load=5, add=3, mul=5, fused=8, div=20, neg=1, sincos=80, choice=5, call=90),
        fused=0.0,
        sincos=40.0,
        call=60.0,
        angles_per_sincos=2,
        registers=16,
    ),
)
"""Latencies of Nehalem. The inline sincos has a third more instructions than with multiply-adds (gcc 12: 104 and 79)."""

X86_64_V3 = replace(
    NATIVE,
    name="x86-64-v3",
    about="x86-64 with AVX2 and FMA (2013): vectors of 32 bytes alone",
    vectors=(AVX,),
    flags=("-march=x86-64-v3",),
    host_flags=(),
    costs=replace(COSTS, angles_per_sincos=4, registers=16),
)

X86_64_V4 = replace(
    NATIVE,
    name="x86-64-v4",
    about="x86-64 with AVX-512 (2017): vectors of 64 bytes alone",
    vectors=(AVX512,),
    flags=("-march=x86-64-v4",),
    host_flags=(),
)
"""The default's figures are those of this machine: the same arithmetic, shorter C."""

AARCH64 = replace(
    NATIVE,
    name="neon",
    about="64-bit Arm: NEON's vectors of 16 bytes alone",
    vectors=(NEON,),
    flags=("-march=armv8-a",),
    host_flags=(),
    costs=replace(
        COSTS,
        latency=Latency(load=5, add=2, mul=3, fused=4, div=15, neg=2, sincos=60, choice=4, call=60),
        angles_per_sincos=2,
    ),
)
"""Latencies of Cortex-A76, from Arm's optimization guide."""

SCALAR = replace(
    NATIVE,
    name="scalar",
    about="any C99 compiler: plain C, no vectors and no extensions asked for",
    vectors=(),
    blocks_ahead=0,
    host_flags=(),
    costs=replace(COSTS, sincos=60.0, angles_per_sincos=1, registers=16),
)
"""Each angle has a sincos of its own: some 60 operations and moves."""

CORTEX_M4F = replace(
    SCALAR,
    name="cortex-m4f",
    about="Cortex-M4 with its single-precision unit: float, no libm, one state a call",
    real="float32",
    trig="freestanding",
    forms=("single",),
    texts=False,
    hosted=False,
    tools="arm-none-eabi-",
    flags=("-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard"),
    costs=replace(
        SCALAR.costs,
        latency=Latency(load=3, add=2, mul=2, fused=4, div=15, neg=2, sincos=120, choice=4, call=150),
        div=14.0,
        neg=1.0,
        fused=0.0,
        sincos=100.0,
        choice=3.0,
        call=150.0,
        registers=32,
        spills_wait=True,
    ),
)
"""Cycles from Arm's reference manual: VADD and VMUL 1, VFMA 3, VDIV 14, VLDR 2, one more where the next instruction
uses the result. So a multiply-add saves code, not time."""

CORTEX_M7 = replace(
    CORTEX_M4F,
    name="cortex-m7",
    about="Cortex-M7 with its double-precision unit: double, no libm, one state a call",
    real="float64",
    flags=("-mcpu=cortex-m7", "-mthumb", "-mfpu=fpv5-d16", "-mfloat-abi=hard"),
    costs=replace(
        CORTEX_M4F.costs,
        latency=Latency(load=3, add=3, mul=4, fused=7, div=30, neg=1, sincos=120, choice=4, call=150),
        div=20.0,
        neg=0.5,
        fused=0.5,
        sincos=80.0,
        choice=3.0,
        call=150.0,
        registers=16,
    ),
)
"""Arm publishes no cycles for this core: these are estimates from its pipeline (in order, two instructions a cycle)."""

PRESETS = {
    target.name: target
    for target in (NATIVE, X86_64_V2, X86_64_V3, X86_64_V4, AARCH64, SCALAR, CORTEX_M4F, CORTEX_M7)
}


def preset(name: str) -> Target:
    """Return the target (processor) with this name, such as "cortex-m4f". Raises InputError if there is none."""
    if name not in PRESETS:
        raise InputError(f"target is {name!r}", f"choose one of {', '.join(PRESETS)}")
    return PRESETS[name]
