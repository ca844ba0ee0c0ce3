"""Derivatives of robots with limbs, compiled, against Pinocchio: one state, rows, lanes and parameters at run time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from direct import Direct, shared_library
from installed import need
from limbed import DERIVATIVES, SHAPES, limbed
from lowered import lowered
from random_trees import RandomTree
from slow_cases import slow_but_for

from psdmc.backends.c.package import PackageView, package_view
from psdmc.backends.info import EmitOptions, package_info
from psdmc.derivation.derive import derive_model
from psdmc.functions import RECIPES
from psdmc.model.random_states import states_of
from psdmc.program.signature import Sizes
from psdmc.robot.mechanism import Placement
from psdmc.robot.reference import Reference

INVERSE, FORWARD = DERIVATIVES[:5], DERIVATIVES[5:]
WITH_SECOND = (*FORWARD, "forward_dynamics_second_derivatives")
JACOBIANS = ("inverse_dynamics_derivatives", "forward_dynamics_derivatives")
COUNT = 11
"""States: no whole number of vectors."""

EXACT = {"float64": 1e-12, "float32": 2e-4}
"""Of an output's largest entry."""


def almost_equal_legs(seed: int = 1, length: int = 3, spread: float = 1e-9) -> RandomTree:
    """Four legs that differ by this share: numbers of limbs that are nearly one number stay a number for each."""
    tree = limbed(seed, "F", [(0, "R" * length, 4)])
    rng = np.random.default_rng(5)
    for joint in range(1 + length, tree.n):
        like = 1 + (joint - 1) % length
        place, near = tree.places[like], 1.0 + spread * rng.uniform(-1.0, 1.0, 13)
        tree.places[joint] = Placement(place.rotation, place.translation * near[:3])
        tree.parameters[joint] = tree.parameters[like] * near[3:]
    tree.model, tree.joints = tree._pinocchio()
    tree.data = tree.model.createData()
    return tree


def random_limbs(seed: int) -> RandomTree:
    """By turns: limbs of equal structure, limbs of other lengths and joint types, legs that are equal or nearly so."""
    rng = np.random.default_rng(seed)
    if seed % 3 == 2:
        return almost_equal_legs(seed, int(rng.integers(2, 4)), float(rng.choice([0.0, 1e-12, 1e-9, 1e-3])))
    trunk = str(rng.choice(["F", "FR", "FRP", "R", "SR"]))
    chains = ["".join(rng.choice(list("RRRP"), rng.integers(1, 4))) for _ in range(2 + 2 * (seed % 3))]
    bodies = sorted(rng.integers(len(trunk), size=len(chains)).tolist(), reverse=True)  # Pinocchio's order
    counts = rng.integers(1, 4, len(chains)).tolist()
    return limbed(seed, trunk, list(zip(bodies, chains, counts, strict=True)))


RANDOM = [f"random limbs {seed}" for seed in range(100)]

