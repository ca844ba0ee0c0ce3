"""The prose that the house style covers: documents, messages of the program, docstrings of public names."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

from house_style import Piece
from messages import messages as printed

ROOT = Path(__file__).parents[2]
FENCE = re.compile(r"(?ms)^```.*?^```")
INDENTED = re.compile(r"(?m)^(    |\t).*$")
ITEM = re.compile(r"(?m)^\s*(?:[-*]|\d+\.)\s+")
BLANK = re.compile(r"\n\s*\n")
ROW = re.compile(r"^[\w*\"'., |()/<>\[\]=-]*\S\s{2,}(?=\S)")
STUBS = ("psdmc/model/answers.pyi", "psdmc/toolchain/call.pyi")


def everything(root: Path = ROOT) -> list[Piece]:
    """Every piece of prose of the tree at `root`."""
    return [*documents(root), *messages(root), *docstrings(root)]


def document_paths(root: Path = ROOT) -> list[Path]:
    """README, CHANGELOG, CONTRIBUTING, SECURITY, the examples' README and docs/ but for decision records."""
    outside = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md", "examples/README.md")
    pages = (path for path in sorted((root / "docs").rglob("*.md")) if "decisions" not in path.parts)
    return [*(root / name for name in outside), *pages]


def documents(root: Path = ROOT) -> Iterator[Piece]:
    for path in document_paths(root):
        yield from markdown(path.read_text(encoding="utf-8"), str(path.relative_to(root)))


def markdown(text: str, file: str) -> Iterator[Piece]:
    """A document's paragraphs, list items, cells and headings; fenced and indented code is left out."""
    text = FENCE.sub(lambda code: "\n" * code[0].count("\n"), text)
    text = INDENTED.sub("", text)
    for line, block in _split(text, BLANK, 1):
        stripped = block.strip()
        if stripped.startswith("|"):
            yield from _cells(block, file, line)
        elif stripped.startswith("#"):
            yield Piece(file, line, "heading", stripped.lstrip("# "))
        elif stripped and not stripped.startswith(("<", "![")):
            for at, item in _split(block, ITEM, line):
                if item.strip():
                    yield Piece(file, at, "paragraph", item.strip().replace("\n", " "))


def _cells(block: str, file: str, line: int) -> Iterator[Piece]:
    for row in block.splitlines():
        for cell in row.strip().strip("|").split("|"):
            if cell.strip(" :-"):
                yield Piece(file, line, "cell", cell.strip())
        line += 1


def _split(text: str, separator: re.Pattern[str], line: int) -> Iterator[tuple[int, str]]:
    """The parts between separators, each with the line that it begins at."""
    start = 0
    for found in [*separator.finditer(text), None]:
        part = text[start : found.start() if found else len(text)]
        lead = len(part) - len(part.lstrip())
        yield line + text.count("\n", 0, start + lead), part
        start = found.end() if found else start


def messages(root: Path = ROOT) -> Iterator[Piece]:
    """What the program prints: errors, hints, warnings, notes, help."""
    for file, line, text in printed(root):
        name = Path(file)
        yield Piece(str(name.relative_to(root) if name.is_relative_to(root) else name), line, "message", text)


def docstrings(root: Path = ROOT) -> Iterator[Piece]:
    """Docstrings of psdmc.__all__, of the public methods of its classes and of the stubs."""
    package = _Package(root)
    for name, module in sorted(package.public().items()):
        for file, node in package.found(module, name):
            yield from _docstring(node, file)
    for file in STUBS:
        for node in ast.walk(ast.parse((root / file).read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                yield from _docstring(node, file)


def _docstring(node: ast.FunctionDef | ast.ClassDef, file: str) -> Iterator[Piece]:
    text = ast.get_docstring(node, clean=False)
    line = node.body[0].lineno
    for at, block in _split(inspect.cleandoc(text or ""), BLANK, line):
        for item in _items(block):
            if item.strip() and not item.strip().startswith((">>>", "|")):
                yield Piece(file, at, "docstring", " ".join(item.split()))


def _items(block: str) -> list[str]:
    """A block's rows 'name  meaning', without the names; of another block its text without deeper indentation."""
    if block.lstrip().startswith(">>>"):
        return []
    items: list[str] = []
    for line in block.splitlines():
        row = ROW.match(line)
        if row and not line.startswith(" " * 6):
            items.append(line[row.end() :])
        elif ITEM.match(line) or not items:
            items.append(ITEM.sub("", line))
        else:
            items[-1] += " " + line.strip()
    return items


class _Package:
    """psdmc's public names, read from the sources without importing them."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self._trees: dict[Path, ast.Module] = {}

    def public(self) -> dict[str, str]:
        """The module of each name of psdmc.__all__, by what the name is called there."""
        tree = self._tree(self.root / "psdmc/__init__.py")
        imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module]
        where = {
            alias.asname or alias.name: (alias.name, str(node.module))
            for node in imports
            for alias in node.names
        }
        listed = next(
            node.value
            for node in tree.body
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"
        )
        return dict(where[name] for name in ast.literal_eval(listed) if not name.startswith("_"))

    def found(self, module: str, name: str) -> Iterator[tuple[str, ast.FunctionDef | ast.ClassDef]]:
        """A function, or a class with its public methods and those of the classes of psdmc that it is made of."""
        path = self._path(module)
        tree = self._tree(path)
        file = str(path.relative_to(self.root))
        for node in tree.body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == name:
                yield file, node
                if isinstance(node, ast.ClassDef):
                    for part in node.body:
                        if isinstance(part, ast.FunctionDef) and not part.name.startswith("_"):
                            yield file, part
                    for base in node.bases:
                        yield from self._base(tree, module, ast.unparse(base).split("[")[0])

    def _base(
        self, tree: ast.Module, module: str, name: str
    ) -> Iterator[tuple[str, ast.FunctionDef | ast.ClassDef]]:
        for node in tree.body:
            if isinstance(node, ast.ImportFrom) and any(alias.name == name for alias in node.names):
                module = node.module or ""
        if module.startswith("psdmc"):
            yield from self.found(module, name)

    def _path(self, module: str) -> Path:
        path = self.root / module.replace(".", "/")
        return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")

    def _tree(self, path: Path) -> ast.Module:
        if path not in self._trees:
            self._trees[path] = ast.parse(path.read_text(encoding="utf-8"))
        return self._trees[path]
