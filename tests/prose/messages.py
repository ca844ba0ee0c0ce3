"""Every string that a user of psdmc can see: errors and hints, notes, warnings, printed lines, help of options."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
SHOWN_BY = {
    "InputError",
    "DerivationError",
    "ToolchainError",
    "BrokenArchiveError",
    "print",
    "say",
    "warn",
    "append",
    "Option",
    "Argument",
}
"""Calls whose strings are shown. `append` is that of notes, faults, warnings, doubts and reasons."""
LISTS = ("notes", "faults", "warnings", "doubts", "reasons", "lines")
FEWEST = 3
"""Words of a message: shorter strings are names and parts."""


def messages(root: Path = ROOT) -> Iterator[tuple[str, int, str]]:
    """File, line and text of each message; what is filled in is `x`."""
    for path in sorted((root / "psdmc").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and _shows(node):
                for argument in [*node.args, *(keyword.value for keyword in node.keywords)]:
                    text = _text(argument)
                    if len(text.split()) >= FEWEST:
                        yield str(path), argument.lineno, text


def _shows(call: ast.Call) -> bool:
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    if name == "append":
        return isinstance(call.func, ast.Attribute) and ast.unparse(call.func.value).endswith(LISTS)
    return name in SHOWN_BY


def _text(node: ast.expr) -> str:
    """A string's text, of literals, f-strings and sums and choices of these; else empty."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=values):
            return "".join(
                part.value if isinstance(part, ast.Constant) and isinstance(part.value, str) else "`x`"
                for part in values
            )
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            return _text(left) + _text(right)
        case ast.IfExp(body=body, orelse=orelse):
            return ". ".join(filter(None, (_text(body), _text(orelse))))
    return ""


if __name__ == "__main__":
    for file, line, text in messages():
        print(f"{Path(file).relative_to(ROOT)}:{line}: {text}")