TREES: dict[str, Callable[[], RandomTree]] = {
    **{name: lambda seed=seed: random_limbs(seed) for seed, name in enumerate(RANDOM)},  # type: ignore[misc]
    **{name: lambda name=name: limbed(1, *SHAPES[name]) for name in SHAPES},  # type: ignore[misc]
    "almost equal legs": almost_equal_legs,
    "legs of three, two and one joint": lambda: limbed(
        2, "F", [(0, "RRR", 2), (0, "RR", 1), (0, "RP", 2), (0, "R", 1)]
    ),
    "a hand on an arm on a quadruped": lambda: limbed(3, "FRR", [(2, "RR", 3), (0, "RRR", 4)]),
    "limbs on a spherical joint": lambda: limbed(4, "S", [(0, "RP", 3)]),
}
EQUAL, UNEQUAL = "four legs of a floating body", "legs of three, two and one joint"
WRIST = "three fingers on a wrist"
CASES = [
    *((name, INVERSE, "float64", "gcc") for name in (EQUAL, UNEQUAL, "almost equal legs")),
    *((name, INVERSE, "float32", "gcc") for name in (EQUAL, WRIST)),
    *((name, INVERSE, "float64", "clang") for name in (EQUAL, UNEQUAL)),
    (EQUAL, FORWARD, "float64", "gcc"),
    (UNEQUAL, FORWARD, "float64", "clang"),
    *((name, WITH_SECOND, "float64", "gcc") for name in TREES if name not in RANDOM),
    *(
        (name, JACOBIANS, ("float64", "float32")[seed // 2 % 2], ("gcc", "clang")[seed % 2])
        for seed, name in enumerate(RANDOM)
    ),
]
QUICK = [
    (EQUAL, FORWARD, "float64", "gcc"),
    (WRIST, INVERSE, "float32", "gcc"),
]


@pytest.mark.parametrize(("name", "functions", "real", "compiler"), slow_but_for(QUICK, CASES, spread=True))
def test_derivatives_are_pinocchios_in_every_layout(
    name: str, functions: tuple[str, ...], real: str, compiler: str, tmp_path: Path
) -> None:
    """Those of forward dynamics without parameters at run time: that variant has no limbs in lanes."""
    need(compiler)
    tree = TREES[name]()
    model = derive_model(tree.mechanism(), expand=False)
    kernels = lowered(model, "factored", functions, theta_variants=functions is INVERSE)
    assert name in RANDOM or any(kernels[function].limbs for function in functions)
    package = package_view(package_info(model), kernels, EmitOptions(real=real))  # type: ignore[arg-type]
    compiled = Direct(package, shared_library(package, tmp_path, ["-O0", "-march=native"], compiler))
    sizes = Sizes.of(model.mechanism, model.l)
    given = _states(tree, sizes, real)
    assert tree.order == list(range(sizes.nv))
    tree.model.addFrame(pin.Frame("tip", 1, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    oracle = Reference(tree.model, "tip")
    theta_b = np.asarray(model.theta_b, real)

    variants = {"": []} | ({"_theta": [theta_b]} if functions is INVERSE else {})
    for function in functions:
        expected = RECIPES[function].pinocchio(oracle, {k: v.astype(float) for k, v in given.items()})
        exact = EXACT[real]
        if function.startswith("forward_dynamics_second_derivatives") or (
            name in RANDOM and RECIPES[function].signature.factorises
        ):  # solves with the mass matrix twice
            worst = np.linalg.cond(oracle.mass_matrix(given["q"].astype(float))).max()
            exact = max(exact, 2 * sizes.nv * float(worst) * float(np.finfo(real).eps))
        for way, found in _every_layout(compiled, package, function, given, sizes, variants):
            for block, values in expected.items():
                error = np.abs(found[block].reshape(values.shape) - values).max()
                assert error <= exact * np.abs(values).max(), (function, way, block)


def _states(tree: RandomTree, sizes: Sizes, real: str) -> dict[str, np.ndarray]:
    q, qd, qdd = states_of(tree.mechanism(), np.random.default_rng(9), COUNT)
    along = np.random.default_rng(10).uniform(-1.0, 1.0, (6, COUNT, sizes.nv))
    names = ("cotangent", "dq", "dqd", "dqdd", "dtau", "tau")
    given = {"q": q, "qd": qd, "qdd": qdd} | dict(zip(names, along, strict=True))
    return {name: np.ascontiguousarray(rows, real) for name, rows in given.items()}


def _every_layout(
    compiled: Direct,
    package: PackageView,
    function: str,
    given: dict[str, np.ndarray],
    sizes: Sizes,
    variants: dict[str, list[np.ndarray]],
) -> list[tuple[str, dict[str, np.ndarray]]]:
    """What one state after the other, rows and lanes give, baked and with theta_b."""
    signature = RECIPES[function].signature
    inputs = [given[quantity.name] for quantity in signature.inputs]
    found = []
    for variant, theta in variants.items():
        one, rows = ({q.name: _empty(sizes.size(q), inputs[0]) for q in signature.outputs} for _ in range(2))
        for k in range(COUNT):
            state = [array[k].copy() for array in inputs]
            compiled(f"{function}{variant}", *state, *theta, *(values[k] for values in one.values()))
        compiled(f"{function}{variant}_batch", COUNT, *inputs, *theta, *rows.values())
        found += [(f"one state{variant}", one), (f"rows{variant}", rows)]
    lanes = {q.name: _in_lanes(_empty(sizes.size(q), inputs[0]), package.lanes) for q in signature.outputs}
    laid = [_in_lanes(array, package.lanes) for array in inputs]
    compiled(f"{function}_batch_soa", COUNT, *laid, *lanes.values())
    by_lane = {
        name: block.transpose(0, 2, 1).reshape(-1, block.shape[1])[:COUNT] for name, block in lanes.items()
    }
    found.append(("lanes", by_lane))
    return found


def _empty(size: int, like: np.ndarray) -> np.ndarray:
    return np.full((COUNT, size), np.nan, like.dtype)


def _in_lanes(rows: np.ndarray, lanes: int) -> np.ndarray:
    blocks = -(-COUNT // lanes)
    padded = np.zeros((blocks * lanes, rows.shape[1]), rows.dtype)
    padded[:COUNT] = rows
    return np.ascontiguousarray(padded.reshape(blocks, lanes, -1).transpose(0, 2, 1))
