"""Runs of zeros in C: every function in every form gives what its PROGRAM does, onto outputs that held other numbers."""

from __future__ import annotations

import numpy as np
import pytest
from direct import Direct, all_expected, error, shared_library, states
from slow_cases import slow_but_for
from traced import L, N, arm_kernels, arm_package

from psdmc.backends.info import EmitOptions

CASES = [("-march=native", "float64"), ("-Dtest_arm_NO_VECTORS", "float64"), ("-march=native", "float32")]
KERNELS = {name: kernel for name, kernel in arm_kernels().items() if not kernel.theta}
COUNT = 11


@pytest.fixture(scope="module", params=slow_but_for(CASES[:1], CASES))
def compiled(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Direct:
    build, real = request.param
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("psdmc.backends.c.body.LEAST", 1)
        patch.setattr("psdmc.backends.c.body.SHORTEST", 2)
        package = arm_package(options=EmitOptions(real=real))
    assert package.has_clears
    flags = ["-O0", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror", build]
    return Direct(package, shared_library(package, tmp_path_factory.mktemp("cleared"), flags))


@pytest.mark.parametrize("name", KERNELS)
def test_cleared_runs_are_zero(compiled: Direct, name: str) -> None:
    real, lanes = compiled.package.options.real, compiled.package.lanes
    given = states(KERNELS[name], COUNT, N, L)
    (wanted,) = all_expected(KERNELS[name], given, N, L).values()
    arrays = {key: np.ascontiguousarray(values, real) for key, values in given.items()}
    size, exact = wanted.shape[-1], 1e-3 if real == "float32" else 1e-11

    one = np.full(size + 1, 99.0, real)
    compiled(name, *(array[3] for array in arrays.values()), one)
    many = np.full((COUNT + 1, size), 99.0, real)
    compiled(f"{name}_batch", COUNT, *arrays.values(), many)
    blocks = -(-COUNT // lanes)
    laid = [np.resize(array, (blocks * lanes, array.shape[1])) for array in arrays.values()]
    laid = [np.ascontiguousarray(a.reshape(blocks, lanes, -1).transpose(0, 2, 1)) for a in laid]
    by_lane = np.full((blocks, size, lanes), 99.0, real)
    compiled(f"{name}_batch_soa", COUNT, *laid, by_lane)

    assert error(one[:-1], wanted[3]) <= exact
    assert error(many[:-1], wanted) <= exact
    assert error(by_lane.transpose(0, 2, 1).reshape(-1, size)[:COUNT], wanted) <= exact
    assert {one[-1], *many[-1]} == {99.0}
