"""The back end that writes CUDA packages: a header of `__device__` functions and kernels, and a host library."""

from __future__ import annotations

from psdmc.backends.c.package_files import licensed
from psdmc.backends.c.render import render
from psdmc.backends.cuda.names import identifier
from psdmc.backends.cuda.package import cuda_package
from psdmc.backends.describe import option_items
from psdmc.backends.manifest import manifest
from psdmc.backends.protocol import BackEnd, Emission


def _files(given: Emission) -> dict[str, str]:
    cuda = cuda_package(given)
    robot = cuda.package.robot
    named = {
        f"include/{robot}/{robot}.cuh": "cuda/robot.cuh.jinja",
        f"include/{robot}/{robot}.h": "cuda/robot.h.jinja",
        f"src/{robot}.cu": "cuda/robot.cu.jinja",
        "CMakeLists.txt": "cuda/CMakeLists.txt.jinja",
        "README.md": "cuda/README.md.jinja",
        "LICENSE": "LICENSE.jinja",
    }
    if given.references is not None:
        named |= {"test/self_test.cu": "cuda/self_test.cu.jinja"}
        named |= {f"test/{name}.h": f"{name}.h.jinja" for name in ("reference", "compare")}
    files = {
        path: licensed(path, render(template, cuda=cuda, package=cuda.package))
        for path, template in named.items()
    }
    options = {key: value for key, value in option_items(given.info, given.options).items() if key != "trig"}
    functions = [
        {
            "name": each.name,
            "kernels": [{"name": kernel.name, "cost": kernel.cost} for kernel in each.kernels],
        }
        for each in cuda.package.functions
    ]
    own = {"backend": "cuda", "real": cuda.package.real}
    files["manifest.json"] = manifest(robot, given.info, options, own, functions, files)
    return files


BACK_END = BackEnd(
    "CUDA",
    "prefix of CUDA names",
    _files,
    identifier,
    lambda robot: (f"include/{robot}/{robot}.cuh", f"the header, #include <{robot}/{robot}.cuh>"),
    lambda folder: f"cmake -S {folder} -B {folder}/build && cmake --build {folder}/build",
    ("trig", "target", "payload", "friction", "bodies", "estimator", "with"),
)
