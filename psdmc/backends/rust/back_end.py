"""The back end that writes Rust crates. The crates have no dependencies, and allocate no memory; no code is unsafe."""

from __future__ import annotations

from functools import cache

from jinja2 import Environment

from psdmc.backends.describe import option_items
from psdmc.backends.manifest import manifest
from psdmc.backends.protocol import BackEnd, Emission
from psdmc.backends.render import environment_with
from psdmc.backends.rust.crate import crate_view, polynomial
from psdmc.backends.rust.names import comment, identifier
from psdmc.backends.trig_numbers import NUMBERS

FILES = ("Cargo.toml", "README.md", "src/lib.rs", "src/math.rs", "tests/self_test.rs")


@cache
def _environment() -> Environment:
    return environment_with(comment=comment, polynomial=polynomial)


def _files(given: Emission) -> dict[str, str]:
    crate = crate_view(given)

    def rendered(template: str, **view: object) -> str:
        return _environment().get_template(template).render(crate=crate, trig=NUMBERS["double"], **view)

    files = {path: rendered(f"rust/{path.rpartition('/')[2]}.jinja") for path in FILES}
    for each in crate.functions:
        files[f"src/{each.function.signature.name}.rs"] = rendered("rust/function.rs.jinja", function=each)
    files["LICENSE"] = rendered("LICENSE.jinja")
    options = {key: value for key, value in option_items(given.info, given.options).items() if key != "trig"}
    functions = [
        {"name": each.function.signature.name, "kernels": [{"name": kernel.name} for kernel in each.kernels]}
        for each in crate.functions
    ]
    files["manifest.json"] = manifest(crate.robot, given.info, options, {"backend": "rust"}, functions, files)
    return files


BACK_END = BackEnd(
    "Rust",
    "name of the crate",
    _files,
    identifier,
    lambda robot: ("Cargo.toml", f'the crate, {robot} = {{ path = "..." }}'),
    lambda folder: f"cargo test --manifest-path {folder}/Cargo.toml",
    ("trig", "target", "payload", "friction", "bodies", "estimator", "with", "functions NAME_theta_rows"),
)
