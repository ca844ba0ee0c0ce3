"""A call executes the same instructions whatever the state: what a real-time loop wants to hear, counted by valgrind for
every function that there is. None asks for memory."""

from __future__ import annotations

import platform
import re
import subprocess
from pathlib import Path

import pytest
from bundled import bundled_model
from direct import write_sources
from installed import need
from limbed import package_of
from slow_cases import slow_but_for

from psdmc.backends.c.package import PackageView, package_view
from psdmc.backends.info import EmitOptions, package_info
from psdmc.functions import OF_TREES
from psdmc.functions.impulse import RESTITUTION
from psdmc.functions.operational_space_inertia import MU
from psdmc.lower.kernels import lower
from psdmc.recipes.contacts import ACTIVE
from psdmc.recipes.steps import DT

CALLS = 20
SCALES = ("0", "1e-300", "1", "6", "1e5")
"""Standing still, denormal squares, ordinary motion, several turns, the sincos's whole range."""

DRAWN = {
    DT.name: "1e-9 * rand() / RAND_MAX",
    MU.name: "1.0 + rand() / (double)RAND_MAX",
    ACTIVE.name: "rand() % 2",
    RESTITUTION.name: "rand() / (double)RAND_MAX",
}
"""Inputs of another size: a long step from the largest states would leave the sincos's range, and without a mu that is
positive there is no operational-space inertia, which takes other instructions. Contacts are active or not."""

PACKAGES = {
    "two_link": OF_TREES,
    "kr6": ("inverse_dynamics", "forward_dynamics", "forward_dynamics_derivatives"),
}
"""Robot and functions; of the larger one those that are written otherwise for many joints."""

LIMBED = "four legs of a floating body"
"""A robot whose limbs run in lanes. Accelerations exist at any quaternion: the mass matrix does not depend on it."""

FLAGS = {LIMBED: ["-march=x86-64-v3"]}
"""Vectors of four lanes: one register for the four legs."""

MOVES = ("neutral", "integrate", "difference", "tangent_map")
"""Of a chain these are a few stores and additions; all others take sines."""


def program_text(package: PackageView) -> str:
    """C: calls every function CALLS times at random states of a size that the command line gives."""
    sizes: dict[str, int] = {}
    for vector in (each for kernel in package.kernels for each in (*kernel.inputs, *kernel.outputs)):
        sizes[vector.name] = max(vector.size, sizes.get(vector.name, 0))
    lines = ["#include <stdlib.h>", f"#include <{package.robot}/{package.robot}.h>", ""]
    lines += [f"static double {name}[{size}];" for name, size in sizes.items()]
    lines += [
        "",
        "int main(int count, char **words)",
        "{",
        "    const double scale = atof(words[count - 1]);",
    ]
    lines += ["    srand((unsigned)scale);", f"    for (int call = 0; call < {CALLS}; call++) {{"]
    for name in sorted({vector.name for kernel in package.kernels for vector in kernel.inputs}):
        lines += [f"        for (int k = 0; k < {sizes[name]}; k++) {{"]
        lines += [
            f"            {name}[k] = {DRAWN.get(name, 'scale * (rand() / (double)RAND_MAX - 0.5)')};",
            "        }",
        ]
    for kernel in package.kernels:
        names = ", ".join(vector.name for vector in (*kernel.inputs, *kernel.outputs))
        lines += [f"        (void){package.robot}_{kernel.name}({names});"]
    return "\n".join([*lines, "    }", "    return 0;", "}", ""])


@pytest.fixture(scope="module", params=slow_but_for(["two_link"], [*PACKAGES, LIMBED]))
def shown(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def package(shown: str) -> PackageView:
    if shown == LIMBED:
        limbed = package_of(LIMBED, EmitOptions())
        in_lanes = {kernel.name for kernel in limbed.kernels if kernel.limbs and kernel.limbs.least <= 4}
        assert in_lanes >= {"inverse_dynamics", "forward_dynamics"}
        return limbed
    model = bundled_model(shown)
    kernels = lower(model, functions=PACKAGES[shown], theta_variants=False)
    return package_view(package_info(model), kernels, EmitOptions())


@pytest.fixture(scope="module")
def folder(shown: str, package: PackageView, tmp_path_factory: pytest.TempPathFactory) -> Path:
    need("gcc", "valgrind")
    if shown in FLAGS and not has_four_lanes():
        pytest.skip("no processor for vectors of four lanes")
    made = tmp_path_factory.mktemp("constant")
    write_sources(package, made)
    (made / "main.c").write_text(program_text(package))
    words = ["gcc", "-std=c99", "-O1", *FLAGS.get(shown, []), f"-I{made}/include", "-c"]
    for source in ("main.c", *package.sources):
        subprocess.run([*words, str(made / source), "-o", str(made / f"{Path(source).stem}.o")], check=True)
    objects = map(str, sorted(made.glob("*.o")))
    subprocess.run(["gcc", *objects, "-lm", "-o", str(made / "main")], check=True)
    return made


def has_four_lanes() -> bool:
    cpu = Path("/proc/cpuinfo")
    return platform.machine() == "x86_64" and cpu.exists() and "avx2" in cpu.read_text().split()


def test_the_number_of_instructions_does_not_depend_on_the_state(package: PackageView, folder: Path) -> None:
    counts = {scale: _instructions(folder, scale, package.robot) for scale in SCALES}
    (first, *others) = counts.values()
    assert set(first) == {f"{package.robot}_{kernel.name}" for kernel in package.kernels}
    moves = {f"{package.robot}_{name}" for name in MOVES}
    assert min(count for name, count in first.items() if name not in moves) > CALLS * 20
    assert min(first.values()) >= CALLS * 2
    for name in first:
        assert {other[name] for other in others} == {first[name]}, name


def test_no_function_asks_for_memory(package: PackageView, folder: Path) -> None:
    """What the objects take from elsewhere: other objects of the package, and nothing that allocates."""
    objects = [str(folder / f"{Path(source).stem}.o") for source in package.sources]
    listed = subprocess.run(["nm", "-u", *objects], capture_output=True, text=True, check=True).stdout
    wanted = set(re.findall(r"^\s+U (\w+)", listed, re.MULTILINE))
    foreign = {name for name in wanted if not name.startswith(f"{package.robot}_")}
    known = {"sin", "cos", "sincos", "memcpy", "memset", "__stack_chk_fail", "_GLOBAL_OFFSET_TABLE_"}
    assert foreign <= known


def _instructions(folder: Path, scale: str, robot: str) -> dict[str, int]:
    """Of all calls of each function from main, what they call included."""
    words = ["valgrind", "--tool=callgrind", "--callgrind-out-file=counts", "--compress-strings=no"]
    subprocess.run([*words, "./main", scale], capture_output=True, check=True, cwd=folder)
    parts = re.findall(
        r"^fn=main\n(.*?)^(?:fn|ob|totals)[=:]", (folder / "counts").read_text(), re.MULTILINE | re.DOTALL
    )
    assert parts
    text = "".join(parts)  # callgrind writes a function in several parts where others come between
    found = re.findall(rf"^cfn=({robot}_\w+)\ncalls=(\d+) .*\n\S+ (\d+)$", text, re.MULTILINE)
    assert all(int(calls) == CALLS for _, calls, _ in found)
    return {name: int(cost) for name, _, cost in found}
