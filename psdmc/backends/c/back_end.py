"""The back end that writes C packages: the text of every file. This module writes nothing to disk."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from psdmc.backends.c.adapters import ADAPTERS, with_own_kernels
from psdmc.backends.c.bodies import estimator_view
from psdmc.backends.c.package import PackageView, package_view
from psdmc.backends.c.render import identifier, render
from psdmc.backends.describe import option_items
from psdmc.backends.manifest import manifest
from psdmc.backends.protocol import BackEnd, Emission
from psdmc.target.presets import NATIVE

C_SUFFIXES = (".c", ".cpp", ".h", ".hpp", ".inc", ".cu", ".cuh")
SPDX = "SPDX-License-Identifier"
LICENCE = f"/* {SPDX}: 0BSD */\n"
"""First line of each C file: the code is its user's, without any obligation."""

_FOR_BATCHES = {
    "src/lane_states.h": "lane_states.h.jinja",
    "src/rows.h": "rows.h.jinja",
    "src/lane_rows.h": "lane_rows.h.jinja",
    "src/groups.h": "groups.h.jinja",
}


def package_files(package: PackageView) -> dict[str, str]:
    """Return the text of every file, by path. The last one is manifest.json, which contains the hashes of the others."""
    named = {
        "CMakeLists.txt": "CMakeLists.txt.jinja",
        f"cmake/{package.robot}Config.cmake.in": "Config.cmake.in.jinja",
        f"{package.robot}.pc.in": "pc.in.jinja",
        "Makefile": "Makefile.jinja",
        "README.md": "README.md.jinja",
        "LICENSE": "LICENSE.jinja",
        "package.xml": "package.xml.jinja",
    }
    if package.references is not None:
        tests = ("self_test.c", "reference.h", "layouts.h", "compare.h")
        named |= {f"test/{name}": f"{name}.jinja" for name in tests}
    files = library_files(package)
    files |= {path: render(template, package=package) for path, template in named.items()}
    for adapter in package.adapters:
        files |= ADAPTERS[adapter](package)
    files = {path: licensed(path, text) for path, text in files.items()}
    files["manifest.json"] = _manifest(package, files)
    return files


def licensed(path: str, text: str) -> str:
    """Return the text of a file, preceded by its licence if the file is C code."""
    return LICENCE + text if path.endswith(C_SUFFIXES) else text


def _manifest(package: PackageView, files: Mapping[str, str]) -> str:
    own: dict[str, Any] = {"real": package.real, "lanes": package.lanes}
    if package.target != NATIVE:
        own = {"target": {"name": package.target.name, "flags": list(package.target.flags)}} | own
    functions = [
        {
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
        for function in package.functions
    ]
    options = option_items(package.info, package.options)
    return manifest(package.robot, package.info, options, own, functions, files)


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
            template = "regions.c.jinja" if unit.is_regions else "function.c.jinja"
            files[f"src/{unit.name}.c"] = render(template, package=shown, function=unit)
        for kernel in function.kernels:
            bodies = {kernel.single_file: kernel.single_body, kernel.lanes_file: kernel.lanes_body}
            for file, body in bodies.items() if not kernel.regions else ():
                files[f"src/{file}"] = render("body.inc.jinja", body=body)
            parts = {kernel.single_parts: kernel.single_body, kernel.lanes_parts: kernel.lanes_body}
            for file, body in parts.items():
                if body.parts:
                    files[f"src/{file}"] = render("parts.inc.jinja", body=body)
            if kernel.limbs:
                files[f"src/{kernel.limbs.file}"] = render("limbs.inc.jinja", limbs=kernel.limbs)
    for name in package.further_functions:
        files[f"src/{name}.c"] = render(f"{name}.c.jinja", package=package)
    if package.estimator:
        files["src/estimator.c"] = render("estimator.c.jinja", package=package)
    return files


def _files(given: Emission) -> dict[str, str]:
    package = package_view(given.info, given.kernels, given.options, given.references, given.adapters)
    if given.estimator is not None:
        view = estimator_view(given.estimator, given.info, package.robot, package.alone.options)
        package = replace(package, estimator=view)
    return package_files(with_own_kernels(package, given.kernels))


BACK_END = BackEnd(
    "C",
    "prefix of C names",
    _files,
    identifier,
    lambda robot: (f"include/{robot}/{robot}.h", f"the header, #include <{robot}/{robot}.h>"),
    lambda folder: f"psdmc build {folder}",
)
