"""The numbers of the benchmark's HTML page, formatted as text for its templates."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from psdmc.bench.results import BenchResult, CaseResult, Measurement
from psdmc.bench.run import SCALED
from psdmc.functions import RECIPES

OURS = "psdmc factored"
PINOCCHIO = "Pinocchio"
CASADI = "CasADi"

FUNCTION_TITLES = {name: recipe.title[0].upper() + recipe.title[1:] for name, recipe in RECIPES.items()}

Cells = tuple[str, ...]
"""Texts of one row of a table; the template names them."""

LAYOUT_TITLES = {"state": "one state per call", "rows": "batch, rows", "lanes": "batch, lane by lane"}


@dataclass(frozen=True, slots=True)
class Row:
    """One row of a robot's table as text: the result of one library. `ours` is true for psdmc."""

    who: str
    how: str
    operations: str
    instructions: str
    ns: str
    spread: str
    latency: str
    cold: str
    code: str
    worst: str
    ratio: str
    error: str
    ours: bool


@dataclass(frozen=True, slots=True)
class FunctionTable:
    """One function's rows, fastest first."""

    title: str
    rows: tuple[Row, ...]


def headlines(result: BenchResult) -> tuple[tuple[str, tuple[Cells, ...]], ...]:
    """Return a row for every robot: its name, then cells for inverse and for forward dynamics. The cells are psdmc's time
    in ns, and how many times faster it is than Pinocchio and than C code of CasADi. Two more cells are for batch calls,
    by rows and lane by lane, over Pinocchio. Pinocchio's faster algorithm counts."""
    return tuple(
        (case.name, tuple(_headline(case, function) for function in SCALED)) for case in result.cases
    )


def _headline(case: CaseResult, function: str) -> Cells:
    ours = case.best(OURS, function)
    batches = (("state", PINOCCHIO), ("state", CASADI), ("rows", PINOCCHIO), ("lanes", PINOCCHIO))
    ratios = (case.ratio(function, layout, over=rival, rival=OURS) for layout, rival in batches)
    return (f"{ours.ns:.0f}" if ours else "–", *(f"{ratio:.1f}" if ratio else "–" for ratio in ratios))


def function_tables(case: CaseResult) -> tuple[FunctionTable, ...]:
    """Return a table of times for each function that was measured on a robot."""
    functions = dict.fromkeys(m.function for m in case.measurements)
    return tuple(FunctionTable(FUNCTION_TITLES[f], tuple(_rows(case, f))) for f in functions)


def _rows(case: CaseResult, function: str) -> Iterator[Row]:
    reference = case.best(PINOCCHIO, function)
    for m in sorted((m for m in case.measurements if m.function == function), key=lambda m: m.ns):
        yield _row(m, reference.ns if reference else None)


def _row(m: Measurement, reference: float | None) -> Row:
    times = m.times
    return Row(
        who=m.label,
        how=LAYOUT_TITLES[m.layout],
        operations="{} + {}".format(*m.operations) if m.operations else "",
        instructions=f"{m.instructions:.0f}" if m.instructions is not None else "",
        ns=f"{m.ns:.1f}",
        spread=f"{times.throughput.low:.1f} – {times.throughput.high:.1f}",
        latency=f"{times.latency.median:.1f}" if times.latency else "",
        cold=f"{times.cold.median:,.0f}" if times.cold else "",
        code=f"{m.code_bytes / 1e3:.1f}" if m.code_bytes is not None else "",
        worst=f"{times.tail.percentile_99_99:.0f} / {times.tail.worst:.0f}" if times.tail else "",
        ratio=f"{reference / m.ns:.1f}×" if reference else "",
        error=f"{m.error:.0e}",
        ours=m.rival.startswith("psdmc"),
    )


def quoted_table() -> tuple[Cells, ...]:
    """Denso-2022's table 5 as printed."""
    first = DENSO_TABLE_5[0]
    return tuple(
        _quoted(row.method, row.inverse, row.forward, first.inverse, first.forward) for row in DENSO_TABLE_5
    )


def own_table(result: BenchResult) -> tuple[Cells, ...]:
    """Return table 5 of Denso-2022 with times of this machine; empty if the Denso was not measured."""
    case = next((case for case in result.cases if case.name == "Denso"), None)
    if case is None:
        return ()
    found = []
    for rival in (OURS, "psdmc expanded", PINOCCHIO, CASADI):
        pair = tuple(case.best(rival, function) for function in SCALED)
        if pair[0] and pair[1]:
            found.append((rival, pair[0].ns, pair[1].ns))
    return tuple(_quoted(rival, i, f, found[0][1], found[0][2]) for rival, i, f in found)


