"""Writes the table of derivatives on the pages about JAX and PyTorch from the rules: python docs/derivative_table.py."""

from __future__ import annotations

from pathlib import Path

from function_table import with_rows

from psdmc.frameworks.coordinates import ON_COORDINATES
from psdmc.frameworks.differentiation import rule_of
from psdmc.functions import SIGNATURES

PAGES = tuple(Path(__file__).parent / "how-to" / f"{name}.md" for name in ("jax", "pytorch"))

HEAD = "| functions | derivatives by | derivative by `theta_b` |"


def table() -> str:
    """The table's lines: one for all functions with the same derivatives."""
    alike: dict[tuple[str, str], list[str]] = {}
    for name, function in SIGNATURES.items():
        rule = rule_of(name)
        if name in ON_COORDINATES:
            alike.setdefault(("all inputs, also second and higher derivatives", "no"), []).append(name)
        elif rule is not None:
            moving = [f"`{each.name}`" for each in function.inputs if each.name not in rule.constant]
            by = ", ".join(moving) if rule.constant else "all inputs"
            alike.setdefault((by, "yes" if rule.parameters else "no"), []).append(name)
    rows = [
        f"| {', '.join(f'`{name}`' for name in names)} | {by} | {theta} |"
        for (by, theta), names in alike.items()
    ]
    return "\n".join([HEAD, "|---|---|---|", *rows, "| all others | none | no |"]) + "\n"


def with_table(text: str) -> str:
    """The page with this table in the place of its own."""
    return with_rows(text, HEAD, table())


if __name__ == "__main__":
    for page in PAGES:
        page.write_text(with_table(page.read_text(encoding="utf-8")), encoding="utf-8")
