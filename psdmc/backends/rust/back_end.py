"""The back end that writes Rust crates: no dependencies, no allocation, no unsafe code."""

from __future__ import annotations

from functools import cache
from typing import Any

from jinja2 import Environment

from psdmc.backends.describe import option_items
from psdmc.backends.manifest import manifest
from psdmc.backends.protocol import BackEnd, Emission
from psdmc.backends.render import environment_with
from psdmc.backends.rust.crate import CrateView, FunctionText
from psdmc.backends.rust.names import comment, identifier
from psdmc.errors import InputError


@cache
def _environment() -> Environment:
    return environment_with(comment=comment)


def _files(given: Emission) -> dict[str, str]:
    if not given.kernels:
        raise InputError(f"{given.info.name}: no functions to emit", "choose at least one with --functions")
    if given.info.l == 0:
        raise InputError(f"{given.info.name}: the model has no base parameters", "give its links inertia")
    if given.options.real != "float64":
        raise InputError(
            "the back end rust writes float64 alone", "leave --real out, or emit C: psdmc emit-c"
        )
    crate = CrateView(given)
    named = {
        "Cargo.toml": "Cargo.toml",
        "README.md": "README.md",
        "src/lib.rs": "lib.rs",
        "src/math.rs": "math.rs",
        **({"tests/self_test.rs": "self_test.rs"} if given.references else {}),
    }
    files = {path: _rendered(name, crate=crate, numbers=crate.numbers) for path, name in named.items()}
    files |= {f"src/{each.name}.rs": _rendered("function.rs", function=each) for each in crate.functions}
    files["LICENSE"] = _environment().get_template("LICENSE.jinja").render()
    files = {path: _licensed(path, content) for path, content in files.items()}
    options = {key: value for key, value in option_items(given.info, given.options).items() if key != "trig"}
    functions = [_function(function) for function in crate.functions]
    files["manifest.json"] = manifest(crate.robot, given.info, options, {"backend": "rust"}, functions, files)
    return files


def _rendered(name: str, **view: object) -> str:
    return _environment().get_template(f"rust/{name}.jinja").render(**view)


def _licensed(path: str, content: str) -> str:
    return f"// SPDX-License-Identifier: 0BSD\n{content}" if path.endswith(".rs") else content


def _function(function: FunctionText) -> dict[str, Any]:
    kernels = [
        {
            "name": each.name,
            "cost": each.cost,
            "prototype": f"fn {each.name}({each.parameters}) -> {each.returns}",
        }
        for each in function.kernels
    ]
    return {"name": function.name, "meaning": function.meaning, "kernels": kernels}


def _entry(robot: str) -> tuple[str, str]:
    return "Cargo.toml", f'the crate, {robot} = {{ path = "..." }}'


BACK_END = BackEnd(
    "Rust",
    _files,
    identifier,
    _entry,
    lambda folder: f"cargo test --manifest-path {folder}/Cargo.toml",
    ("trig", "target", "payload", "friction", "bodies", "with"),
)
