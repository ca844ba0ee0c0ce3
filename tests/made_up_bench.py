"""A benchmark's result with made-up figures, for tables and pages."""

from __future__ import annotations

from dataclasses import replace

from psdmc.bench.contestant import Unavailable
from psdmc.bench.machine import Machine
from psdmc.bench.measure import Spread, Tail, Times
from psdmc.bench.results import BenchResult, CaseResult, Measurement, ThreadTime


def times(ns: float) -> Times:
    return Times(
        Spread(ns, ns - 1, ns + 1, ns - 2),
        Spread(1.3 * ns, ns, 2 * ns, ns),
        Tail(ns, 2 * ns, 3 * ns, 10_240),
        Spread(20 * ns, 18 * ns, 22 * ns, 17 * ns),
    )


def measurement(
    rival: str, function: str, ns: float, variant: str = "", layout: str = "state"
) -> Measurement:
    operations = (225, 222) if rival.startswith("psdmc") else None
    code = 12_345 if rival.startswith("psdmc") else None
    return Measurement(rival, variant, function, layout, 1e-15, times(ns), operations, 885.0, code)


def made_up_result() -> BenchResult:
    """One robot with every rival, rows, threads and two cut arms."""
    functions = ("inverse_dynamics", "forward_dynamics")
    found = [measurement("psdmc factored", f, 50.0) for f in functions]
    found += [measurement("psdmc factored", f, 10.0, layout="rows") for f in functions]
    found += [measurement("psdmc expanded", f, 1300.0) for f in functions]
    found += [measurement("Pinocchio", "inverse_dynamics", 600.0)]
    found += [
        measurement("Pinocchio", "forward_dynamics", ns, way)
        for ns, way in ((1200.0, "LOCAL"), (1000.0, "WORLD"))
    ]
    threads = (
        ThreadTime("inverse_dynamics", "rows", 1, 10.0),
        ThreadTime("inverse_dynamics", "rows", 2, 5.0),
    )
    why = Unavailable("CasADi", "the wheel 'casadi' is <not> installed")
    case = CaseResult("Denso", "seed 4", 6, 1295, 30, 0.1, 2**20, tuple(found), (why,), (), 10, True, threads)
    machine = Machine("a processor", 2, "Linux", "gcc 12", "-O3", "none", "3.11", "2.0")
    grown = tuple(replace(case, name=f"LBR {n} joints", n=n) for n in (2, 3))
    return BenchResult(machine, {"psdmc": "0.1.0"}, 1, 65_536, (case,), grown)
