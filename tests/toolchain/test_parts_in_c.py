"""Long bodies in C, cut into functions: every function in every form gives what its PROGRAM does."""

from __future__ import annotations

import re

import numpy as np
import pytest
from direct import Direct, all_expected, error, shared_library, states
from slow_cases import slow_but_for
from traced import L, N, arm, arm_kernels, arm_package

from psdmc.backends.c.back_end import library_files
from psdmc.backends.info import EmitOptions

KERNELS = arm_kernels()
STRICT = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wdouble-promotion", "-Werror"]
BUILDS = {"vectors": ["-march=native"], "baseline": ["-g0"], "plain": ["-Dtest_arm_NO_VECTORS"]}
CASES = [*((build, "float64") for build in BUILDS), ("vectors", "float32")]
COUNT = 19


@pytest.fixture(scope="module", params=slow_but_for(CASES[:1], CASES))
def compiled(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Direct:
    build, real = request.param
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("psdmc.backends.c.make_kernel_view.LONG", 30)
        patch.setattr("psdmc.backends.c.make_kernel_view.PART", 40)
        package = arm_package(options=EmitOptions(real=real))
    library = shared_library(package, tmp_path_factory.mktemp("parts"), ["-O0", *STRICT, *BUILDS[build]])
    return Direct(package, library)


@pytest.mark.parametrize("name", KERNELS)
def test_parts_give_what_the_program_does(compiled: Direct, name: str) -> None:
    real, lanes, kernel = compiled.package.options.real, compiled.package.lanes, KERNELS[name]
    given = states(kernel, COUNT, N, L)
    if kernel.theta:
        given["theta_b"] = 1.25 * arm()[1].ravel()
    (wanted,) = all_expected(kernel, given, N, L).values()
    arrays = {key: np.ascontiguousarray(values, real) for key, values in given.items()}
    size, exact = wanted.shape[-1], 1e-3 if real == "float32" else 1e-11

    one = np.full(size + 1, 99.0, real)
    compiled(name, *(array if key == "theta_b" else array[3] for key, array in arrays.items()), one)
    many = np.full((COUNT + 1, size), 99.0, real)
    compiled(f"{name}_batch", COUNT, *arrays.values(), many)

    assert error(one[:-1], wanted[3]) <= exact
    assert error(many[:-1], wanted) <= exact
    assert {one[-1], *many[-1]} == {99.0}
    if kernel.theta:
        return
    blocks = -(-COUNT // lanes)
    laid = [np.resize(array, (blocks * lanes, array.shape[1])) for array in arrays.values()]
    laid = [np.ascontiguousarray(a.reshape(blocks, lanes, -1).transpose(0, 2, 1)) for a in laid]
    by_lane = np.full((blocks, size, lanes), 99.0, real)
    compiled(f"{name}_batch_soa", COUNT, *laid, by_lane)
    assert error(by_lane.transpose(0, 2, 1).reshape(-1, size)[:COUNT], wanted) <= exact


def test_no_function_of_a_cut_body_is_long(compiled: Direct) -> None:
    files = library_files(compiled.package)
    bodies = [text for path, text in files.items() if path.endswith("_parts.inc")]
    assert bodies
    for function in (function for text in bodies for function in re.split(r"\nstatic ", text)[1:]):
        assert len(re.findall(r"const (?:V|real) t", function)) <= 2 * 40, function[:80]


def test_bodies_of_arms_stay_whole() -> None:
    assert not arm_package().has_parts


def test_a_cut_function_has_a_file_for_each_kernel(compiled: Direct) -> None:
    """A file with both variants of a humanoid's Coriolis matrix took gcc twice as long as either."""
    files = library_files(compiled.package)
    for function in compiled.package.functions:
        names = [kernel.name for kernel in function.kernels]
        cut = any(kernel.single_body.parts for kernel in function.kernels)
        for name in names:
            assert (f"src/{name}.c" in files) is (cut or name == function.name)
            assert f"src/{name}.c" in compiled.package.sources or not cut
    assert "src/inverse_dynamics_theta.c" in files


def test_arms_functions_are_one_file_each() -> None:
    files = library_files(arm_package())
    assert not [path for path in files if path.endswith("_theta.c")]
