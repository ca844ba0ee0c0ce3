"""Contestants small enough to compile in a second: what they put out is known without any robot."""

from __future__ import annotations

from psdmc.bench.contestant import Contestant, source
from psdmc.bench.machine import built, cxx

BODIES = {
    # What inverse dynamics of the two-link arm would be if it were this simple.
    "sums": "for (int j = 0; j < 2; ++j) out[j] = q[j] + 10.0 * qd[j] + 100.0 * x[j];",
    "few": 'asm volatile(".rept 10\\n nop\\n .endr"); out[0] = q[0];',
    "many": 'asm volatile(".rept 1010\\n nop\\n .endr"); out[0] = q[0];',
    # From one cache line of 256 KiB to another that no prefetcher expects.
    "walk": "static volatile double lines[32768] = {1.0}; std::size_t at = 1; "
    "for (int k = 0; k < 4096; ++k) at = (at * 1229 + 1 + (std::size_t)lines[8 * at]) % 4096; out[0] = double(at);",
}

BATCH_BODY = (
    "for (std::size_t i = 0; i < count; i += 4) for (int j = 0; j < 2; ++j) for (int k = 0; k < 4; ++k) "
    "{ const std::size_t at = 2 * i + 4 * j + k; out[at] = q[at] + 10.0 * qd[at] + 100.0 * x[at]; }"
)


def tiny(symbol: str, **fields: object) -> Contestant:
    """A contestant of BODIES, or 'by_lane', the sums on blocks of four states."""
    state = "const double *q, const double *qd, const double *x, double *out"
    lines = ['#include "loops.hpp"']
    lines += [f"PSDMC_CONTESTANT({name}, []({state}) {{ {body} }})" for name, body in BODIES.items()]
    lines += [f"PSDMC_BATCH_CONTESTANT(by_lane, [](std::size_t count, {state}) {{ {BATCH_BODY} }})"]
    sources = {"tiny.cpp": "\n".join(lines) + "\n", "loops.hpp": source("loops.hpp")}
    command = [cxx(), "-std=c++17", "-O1", "-fPIC", "-shared", "tiny.cpp", "-o", "tiny.so"]
    library = built("tiny.so", command, sources)
    return Contestant("tiny", "inverse_dynamics", library, symbol, 2, **fields)  # type: ignore[arg-type]
