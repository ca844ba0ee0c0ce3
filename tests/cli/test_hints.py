"""What a message tells a user to type exists: every option and command named in an error or its hint."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import typer

from psdmc.cli.commands import app

PACKAGE = Path(__file__).resolve().parents[2] / "psdmc"
ERRORS = ("InputError", "DerivationError", "ToolchainError", "Fault")
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]+")
COMMAND = re.compile(r"`psdmc ([a-z-]+)([^`]*)`")
OTHERS = {"valgrind": {"--tool"}, "ros2 bag record": {"--compression-mode"}}
"""Options of other programs, which a message may tell a user to type."""


@cache
def commands() -> dict[str, set[str]]:
    group = typer.main.get_group(app)
    return {
        name: {
            option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)
        }
        for name, command in group.commands.items()
    }


def texts(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Line and text of every string that is part of an error, of a remedy that becomes one, or of a template of one."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ERRORS:
            for argument in (*node.args, *(keyword.value for keyword in node.keywords)):
                for part in ast.walk(argument):
                    if isinstance(part, ast.Constant) and isinstance(part.value, str):
                        yield part.lineno, part.value
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and "`psdmc " in node.value:
            yield node.lineno, node.value


SOURCES = sorted(PACKAGE.rglob("*.py"))


def faults(source: str) -> Iterator[str]:
    """Options and commands in a file's messages that do not exist, with their lines."""
    known = commands()
    every = set().union(*known.values()) | {"--debug", "--version"} | set().union(*OTHERS.values())
    for line, text in texts(ast.parse(source)):
        yield from (f"line {line}: {option}" for option in OPTION.findall(text) if option not in every)
        for command, rest in COMMAND.findall(text):
            if command not in known:
                yield f"line {line}: psdmc {command}"
            else:
                yield from (
                    f"line {line}: psdmc {command} {option}"
                    for option in OPTION.findall(rest)
                    if option not in known[command]
                )


def test_options_and_commands_in_messages_exist():
    found = {
        str(path.relative_to(PACKAGE)): list(faults(path.read_text(encoding="utf-8"))) for path in SOURCES
    }

    assert {path: missing for path, missing in found.items() if missing} == {}
    assert len(found) > 300


def test_the_check_sees_options_commands_and_remedies():
    source = (
        'raise InputError("a --torque-constants", f"use --nowhere {x}, `psdmc excite --gravity` `psdmc fly`")'
    )

    found = [text for _, text in texts(ast.parse(source))]

    assert sorted(set(faults(source))) == [
        "line 1: --nowhere",
        "line 1: psdmc excite --gravity",
        "line 1: psdmc fly",
    ]
    assert any("--nowhere" in text for text in found)
    assert "--gravity" not in commands()["excite"]
    assert COMMAND.findall("`psdmc fly`") == [("fly", "")]
    assert "--torque-constants" in commands()["calibrate"]
