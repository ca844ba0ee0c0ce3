"""What header and docs/shipping.md promise of overlapping arrays, for every function in every layout."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from direct import Direct, shared_library, states
from slow_cases import slow_but_for
from traced import SIZES, L, N, arm, arm_kernels, arm_package

from psdmc.backends.c.back_end import package_files
from psdmc.backends.info import EmitOptions

KERNELS = arm_kernels()
AS_LONG_AS_AN_INPUT = [
    name for name, kernel in KERNELS.items() if SIZES.size(kernel.function.outputs[0]) == N
]
BUILDS = {"vectors": ["-march=native"], "plain": ["-Dtest_arm_NO_VECTORS"], "parts": ["-march=native"]}
BUILDS |= {"clears": ["-march=native"]}
"""`parts`: bodies are cut into functions of some thirty operations; `clears`: runs of two zeros are cleared."""
OPTIMISED = ("float64", "vectors")
"""The build that shows what a compiler makes of it; the others show in which order the C reads and writes."""


CASES = [
    ("float64", "vectors"),
    ("float64", "plain"),
    ("float32", "vectors"),
    ("float64", "parts"),
    ("float64", "clears"),
]
QUICK = [OPTIMISED]


@pytest.fixture(scope="module", params=slow_but_for(QUICK, CASES), ids=" ".join)
def compiled(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Direct:
    real, build = request.param
    with pytest.MonkeyPatch.context() as patch:
        if build == "parts":
            patch.setattr("psdmc.backends.c.make_kernel_view.LONG", 30)
            patch.setattr("psdmc.backends.c.make_kernel_view.PART", 30)
        if build == "clears":
            patch.setattr("psdmc.backends.c.body.LEAST", 1)
            patch.setattr("psdmc.backends.c.body.SHORTEST", 2)
        package = arm_package(options=EmitOptions(real=real))
    assert (package.has_parts, package.has_clears) == (build == "parts", build == "clears")
    flags = ["-O1" if request.param == OPTIMISED else "-O0", *BUILDS[build]]
    return Direct(package, shared_library(package, tmp_path_factory.mktemp("aliasing"), flags))


def _given(compiled: Direct, name: str, count: int) -> dict[str, np.ndarray]:
    """Random states; a theta_b of positive masses, so that forward dynamics has values."""
    given = states(KERNELS[name], count, N, L)
    if KERNELS[name].theta:
        given["theta_b"] = 1.25 * arm()[1].ravel()
    return {key: np.ascontiguousarray(v, compiled.package.options.real) for key, v in given.items()}


def _symbol(name: str) -> str:
    return f"{name}_batch"


@pytest.mark.parametrize("name", KERNELS)
def test_one_state_may_overlap_its_inputs_in_any_way(compiled: Direct, name: str) -> None:
    """Inputs side by side in one array, theta_b included; the output begins before, within and behind each."""
    real = compiled.package.options.real
    inputs = {key: v if key == "theta_b" else v[0] for key, v in _given(compiled, name, 1).items()}
    size, length = SIZES.size(KERNELS[name].function.outputs[0]), sum(map(len, inputs.values()))
    wanted = np.zeros(size, real)
    compiled(name, *inputs.values(), wanted)
    for first in range(length + size):
        buffer = np.zeros(length + 2 * size, real)
        views, start = [], size
        for values in inputs.values():
            views.append(buffer[start : start + len(values)])
            views[-1][:] = values
            start += len(values)
        found = buffer[first : first + size]

        compiled(name, *views, found)

        assert np.array_equal(found, wanted), first


@pytest.mark.parametrize("name", AS_LONG_AS_AN_INPUT)
def test_a_batch_may_overwrite_any_input_whose_rows_are_as_long(compiled: Direct, name: str) -> None:
    for count in range(2 * compiled.package.lanes + 2):
        given = _given(compiled, name, count)
        wanted = np.zeros((count, N), compiled.package.options.real)
        compiled(_symbol(name), count, *given.values(), wanted)
        for shared in (quantity.name for quantity in KERNELS[name].function.inputs):
            rows = {key: v.copy() for key, v in given.items()}
            compiled(_symbol(name), count, *rows.values(), rows[shared])
            assert np.array_equal(rows[shared], wanted), (count, shared)
            assert _others_are_as_they_were(rows, given, shared)


@pytest.mark.parametrize("name", [name for name in AS_LONG_AS_AN_INPUT if not KERNELS[name].theta])
def test_blocks_of_lanes_may_overwrite_any_input_whose_rows_are_as_long(compiled: Direct, name: str) -> None:
    lanes = compiled.package.lanes
    for count in range(2 * lanes + 2):
        blocks = -(-count // lanes)
        given = {
            key: v.reshape(blocks, N, lanes) for key, v in _given(compiled, name, blocks * lanes).items()
        }
        wanted = np.zeros((blocks, N, lanes), compiled.package.options.real)
        compiled(f"{name}_batch_soa", count, *given.values(), wanted)
        for shared in given:
            arrays = {key: v.copy() for key, v in given.items()}
            compiled(f"{name}_batch_soa", count, *arrays.values(), arrays[shared])
            assert np.array_equal(arrays[shared], wanted), (count, shared)
            assert _others_are_as_they_were(arrays, given, shared)


@pytest.mark.parametrize("name", AS_LONG_AS_AN_INPUT)
def test_one_array_may_be_all_inputs_and_the_output(compiled: Direct, name: str) -> None:
    count = 2 * compiled.package.lanes + 1
    given = _given(compiled, name, count)
    extra = [given["theta_b"]] if KERNELS[name].theta else []
    inputs = len(KERNELS[name].function.inputs)
    copies, wanted = [given["q"].copy() for _ in range(inputs)], np.zeros_like(given["q"])
    compiled(_symbol(name), count, *copies, *extra, wanted)

    one = given["q"].copy()
    compiled(_symbol(name), count, *([one] * inputs), *extra, one)

    assert np.array_equal(one, wanted)


def _others_are_as_they_were(
    found: Mapping[str, np.ndarray], given: Mapping[str, np.ndarray], written: str
) -> bool:
    return all(np.array_equal(found[key], given[key]) for key in given if key != written)


def test_nothing_more_is_promised() -> None:
    """A batch whose output lies a row behind its input reads results: header, README and manual say so."""
    files = package_files(arm_package(names=["gravity"]))
    for text in (files["include/test_arm/test_arm.h"], files["README.md"]):
        words = " ".join(text.replace("*", " ").split())
        assert "must not overlap an input" in words
        assert "rows are equally long" in words
        assert "theta_b is" in words or "not theta_b" in words
    manual = " ".join(_manual().split())
    assert "must not overlap" in manual
    assert "any other overlap, also with theta_b" in manual


def _manual() -> str:
    return (Path(__file__).parents[2] / "docs" / "shipping.md").read_text(encoding="utf-8")
