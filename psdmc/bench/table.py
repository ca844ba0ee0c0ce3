"""A run as text for a terminal."""

from __future__ import annotations

from psdmc.bench.results import BenchResult, CaseResult, Measurement


def as_text(result: BenchResult) -> str:
    """Return the results as text, per robot and function: operations, ns, quartiles, latency, error, and time divided by
    the fastest."""
    machine = result.machine
    head = [f"{machine.processor}, {machine.cores} cores, {machine.compiler}, {machine.flags}"]
    return "\n".join(head + [line for case in result.cases for line in _case_lines(case)])


def _case_lines(case: CaseResult) -> list[str]:
    idle = "machine idle" if case.idle else "MACHINE BUSY: times are not reliable"
    facts = [f"n {case.n}, p {case.p}, l {case.l}", case.note, f"{case.rounds} trials, {idle}"]
    lines = ["", f"{case.name}: {'; '.join(fact for fact in facts if fact)}"]
    for function in dict.fromkeys(m.function for m in case.measurements):
        lines.append(f"  {function}")
        same = [m for m in case.measurements if m.function == function]
        lines += [_line(m) for m in sorted(same, key=lambda m: m.ns)]
    return lines + _not_measured(case)


def _not_measured(case: CaseResult) -> list[str]:
    """A line for each reason, with all rivals that it holds for."""
    missing = (*case.unavailable, *case.wrong)
    rivals = {u.reason: [other.rival for other in missing if other.reason == u.reason] for u in missing}
    return [
        f"  not measured: {', '.join(dict.fromkeys(names))}: {reason}" for reason, names in rivals.items()
    ]


def _line(m: Measurement) -> str:
    operations = f"{m.operations[0]} + {m.operations[1]}" if m.operations else ""
    spread = m.times.throughput
    text = f"    {m.label:<32} {m.layout:<6} {operations:>14} {m.ns:10.1f} ns  [{spread.low:.1f}, {spread.high:.1f}]"
    if m.times.latency:
        text += f"  latency {m.times.latency.median:.1f}"
    if m.times.cold:
        text += f"  cold {m.times.cold.median:.0f}"
    if m.code_bytes is not None:
        text += f"  code {m.code_bytes / 1e3:.1f} KB"
    return f"{text}  error {m.error:.0e}"
