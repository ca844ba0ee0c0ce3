"""Limbs in lanes, compiled: vectors of every width, precision and source of sines give what the straight line gives."""

from __future__ import annotations

import platform
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from direct import Direct, shared_library
from limbed import FUNCTIONS, forced, kernels, limbed, package_of, shape
from slow_cases import slow_but_for

from psdmc.backends.c.package import PackageView, package_view
from psdmc.backends.info import EmitOptions, package_info
from psdmc.derivation.derive import derive_model
from psdmc.functions import RECIPES
from psdmc.lower.kernels import lower
from psdmc.model.random_states import states_of
from psdmc.program.interpret import interpret
from psdmc.program.signature import Sizes
from psdmc.target.presets import COSTS, SCALAR, preset

LEGS, FIVE, BOTH = (
    "four legs of a floating body",
    "five legs of a floating body",
    "arms on a trunk, legs on its root",
)
FINGERS = "three fingers on a wrist"
EAGER = replace(COSTS, worth_limbs=0.1)
"""Limbs run in lanes, whether that pays or not."""
COUNT = 8
EXACT = {"float64": 1e-12, "float32": 2e-3}
"""Of an output's largest value; accelerations follow the mass matrix's condition."""

BUILDS = {
    "2 lanes": ["-march=x86-64"],
    "4 lanes": ["-march=x86-64-v3"],
    "4 lanes of 8": ["-march=x86-64-v4"],
    "8 lanes": ["-march=x86-64-v4", "-D__znver3__"],
    "no vectors": ["-Dtree_NO_VECTORS"],
}
CASES = [
    *((LEGS, build, "float64", "inline") for build in BUILDS),
    *((FIVE, build, "float64", "inline") for build in ("2 lanes", "4 lanes", "8 lanes")),
    (BOTH, "4 lanes", "float64", "inline"),
    (FINGERS, "4 lanes", "float64", "inline"),
    (LEGS, "4 lanes", "float64", "libm"),
    (LEGS, "2 lanes", "float64", "freestanding"),
    (LEGS, "4 lanes", "float32", "inline"),
    (BOTH, "2 lanes", "float32", "libm"),
]
QUICK = [
    (LEGS, "2 lanes", "float64", "inline"),
    (LEGS, "no vectors", "float64", "inline"),
    (FINGERS, "4 lanes", "float64", "inline"),
    (LEGS, "4 lanes", "float32", "inline"),
]
"""Limbs that fill the lanes and limbs that do not, two widths and none, both precisions."""


def runs_here(build: str) -> bool:
    if "NO_VECTORS" in " ".join(BUILDS[build]):
        return True
    needed = {"2 lanes": "sse2", "4 lanes": "avx2", "4 lanes of 8": "avx512dq", "8 lanes": "avx512dq"}[build]
    cpu = Path("/proc/cpuinfo")
    return platform.machine() == "x86_64" and cpu.exists() and needed in cpu.read_text().split()


def built(name: str, build: str, folder: Path, real: str = "float64", trig: str = "inline") -> Direct:
    return built_from(package_of(name, EmitOptions(real=real, trig=trig)), build, folder)  # type: ignore[arg-type]


def built_from(package: PackageView, build: str, folder: Path) -> Direct:
    if not runs_here(build):
        pytest.skip(f"no processor for {build}")
    strict = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wdouble-promotion", "-Werror"]
    return Direct(package, shared_library(package, folder, ["-O0", *strict, *BUILDS[build]]))


def given_states(name: str, real: str = "float64") -> dict[str, np.ndarray]:
    mechanism = shape(name)[1].mechanism
    vectors = states_of(mechanism, np.random.default_rng(9), COUNT)
    states = dict(zip(("q", "qd", "qdd"), vectors, strict=True)) | {"tau": 2.0 * vectors[2]}
    return {key: np.ascontiguousarray(rows, real) for key, rows in states.items()}


def called(compiled: Direct, function: str, state: dict[str, np.ndarray], size: int) -> np.ndarray:
    inputs = [state[q.name] for q in RECIPES[function].signature.inputs]
    out = np.full(size, np.nan, inputs[0].dtype)
    assert compiled(function, *inputs, out) in (0, None)
    return out


