"""A run as text for a terminal."""

from __future__ import annotations

from psdmc.bench.results import BenchResult, CaseResult, Measurement


def as_text(result: BenchResult) -> str:
    """Per robot and function: operations, ns, quartiles, latency, error, and how many times slower than the fastest."""
    machine = result.machine
    head = [f"{machine.processor}, {machine.cores} cores, {machine.compiler}, {machine.flags}"]
    return "\n".join(head + [line for case in result.cases for line in _case_lines(case)])


def _case_lines(case: CaseResult) -> list[str]:
    idle = "machine idle" if case.idle else "MACHINE BUSY: times are not reliable"
    lines = [
        "",
        f"{case.name}: n {case.n}, p {case.p}, l {case.l}; {case.note}; {case.rounds} trials, {idle}",
    ]
    for function in dict.fromkeys(m.function for m in case.measurements):
        lines.append(f"  {function}")
        same = [m for m in case.measurements if m.function == function]
        lines += [_line(m) for m in sorted(same, key=lambda m: m.ns)]
    lines += [f"  not measured: {u.rival}: {u.reason}" for u in (*case.unavailable, *case.wrong)]
    return lines


def _line(m: Measurement) -> str:
    operations = f"{m.operations[0]} + {m.operations[1]}" if m.operations else ""
    spread = m.times.throughput
    text = f"    {m.label:<32} {m.layout:<6} {operations:>14} {m.ns:10.1f} ns  [{spread.low:.1f}, {spread.high:.1f}]"
    if m.times.latency:
        text += f"  latency {m.times.latency.median:.1f}"
    return f"{text}  error {m.error:.0e}"
