"""Untrusted names: always an identifier, never a way out of a string or a comment."""

from __future__ import annotations

import ast
import re
import subprocess

import pytest
from hypothesis import given
from hypothesis import strategies as st

from psdmc.backends.c.render import RESERVED, c_comment, c_string, identifier
from psdmc.backends.render import LONGEST


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("ur5", "ur5"),
        ("Fanuc SR-6iA", "Fanuc_SR_6iA"),
        ('a; system("x")', "a_system_x"),
        ("int", "robot_int"),
        ("namespace", "robot_namespace"),
        ("6dof", "robot_6dof"),
        ("__init__", "init"),
        ("a__b", "a_b"),
        ("Ünimate", "nimate"),
        ("*/ int x; /*", "int_x"),
        ("line\nbreak", "line_break"),
    ],
)
def test_a_name_becomes_a_readable_identifier(name: str, expected: str) -> None:
    assert identifier(name) == expected


@pytest.mark.parametrize("name", ["", "机器人", "---", "\ud800", "x" * 300, "a" * 64])
def test_names_that_lose_much_get_a_digest_and_stay_apart(name: str) -> None:
    found = identifier(name)
    assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*_[0-9a-f]{8}", found)
    assert found == identifier(name)
    assert found != identifier(name + "!x")


@given(st.text(max_size=400))
def test_every_text_gives_a_safe_identifier(name: str) -> None:
    found = identifier(name)
    assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", found)
    assert len(found) <= LONGEST
    assert found not in RESERVED
    assert "__" not in found


@given(st.text(max_size=60))
def test_a_string_literal_holds_exactly_the_text(text: str) -> None:
    literal = c_string(text)
    assert literal.isascii()
    assert "\n" not in literal
    assert "??" not in literal
    body = literal[1:-1].replace("\\?", "?")
    # C's octal and simple escapes are Python's, too
    assert ast.literal_eval(f'b"{body}"') == text.encode("utf-8", "surrogatepass")


@given(st.text(alphabet="*/\\?\n=x<ü", max_size=12))
def test_a_comment_cannot_be_left(text: str) -> None:
    inside = c_comment(text)
    assert inside.isascii()
    assert not re.search(r"\*/|/\*|\\|\?\?|\n|\r", inside)


NASTY = ["*/ int evil; /*", "x\\", "??/", '"; int evil; "', "a\nint evil;", "%s%n", "\x00", "é*/", "**//"]


def test_a_compiler_agrees(tmp_path: object) -> None:
    lines = [
        f"/* {c_comment(text)} */ static const char s{i}[] = {c_string(text)};"
        for i, text in enumerate(NASTY)
    ]
    uses = "".join(f"(void)s{i};" for i in range(len(NASTY)))
    source = "\n".join([*lines, f"int main(void) {{ int evil = 0; {uses} return evil; }}"])
    flags = [
        "-std=c99",
        "-trigraphs",
        "-Wall",
        "-Wextra",
        "-Wpedantic",
        "-Werror",
        "-fsyntax-only",
        "-xc",
        "-",
    ]
    done = subprocess.run(["gcc", *flags], input=source, text=True, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_robot_called_std_gets_a_namespace_of_its_own() -> None:
    """The C++ header puts its classes into a namespace of the robot's name."""
    assert identifier("std") == "robot_std"


def test_a_long_name_is_not_cut_at_an_underscore() -> None:
    assert "__" not in identifier(f"{'0' * 47}:0000000000")