@pytest.mark.parametrize(("name", "build", "real", "trig"), slow_but_for(QUICK, CASES, spread=True))
def test_one_state_is_the_straight_lines(name: str, build: str, real: str, trig: str, tmp_path: Path) -> None:
    compiled, model, given = (
        built(name, build, tmp_path, real, trig),
        shape(name)[1],
        given_states(name, real),
    )
    sizes = Sizes.of(model.mechanism, model.l)
    in_lanes = 0
    for function in FUNCTIONS:
        signature, kernel = RECIPES[function].signature, kernels(name)[function]
        in_lanes += kernel.limbs is not None
        wanted = interpret(kernel.single, given, signature.sizes(sizes))[signature.outputs[0].name]
        for k in range(COUNT):
            state = {key: rows[k].copy() for key, rows in given.items()}
            found = called(compiled, function, state, wanted.shape[1])
            assert np.abs(found - wanted[k]).max() <= EXACT[real] * np.abs(wanted[k]).max(), (function, k)
    assert in_lanes


EIGHT, PAIRS = "eight arms on the base", "eight fingers of two joints"
STORED = [
    *((name, build, "float64") for name in (LEGS, FIVE, FINGERS) for build in BUILDS),
    (EIGHT, "8 lanes", "float64"),
    (EIGHT, "4 lanes", "float64"),
    (EIGHT, "4 lanes", "float32"),
    (PAIRS, "8 lanes", "float64"),
    (PAIRS, "2 lanes", "float64"),
    (LEGS, "2 lanes", "float32"),
]


QUICKLY_STORED = [
    (LEGS, "no vectors", "float64"),
    (LEGS, "2 lanes", "float32"),
    (FIVE, "4 lanes", "float64"),
    (FIVE, "4 lanes of 8", "float64"),
    (FIVE, "8 lanes", "float64"),
    (FINGERS, "2 lanes", "float64"),
    (PAIRS, "8 lanes", "float64"),
]
"""Each build, and limbs that fill the lanes and that do not."""


@pytest.mark.parametrize(("name", "build", "real"), slow_but_for(QUICKLY_STORED, STORED, spread=True))
def test_vectors_and_matrices_are_stored_at_every_width(
    name: str, build: str, real: str, tmp_path: Path
) -> None:
    """Whether lanes pay or not, as rows, woven or alone: what the same function's straight line stores."""
    functions = ("inverse_dynamics", "mass_matrix")
    own, model, given = {f: forced(name, f) for f in functions}, shape(name)[1], given_states(name, real)
    package = package_view(package_info(model), own, EmitOptions(real=real))  # type: ignore[arg-type]
    compiled = built_from(package, build, tmp_path)
    sizes = Sizes.of(model.mechanism, model.l)
    for function in functions:
        wanted = interpret(own[function].single, given, RECIPES[function].signature.sizes(sizes))
        (values,) = wanted.values()
        for k in range(COUNT):
            state = {key: rows[k].copy() for key, rows in given.items()}
            found = called(compiled, function, state, values.shape[1])
            assert np.abs(found - values[k]).max() <= EXACT[real] * np.abs(values[k]).max(), (function, k)


@pytest.mark.parametrize("build", slow_but_for(["4 lanes"], ["2 lanes", "4 lanes"]))
def test_an_output_may_be_an_input(build: str, tmp_path: Path) -> None:
    compiled, given = built(LEGS, build, tmp_path), given_states(LEGS)
    state = {key: rows[0].copy() for key, rows in given.items()}
    size = shape(LEGS)[1].nv
    for function in ("inverse_dynamics", "forward_dynamics"):
        wanted = called(compiled, function, state, size)
        for shared in RECIPES[function].signature.inputs:
            inputs = [state[q.name].copy() for q in RECIPES[function].signature.inputs]
            place = [q.name for q in RECIPES[function].signature.inputs].index(shared.name)
            compiled(function, *inputs, inputs[place])
            assert np.array_equal(inputs[place][:size], wanted)