def _quoted(method: str, inverse: float, forward: float, inverse_one: float, forward_one: float) -> Cells:
    """A row of table 5: the library, its times, and their ratios to those of the first row."""
    return (
        method,
        f"{inverse / 1e3:.3g} µs",
        f"{forward / 1e3:.3g} µs",
        f"{inverse / inverse_one:.3g}",
        f"{forward / forward_one:.3g}",
    )


def published_rows(result: BenchResult) -> tuple[Cells, ...]:
    """Return rows with times of inverse and forward dynamics in ns, for robots that the authors published."""
    rows = []
    for case in result.cases:
        theirs = PUBLISHED.get(case.name)
        if theirs is None:
            continue
        seconds = f"{case.derive_seconds:.1f} s" if case.derive_seconds is not None else "–"
        rows.append(
            (
                case.name,
                theirs.source,
                f"{theirs.inverse:.0f} / {theirs.forward:.0f}",
                _pair(case, "psdmc expanded"),
                _pair(case, OURS),
                f"{theirs.derivation:g} s / {seconds}",
            )
        )
    return tuple(rows)


def _pair(case: CaseResult, rival: str) -> str:
    both = tuple(case.best(rival, function) for function in SCALED)
    return " / ".join(f"{m.ns:.0f}" if m else "–" for m in both)


def scaling_rows(result: BenchResult) -> tuple[Cells, ...]:
    """Return rows with the times of inverse and forward dynamics in ns, by number of joints."""
    return tuple(
        (
            str(case.n),
            f"{case.p if case.p is not None else 'not expanded'} / {case.l}",
            f"{case.derive_seconds:.2f} s" if case.derive_seconds is not None else "–",
            f"{case.derive_bytes / 2**20:.0f} MiB" if case.derive_bytes is not None else "–",
            f"{_pair(case, OURS)} ({_operations(case, OURS)})",
            f"{_pair(case, 'psdmc expanded')} ({_operations(case, 'psdmc expanded')})",
            _pair(case, PINOCCHIO),
        )
        for case in result.scaling
    )


def _operations(case: CaseResult, rival: str) -> str:
    both = tuple(case.best(rival, function) for function in SCALED)
    return " / ".join(str(sum(m.operations)) if m and m.operations else "–" for m in both)


def thread_rows(result: BenchResult) -> tuple[tuple[str, str, str, Cells, str], ...]:
    """Return rows with ns per state by number of threads, and the speed-up of the most threads over one."""
    rows = []
    for case in result.cases:
        for function, layout in dict.fromkeys((t.function, t.layout) for t in case.threads):
            own = [t for t in case.threads if (t.function, t.layout) == (function, layout)]
            times = tuple(f"{t.ns:.1f}" for t in own)
            speedup = f"{own[0].ns / own[-1].ns:.2f}×"
            rows.append((case.name, FUNCTION_TITLES[function], LAYOUT_TITLES[layout], times, speedup))
    return tuple(rows)


# Times that the authors of the method published: reports show them without ratios, as machines and inertias differ


@dataclass(frozen=True, slots=True)
class Published:
    """Published times of one robot in ns per call, and of its derivation in s; None if not published."""

    robot: str
    source: str
    inverse: float
    forward: float
    derivation: float | None


PSDM_2021 = "PSDM-2021 (Mech. Mach. Theory 156)"
DENSO_2022 = "Denso-2022, table 5"

PUBLISHED = {
    "Denso": Published("Denso", DENSO_2022, 400.0, 630.0, 3.0),
    "KR6": Published("KR6", PSDM_2021, 2110.0, 2270.0, 5.3),
    "LBR7": Published("LBR7", PSDM_2021, 6490.0, 7280.0, 88.0),
}
"""By the benchmark's name of the robot."""


@dataclass(frozen=True, slots=True)
class TableRow:
    """A row of table 5 of the paper Denso-2022: times in ns per call."""

    method: str
    inverse: float
    forward: float


DENSO_TABLE_5 = (
    TableRow("PSDM", 400.0, 630.0),
    TableRow("RNE", 6000.0, 19900.0),
    TableRow("RNE, regressive form", 17200.0, 112000.0),
)
