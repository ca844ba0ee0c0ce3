"""Nothing outside the joint types' folder asks what kind a joint is: it uses what the type gives."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import psdmc
from psdmc.robot.joints import JOINT_TYPES, WIDE_TYPES

PACKAGE = Path(psdmc.__file__).parent
WORDS = set(JOINT_TYPES)
NAMES = {*JOINT_TYPES, *WIDE_TYPES}
OBJECTS = {word.upper() for word in NAMES} | {word.capitalize() for word in NAMES}
ATTRIBUTES = {"kind", "word"}
"""A joint's type as a word."""


def sources() -> list[Path]:
    own = PACKAGE / "robot" / "joints"
    return [path for path in sorted(PACKAGE.rglob("*.py")) if own not in path.parents]


def questions(tree: ast.AST) -> Iterator[int]:
    """Lines that compare a joint's type, its word, or match on them, or ask for the class."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare):
            asked: list[ast.AST] = [node.left, *node.comparators]
        elif isinstance(node, ast.Match):
            asked = [node]
        elif isinstance(node, ast.Call) and _name(node.func) in ("isinstance", "issubclass"):
            asked = list(node.args)
        else:
            continue
        if any(_names_a_type(part) for one in asked for part in _parts(one)):
            yield node.lineno


def _parts(node: ast.AST) -> Iterator[ast.AST]:
    """Everything within, but what is passed to a call: its result is another value."""
    yield node
    for child in ast.iter_child_nodes(node):
        if not isinstance(node, ast.Call) or child is node.func:
            yield from _parts(child)


def _names_a_type(node: ast.AST) -> bool:
    if isinstance(node, ast.Constant):
        return node.value in WORDS if isinstance(node.value, str) else False
    if isinstance(node, ast.Attribute):
        of = node.value
        is_numpys = "dtype" in (getattr(of, "attr", ""), getattr(of, "id", ""))
        return node.attr in ATTRIBUTES and not is_numpys
    return isinstance(node, ast.Name) and node.id in OBJECTS


def _name(node: ast.AST) -> str:
    return node.id if isinstance(node, ast.Name) else ""


def test_no_file_asks_a_joint_what_kind_it_is() -> None:
    asked = {
        str(path.relative_to(PACKAGE)): lines
        for path in sources()
        if (lines := list(questions(ast.parse(path.read_text(encoding="utf-8")))))
    }
    assert asked == {}, "use what the joint's type gives"
    assert len(sources()) > 300


@pytest.mark.parametrize(
    "text",
    [
        "joint.kind == 'revolute'",
        "kind = 'a' if frame.kind != other else 'b'",
        "joint.type is REVOLUTE",
        "kind in ('revolute', 'prismatic')",
        "isinstance(joint.type, Prismatic)",
        "[j for j in joints if j.type.word == name]",
        "match word:\n    case 'prismatic':\n        pass",
    ],
)
def test_the_test_sees_such_questions(text: str) -> None:
    assert list(questions(ast.parse(text)))


def test_the_test_lets_others_pass() -> None:
    assert not list(questions(ast.parse("joint.type.length_order == 1 and f('revolute') == a.dtype.kind")))