@pytest.mark.parametrize("build", slow_but_for(["4 lanes"], ["2 lanes", "4 lanes"]))
def test_nan_in_one_limb_stays_out_of_what_does_not_depend_on_it(build: str, tmp_path: Path) -> None:
    """Of a leg's angle that is not a number, that leg's torques and the body's know; other legs' entries of M do not."""
    compiled, given = built(LEGS, build, tmp_path), given_states(LEGS)
    state = {key: rows[0].copy() for key, rows in given.items()}
    state["q"][8] = np.nan  # the first leg's second joint
    nv = shape(LEGS)[1].nv

    mass = called(compiled, "mass_matrix", state, nv * nv).reshape(nv, nv)
    torques = called(compiled, "inverse_dynamics", state, nv)

    assert np.isfinite(mass[9:, 9:]).all()
    assert np.isfinite(mass[9:, :6]).all()
    assert np.isnan(mass[6:9, :6]).any()
    assert np.isnan(mass[:6, :6]).any()
    assert np.isfinite(torques[9:]).all()
    assert np.isnan(torques[:7]).all()


def test_a_pivot_that_is_not_positive_is_reported_as_by_the_straight_line(tmp_path: Path) -> None:
    """An angle of any limb that is not a number makes pivots that are none."""
    given, nv = given_states(LEGS), shape(LEGS)[1].nv
    builds = [built(LEGS, build, tmp_path / build.replace(" ", "_")) for build in ("4 lanes", "no vectors")]
    for limb in range(4):
        state = {key: rows[0].copy() for key, rows in given.items()}
        state["q"][7 + 3 * limb + 2] = np.nan
        pivots = interpret(kernels(LEGS)["forward_dynamics"].single, state, {"qdd": nv, "pivot": nv})["pivot"]
        statuses = []
        for compiled in builds:
            out = np.zeros(nv)
            statuses.append(compiled("forward_dynamics", state["q"], state["qd"], state["tau"], out))
            assert np.isnan(out).all()
        assert statuses == [1 + int(np.argmin(pivots > 0.0))] * 2, limb


def test_many_pivots_are_looked_at_in_one_loop(tmp_path: Path) -> None:
    """One by one, each would write its own NaN into all accelerations."""
    from psdmc.backends.c.back_end import package_files

    text = package_files(package_of(LEGS, EmitOptions()))["src/forward_dynamics.c"]
    (line,) = re.findall(r"return fail\(.*", text)
    assert line == "return fail(qdd, k + 1);"


def test_the_package_says_what_it_has(tmp_path: Path) -> None:
    from psdmc.backends.c.back_end import package_files

    files = package_files(package_of(LEGS, EmitOptions()))
    assert "src/limbs4.h" in files
    assert re.search(r"inverse_dynamics: .*; one state with limbs in lanes: ", files["include/tree/tree.h"])
    assert "cost_with_limbs_in_lanes" in files["manifest.json"]
    assert "limbs" not in files["src/inverse_dynamics.inc"]


def test_machines_without_vectors_and_packages_without_limbs_have_no_trace_of_them() -> None:
    from psdmc.backends.c.back_end import package_files

    for options in (EmitOptions(target=SCALAR),):
        assert not [path for path in package_files(package_of(LEGS, options)) if "limbs" in path]
    narrow = package_files(package_of(LEGS, EmitOptions(target=preset("x86-64-v2"))))
    assert "#define LIMBS4_WIDTH 2" in narrow["src/vectors.h"]


def test_the_third_group_s_sums_are_no_sum_over_two_limbs(tmp_path: Path) -> None:
    """Vectors are named by their group's number, functions over limbs by how many these are: both are two here."""
    tree = limbed(1, "FR", [(1, "RR", 2), (0, "RRR", 2), (0, "RR", 3)])
    model = derive_model(tree.mechanism(), expand=False)
    made = lower(model, "factored", ["mass_matrix"], theta_variants=False, costs=EAGER)
    limbs = made["mass_matrix"].limbs
    assert limbs is not None
    assert [group.count for group in limbs.groups] == [2, 3, 2]
    package = package_view(package_info(model), made, EmitOptions())

    compiled = Direct(package, shared_library(package, tmp_path, ["-O0", *BUILDS["4 lanes"]]))

    (q,) = tree.motion(1)[0]
    found = called(compiled, "mass_matrix", {"q": q.copy()}, model.nv**2).reshape(model.nv, model.nv)
    upper = np.triu(tree.each(pin.crba, q[None])[0])
    assert np.abs(found - upper - np.triu(upper, 1).T).max() <= EXACT["float64"] * upper.max()
