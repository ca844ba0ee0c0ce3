"""What every robot of the campaign showed, a line of JSON each: pieces of the campaign add up in one file, and one that was
ended is taken up again."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from campaign_measure import limit_of

Outcome = dict[str, Any]

WORST_KEPT = 5
"""Robots named for each comparison."""


def read(path: Path) -> dict[int, Outcome]:
    """Outcomes by seed, the last one of a seed that ran twice; a line that a killed run left unfinished is left out."""
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    return {one["seed"]: one for one in map(_outcome, lines) if one}


def append(path: Path, one: Outcome) -> None:
    """One line, on a line of its own even after an unfinished one."""
    with path.open("a+b") as file:
        start = b""
        if file.seek(0, 2):
            file.seek(-1, 2)
            start = b"" if file.read(1) == b"\n" else b"\n"
        file.write(start + json.dumps(one).encode() + b"\n")


def _outcome(line: str) -> Outcome | None:
    try:
        return dict(json.loads(line))
    except ValueError:
        return None


def summary(outcomes: Iterable[Outcome]) -> dict[str, Any]:
    """Worst errors per comparison with their seeds, what raised, what failed, what was refused, by which commit."""
    found = sorted(outcomes, key=lambda one: one["seed"])
    compared: dict[str, list[tuple[float, int]]] = {}
    for one in found:
        for what, error in one.get("errors", {}).items():
            kind = "many scales: " if one["mixed"] else ""
            compared.setdefault(kind + what, []).append((error, one["seed"]))
    return {
        "robots": len(found),
        "commits": dict(Counter(one["commit"] for one in found)),
        "lowered": sum(one["lowered"] for one in found),
        "many scales": sum(one["mixed"] for one in found),
        "states": sum(one["count"] for one in found if "raised" not in one),
        "evaluated": dict(sum((Counter(one.get("states", {})) for one in found), Counter())),
        "cpu seconds": round(sum(one["cpu"] for one in found), 1),
        "worst": {
            what: {
                "robots": len(rows),
                "limit": limit_of(what.removeprefix("many scales: ")),
                "median": sorted(rows)[len(rows) // 2][0],
                "worst": sorted(rows, reverse=True)[:WORST_KEPT],
            }
            for what, rows in sorted(compared.items())
        },
        "raised": {one["seed"]: one["raised"] for one in found if "raised" in one},
        "failed": {one["seed"]: one["failed"] for one in found if one.get("failed")},
        "refused": {one["seed"]: one["refused"] for one in found if one.get("refused")},
    }


def report(result: dict[str, Any]) -> str:
    evaluated = ", ".join(f"{count:,} by {what}" for what, count in result["evaluated"].items())
    commits = ", ".join(f"{commit} ({count})" for commit, count in result["commits"].items())
    lines = [
        f"{result['robots']:,} robots ({result['many scales']:,} of many scales, {len(result['refused'])} of them refused; "
        f"{result['lowered']} lowered and compiled), {result['states']:,} states; evaluated {evaluated}",
        f"commits {commits}; {result['cpu seconds']:,} s of processor time",
    ]
    for what, row in result["worst"].items():
        seeds = ", ".join(f"{error:.1e} (seed {seed})" for error, seed in row["worst"][:2])
        lines.append(
            f"{what:70} {row['robots']:6} robots   limit {row['limit']:.0e}   median {row['median']:.0e}   worst {seeds}"
        )
    lines += [f"seed {seed} refused: {text}" for seed, text in result["refused"].items()]
    lines += [f"seed {seed} raised {text}" for seed, text in result["raised"].items()]
    lines += [f"seed {seed} failed: {', '.join(names)}" for seed, names in result["failed"].items()]
    lines.append("again: python tests/campaign/campaign_run.py --seed SEED --urdf")
    return "\n".join(lines)
