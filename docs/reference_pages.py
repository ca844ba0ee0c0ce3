"""Pages of the site that the code itself says: the command line, the public Python names, the reference package's header."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import Any

import typer.main

import psdmc
import psdmc.mujoco
from psdmc.cli.commands import app

ROOT = Path(__file__).parents[1]
HEADER = "generated/two_link/include/two_link/two_link.h"
METHODS = "psdmc/toolchain/call.pyi"


def command_line() -> str:
    """Every command with its arguments and options, as the command itself describes them."""
    group = typer.main.get_group(app)
    parts = [
        "# All commands and options",
        "`psdmc COMMAND --help` prints the same. Exit statuses: [files.md](../files.md).",
    ]
    for name, command in group.commands.items():
        parts += [f"## psdmc {name}", _plain(command.help or "")]
        parts.append(_options(command, command.context_class(command, info_name=f"psdmc {name}")))
    return "\n\n".join(parts) + "\n"


def _options(command: Any, context: Any) -> str:
    rows = ["| name | kind | meaning |", "|---|---|---|"]
    for parameter in command.params:
        record = parameter.get_help_record(context)
        names = record[0] if record else parameter.make_metavar(context)
        said = record[1] if record else getattr(parameter, "help", None) or ""
        kind = parameter.param_type_name
        rows.append(f"| `{_cell(names)}` | {kind} | {_cell(_plain(said))} |")
    return "\n".join(rows)


def _plain(text: str) -> str:
    return inspect.cleandoc(text).replace("[", "&#91;").replace("<", "&lt;")


def _cell(text: str) -> str:
    return " ".join(text.replace("|", r"\|").split())


def python() -> str:
    """The public names with their signatures and docstrings, and the methods of a compiled robot."""
    parts = [
        "# Python names",
        "What `import psdmc` offers. Shapes and letters: [notation.md](../notation.md).",
    ]
    for name in psdmc.__all__:
        item = getattr(psdmc, name)
        parts += [f"## psdmc.{name}", _described(item, name)]
        if inspect.isclass(item) and not issubclass(item, Exception):
            parts += _members(item)
    for name in ("to_qpos", "from_qpos", "to_qvel", "from_qvel"):
        parts += [f"## psdmc.mujoco.{name}", _described(getattr(psdmc.mujoco, name), name)]
    parts += ["## Methods of a compiled robot", "Of what `psdmc.compile(model)` returns."]
    parts.append(_fenced((ROOT / METHODS).read_text(encoding="utf-8"), "python"))
    return "\n\n".join(parts) + "\n"


def _members(item: type) -> list[str]:
    """A part for each public method and property that says what it is."""
    public = {name: member for name, member in vars(item).items() if not name.startswith("_")}
    told = [name for name, member in public.items() if _is_method(member) and inspect.getdoc(member)]
    return [part for name in told for part in (f"### {name}", _described(public[name], name))]


def _is_method(member: object) -> bool:
    return callable(member) or isinstance(member, property | classmethod | staticmethod)


def _described(item: Any, name: str) -> str:
    signature = (
        name if isinstance(item, property | str) else _signature(getattr(item, "__func__", item), name)
    )
    said = inspect.getdoc(item) if not isinstance(item, str) else repr(item)
    return _fenced(signature, "python") + "\n\n" + _fenced(said or "", "text")


def _signature(function: Any, name: str) -> str:
    try:
        found = re.sub(r"<function (\w+) at 0x[0-9a-f]+>", r"\1", str(inspect.signature(function)))
        return f"{name}{found}".replace("'", "")
    except ValueError:
        return name


def c_header() -> str:
    """The header of the reference package, whole."""
    text = (ROOT / HEADER).read_text(encoding="utf-8")
    said = (
        "The header of a two-link arm's package, called `two_link`: what every package's header has. Yours has your"
        " robot's name, joints and numbers. Real-time properties, layouts, aliasing: [shipping.md](../shipping.md)."
    )
    return f"# A package's header\n\n{said}\n\n{_fenced(text, 'c')}\n"


def _fenced(text: str, language: str) -> str:
    return f"```{language}\n{text.rstrip()}\n```"
