"""The text of every file of the generated C package. This module writes nothing to disk."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from psdmc.backends.c.adapters import ADAPTERS
from psdmc.backends.c.kernel_view import FunctionView
from psdmc.backends.c.package import PackageView
from psdmc.backends.c.render import render
from psdmc.backends.describe import option_items
from psdmc.backends.manifest import manifest
from psdmc.target.native import NATIVE
from psdmc.target.target import Target


def package_files(package: PackageView) -> dict[str, str]:
    """Return the text of every file, by path. The last one is manifest.json, which contains the hashes of the others."""
    files = library_files(package)
    files |= {path: render(template, package=package) for path, template in _build_files(package)}
    if package.references is not None:
        files["test/self_test.c"] = render("self_test.c.jinja", package=package)
        for name in ("reference", "layouts", "compare"):
            files[f"test/{name}.h"] = render(f"{name}.h.jinja", package=package)
    for adapter in package.adapters:
        files |= ADAPTERS[adapter](package)
    files = {path: licensed(path, text) for path, text in files.items()}
    files["manifest.json"] = _manifest(package, files)
    return files


def _manifest(package: PackageView, files: Mapping[str, str]) -> str:
    own = {**_target(package.target), "real": package.real, "lanes": package.lanes}
    functions = [_function(function) for function in package.functions]
    return manifest(
        package.robot, package.info, option_items(package.info, package.options), own, functions, files
    )


def _target(target: Target) -> dict[str, Any]:
    """A target that was chosen: its name, and the flags that compilers take for it."""
    return {} if target == NATIVE else {"target": {"name": target.name, "flags": list(target.flags)}}


def _function(function: FunctionView) -> dict[str, Any]:
    return {
        "name": function.name,
        "meaning": function.meaning,
        "kernels": [
            {
                "name": kernel.name,
                "lowering": kernel.lowering,
                "cost": kernel.cost,
                **({"cost_with_limbs_in_lanes": str(kernel.limbs.cost)} if kernel.limbs else {}),
                "prototypes": [prototype.text for prototype in kernel.prototypes.values()],
            }
            for kernel in function.kernels
        ],
    }


C_SUFFIXES = (".c", ".cpp", ".h", ".hpp", ".inc", ".cu", ".cuh")
SPDX = "SPDX-License-Identifier"
LICENCE = f"/* {SPDX}: 0BSD */\n"
"""First line of each C file: the code is its user's, without any obligation."""


def licensed(path: str, text: str) -> str:
    """Return the text of a file, preceded by its licence if the file is C code."""
    return LICENCE + text if path.endswith(C_SUFFIXES) else text


_FOR_BATCHES = {
    "src/lane_states.h": "lane_states.h.jinja",
    "src/rows.h": "rows.h.jinja",
    "src/lane_rows.h": "lane_rows.h.jinja",
    "src/groups.h": "groups.h.jinja",
}


def library_files(package: PackageView) -> dict[str, str]:
    """The library alone: headers and sources."""
    trig = "sincos_libm.h.jinja" if package.options.trig == "libm" else "sincos_inline.h.jinja"
    named = {
        f"include/{package.robot}/{package.robot}.h": "header.h.jinja",
        f"include/{package.robot}/{package.robot}.hpp": "header.hpp.jinja",
        "src/tables.c": "tables.c.jinja",
        "src/internal.h": "internal.h.jinja",
        "src/vectors.h": "vectors.h.jinja",
        "src/sincos.h": trig,
        "src/one_state.h": "one_state.h.jinja",
        **(_FOR_BATCHES if package.target.has_batches else {}),
        "src/pivots.h": "pivots.h.jinja",
    }
    if package.products:
        named["src/products.h"] = "products.h.jinja"
    named |= {f"src/{header}": f"{header}.jinja" for header in package.call_headers}
    files = {path: render(template, package=package) for path, template in named.items()}
    for vector in package.vectors.of_limbs:
        files[f"src/{vector.name}.h"] = render(
            "limbs.h.jinja", package=package, limbs=vector, calls=package.limb_calls(vector.count)
        )
    for function, shown in (
        *((each, package) for each in package.functions),
        *((each, package.alone) for each in package.undeclared),
    ):
        for unit in function.units:
            files[f"src/{unit.name}.c"] = render(
                "regions.c.jinja" if unit.is_regions else "function.c.jinja", package=shown, function=unit
            )
        for kernel in function.kernels:
            own = not kernel.regions
            bodies = (
                {kernel.single_file: kernel.single_body, kernel.lanes_file: kernel.lanes_body} if own else {}
            )
            for file, body in bodies.items():
                files[f"src/{file}"] = render("body.inc.jinja", body=body)
            parts = (
                {kernel.single_parts: kernel.single_body, kernel.lanes_parts: kernel.lanes_body}
                if own
                else {}
            )
            for file, body in parts.items():
                if body.parts:
                    files[f"src/{file}"] = render("parts.inc.jinja", body=body)
            if kernel.limbs:
                files[f"src/{kernel.limbs.file}"] = render("limbs.inc.jinja", limbs=kernel.limbs)
    if package.info.payload:
        files["src/payload.c"] = render("payload.c.jinja", package=package)
    if package.info.bodies:
        files["src/bodies.c"] = render("bodies.c.jinja", package=package)
    if package.info.friction:
        files["src/friction.c"] = render("friction.c.jinja", package=package)
    if package.estimator:
        files["src/estimator.c"] = render("estimator.c.jinja", package=package)
    return files


def _build_files(package: PackageView) -> tuple[tuple[str, str], ...]:
    return (
        ("CMakeLists.txt", "CMakeLists.txt.jinja"),
        (f"cmake/{package.robot}Config.cmake.in", "Config.cmake.in.jinja"),
        (f"{package.robot}.pc.in", "pc.in.jinja"),
        ("Makefile", "Makefile.jinja"),
        ("README.md", "README.md.jinja"),
        ("LICENSE", "LICENSE.jinja"),
        ("package.xml", "package.xml.jinja"),
    )
