"""Base parameters of mechanisms with closed loops: ranks of Pinocchio's regressors and loops, and pins that hide masses."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import pytest
from loop_trees import LoopTree, four_bar_legs, loop_tree

import psdmc
from psdmc.functions import RECIPES
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.load import LoadedRobot, load_robot, load_robot_text
from psdmc.robot.reference import reference
from psdmc.verification.check import with_passive_joints

PALLETISER = Path(__file__).parents[2] / "examples" / "palletiser"
CRANK, COUPLER, ROCKER, BASE = 0.2, 0.5, 0.4, 0.45
"""m: sides of a four-bar linkage."""


def linkage(bars: list[tuple[str, str, float]], *pins: tuple[tuple[str, float], tuple[str, float]]) -> str:
    """A planar mechanism of bars (name, parent, distance of its joint from the parent's). Each pin joins points of two
    bars."""
    joints = "".join(
        f'[[joint]]\nname = "{name}"\nparent = "{parent}"\na = {a}\n[joint.link]\nmass = {1.0 + 0.3 * k}\n'
        f"com = [{0.1 + 0.02 * k}, 0.02, 0.0]\n"
        "inertia_com = { xx = 0.1, yy = 0.1, zz = 0.1, xy = 0.0, xz = 0.0, yz = 0.0 }\n"
        for k, (name, parent, a) in enumerate(bars)
    )
    loops = "".join(
        f'[[loop]]\nname = "pin{k}"\nrows = ["x", "y"]\nfirst = {{ link = "{first}", xyz = [{x}, 0.0, 0.0] }}\n'
        f'second = {{ link = "{second}", xyz = [{other}, 0.0, 0.0] }}\n'
        for k, ((first, x), (second, other)) in enumerate(pins)
    )
    return f'name = "linkage"\nconvention = "modified"\ngravity = [0.0, -9.81, 0.0]\n{joints}{loops}'


FOUR_BAR = linkage(
    [("crank", "base", 0.0), ("coupler", "crank", CRANK), ("rocker", "base", BASE)],
    (("link3", ROCKER), ("link2", COUPLER)),
)
FIVE_BAR = linkage(
    [
        ("left", "base", 0.0),
        ("left_rod", "left", 0.2),
        ("right", "base", 0.3),
        ("right_rod", "right", 0.25),
    ],
    (("link4", 0.35), ("link2", 0.4)),
)

SIX_BAR = linkage(
    [
        *(("crank", "base", 0.0), ("coupler", "crank", CRANK), ("rocker", "base", BASE)),
        *(("rod", "rocker", 0.25), ("other", "base", 0.9)),
    ],
    (("link3", ROCKER), ("link2", COUPLER)),
    (("link5", 0.35), ("link4", 0.4)),
)
"""A rocker that drives a second four-bar linkage: the loops share it."""


def derived(text: str, tmp_path: Path) -> DynamicsModel:
    path = tmp_path / "linkage.toml"
    path.write_text(text, encoding="utf-8")
    return psdmc.derive(path)


def pinocchios_rows(tree: LoopTree, spread: float = 0.6, count: int = 120) -> np.ndarray:
    """The rows N^T Y at closed random states, with Pinocchio's regressor Y of the tree in base parameters, and an
    orthonormal basis N of the motion that Pinocchio's Jacobian of the loops allows."""
    read = with_passive_joints(tree.model, tree.loaded)
    robot = reference(read, snapped=False)
    rng, nv = np.random.default_rng(11), tree.model.nv

    def of(function: str, **given: np.ndarray) -> np.ndarray:
        (values,) = RECIPES[function].pinocchio(robot, given).values()
        return values

    q = tree.model.integrate(np.tile(tree.closed, (count, 1)), rng.uniform(-spread, spread, (count, nv)))
    for _ in range(30):
        inverse = np.linalg.pinv(of("loop_jacobian", q=q), rcond=1e-6)
        q = tree.model.integrate(q, -np.einsum("sij,sj->si", inverse, of("loop_error", q=q)))
    jacobian = of("loop_jacobian", q=q)
    sizes = np.linalg.svd(jacobian, compute_uv=False)
    good = (np.abs(of("loop_error", q=q)).max(axis=1) < 1e-12) & (sizes[:, -1] > 0.01)
    assert good.sum() > count // 3
    q, jacobian = q[good], jacobian[good]
    rank = jacobian.shape[1]
    basis = np.swapaxes(np.linalg.svd(jacobian)[2][:, rank:], 1, 2)
    qd = np.einsum("sij,sj->si", basis, rng.uniform(-2.0, 2.0, (len(q), nv - rank)))
    qdd = np.einsum("sij,sj->si", basis, rng.uniform(-4.0, 4.0, (len(q), nv - rank)))
    drift = of("loop_drift", q=q, qd=qd)
    qdd -= np.einsum("sij,sj->si", np.linalg.pinv(jacobian), drift)
    standard = robot.each(pinocchio.computeJointTorqueRegressor, q, qd, qdd)
    in_base = np.stack([torques_of(read, x, q, qd, qdd) for x in tree.model.representative.T], axis=-1)
    whole, rows = (
        (np.swapaxes(basis, 1, 2) @ each).reshape(-1, each.shape[-1]) for each in (standard, in_base)
    )
    assert rank_of(whole) == rank_of(rows)
    return rows


def torques_of(read: LoadedRobot, x: np.ndarray, *motion: np.ndarray) -> np.ndarray:
    """Pinocchio's torques due to the standard parameters x, added to links of 1 kg, because Pinocchio stores centres of
    mass."""
    light = np.tile(np.array([1.0, *9 * [0.0], 0.0]), (len(read.mechanism), 1))
    heavy, before = (
        reference(read, snapped=False, parameters=each).inverse_dynamics(*motion)
        for each in (light + x.reshape(light.shape), light)
    )
    return heavy - before


def rank_of(rows: np.ndarray) -> int:
    lengths = np.linalg.norm(rows, axis=0)
    seen = lengths > 1e-10 * lengths.max()
    sizes = np.linalg.svd(rows[:, seen] / lengths[seen], compute_uv=False)
    return int(np.count_nonzero(sizes > 1e-9 * sizes[0]))


def require_same_rows(found, rows: np.ndarray) -> None:
    """The combinations are as many as the rank of the rows, and span the same space."""
    scale = np.linalg.norm(rows, axis=0)
    scale = np.where(scale > 1e-10 * scale.max(), scale, 1.0)
    _, sizes, across = np.linalg.svd(rows / scale)
    rank = found.count
    assert sizes[rank - 1] > 1e-7 * sizes[0]
    assert rank == len(sizes) or sizes[rank - 1] > 1e4 * sizes[rank]
    combined = found.matrix / scale
    combined /= np.linalg.norm(combined, axis=1, keepdims=True)
    assert np.abs(combined @ across[rank:].T).max(initial=0.0) < 1e-6
    assert found.is_clear


def tree_of(text: str, tmp_path: Path) -> LoopTree:
    loaded = load_robot_text(text, "dh", source_name="linkage.toml")
    tree = LoopTree(loaded, np.zeros(len(loaded.mechanism)))
    return replace(tree, closed=np.array(START[text]))


START = {FOUR_BAR: (0.4, 0.24, 1.23), FIVE_BAR: (1.8, -1.2, 1.4, 0.9), SIX_BAR: (0.4, 0.2, 1.2, -0.7, 2.0)}
"""rad: positions near closed ones."""


def test_the_pin_of_a_four_bar_linkage_hides_one_base_parameter(tmp_path: Path) -> None:
    """A mass in the pin belongs to the coupler as well as to the rocker: torques see only the sum."""
    model = derived(FOUR_BAR, tmp_path)
    labels = [parameter.equation.split(" ")[0] for parameter in model.base_parameters]
    assert labels == ["mx1", "my1", "Izz1", "mx2", "my2", "Izz2", "mx3", "my3", "Izz3"]

    found = model.loop_base_parameters

    moved = [CRANK, 0.0, CRANK**2, COUPLER, 0.0, COUPLER**2, -ROCKER, 0.0, -(ROCKER**2)]
    np.testing.assert_allclose(found.matrix @ moved, 0.0, atol=1e-12)
    assert (found.count, found.is_clear) == (8, True)
    np.testing.assert_array_equal(found.matrix[:, found.kept], np.eye(8))
    require_same_rows(found, pinocchios_rows(tree_of(FOUR_BAR, tmp_path)))


def test_the_pin_of_a_five_bar_linkage_hides_one_base_parameter(tmp_path: Path) -> None:
    found = derived(FIVE_BAR, tmp_path).loop_base_parameters
    assert (found.count, found.matrix.shape) == (11, (11, 12))
    require_same_rows(found, pinocchios_rows(tree_of(FIVE_BAR, tmp_path)))


def test_two_pins_of_a_six_bar_linkage_hide_two_base_parameters(tmp_path: Path) -> None:
    found = derived(SIX_BAR, tmp_path).loop_base_parameters
    assert (found.count, found.matrix.shape) == (13, (13, 15))
    require_same_rows(found, pinocchios_rows(tree_of(SIX_BAR, tmp_path), count=300))


def test_loops_of_a_floating_robot() -> None:
    found = four_bar_legs().model.loop_base_parameters
    require_same_rows(found, pinocchios_rows(four_bar_legs(), count=200))


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2, 3))])
def test_loops_of_random_robots(seed: int) -> None:
    tree = loop_tree(seed, True)
    require_same_rows(tree.model.loop_base_parameters, pinocchios_rows(tree, count=200))


def test_parallelograms_that_stay_loops_give_the_exact_base_parameters_of_those_that_do_not() -> None:
    """The rank of Pinocchio's regressor is 25 (tests/robot/test_linear_loops.py)."""
    loops = PALLETISER / "palletiser_loops.toml"
    tables = [table | {"follows": []} for table in tomllib.loads(loops.read_text(encoding="utf-8"))["loop"]]
    exact = psdmc.derive(PALLETISER / "palletiser.urdf", loops=loops)
    tree = psdmc.derive(PALLETISER / "palletiser.urdf", loops=tables)

    found = tree.loop_base_parameters

    assert found.count == exact.l == 25
    both = np.vstack([exact.B, found.matrix @ tree.B])
    sizes = np.linalg.svd(both / np.linalg.norm(both, axis=1, keepdims=True), compute_uv=False)
    assert sizes[24] > 1e-3
    assert sizes[25] < 1e-10
    whole = exact.loop_base_parameters
    np.testing.assert_array_equal(whole.matrix, np.eye(25))


def test_redundant_rows_change_nothing(tmp_path: Path) -> None:
    model = derived(FOUR_BAR, tmp_path)
    (loop,) = model.mechanism.loops
    redundant = replace(model.mechanism, loops=(replace(loop, rows=(0, 1, 2)), replace(loop, name="again")))

    found, expected = (each.loop_base_parameters for each in (replace(model, mechanism=redundant), model))

    assert found.kept == expected.kept
    np.testing.assert_allclose(found.matrix, expected.matrix, atol=1e-12)


def test_the_torques_depend_on_the_combinations_only(tmp_path: Path) -> None:
    model = derived(FOUR_BAR, tmp_path)
    found = model.loop_base_parameters
    q = model.assemble([0.4, 0.6, 1.6])
    least = np.zeros(model.l)
    least[list(found.kept)] = found.matrix @ model.theta_b
    motion = q, [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]
    expected = model.loop_inverse_dynamics(*motion).tau
    assert abs(expected[0]) > 0.1
    np.testing.assert_allclose(model.loop_inverse_dynamics(*motion, theta_b=least).tau, expected, rtol=1e-10)


def test_equal_bytes_in_every_process(tmp_path: Path) -> None:
    model = derived(FOUR_BAR, tmp_path)
    psdmc.save(model, tmp_path / "model.npz")
    program = (
        "import sys, psdmc; found = psdmc.load(sys.argv[1]).loop_base_parameters; "
        "print(found.kept, found.matrix.tobytes().hex(), found)"
    )
    texts = {
        subprocess.run(
            [sys.executable, "-c", program, str(tmp_path / "model.npz")],
            env={"PYTHONHASHSEED": seed, "OMP_NUM_THREADS": threads},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed, threads in (("0", "1"), ("7", "2"))
    }
    assert len(texts) == 1
    assert texts.pop().startswith("(0, 1, 2, ")


def test_a_robot_without_loops_keeps_all(tmp_path: Path) -> None:
    model = derived(FOUR_BAR.split("[[loop]]")[0], tmp_path)
    found = model.loop_base_parameters
    assert found.count == model.l
    assert "9 of 9 base parameters" in str(found)


@pytest.mark.slow
def test_each_pin_of_cassie_hides_a_point_or_a_line(tmp_path: Path) -> None:
    """A point mass in the middle of a ball hides one base parameter. Masses on the axis of a hinge hide three: their sum and
    two moments along it."""
    import importlib.util

    from pinocchio_robots import path_of

    sdf = Path(path_of("hyq")).parents[2] / "cassie_description" / "robots" / "cassie.sdf"
    if not sdf.exists():
        pytest.skip("example-robot-data has no cassie.sdf")
    spec = importlib.util.spec_from_file_location(
        "cassie", Path(__file__).parents[2] / "examples" / "cassie" / "cassie.py"
    )
    cassie = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(cassie)
    mjcf = tmp_path / "cassie.xml"
    mjcf.write_text(cassie.mjcf_of(sdf), encoding="utf-8")
    model = cassie.loaded(mjcf)

    found = model.loop_base_parameters

    assert found.count == model.l - 2 * 1 - 2 * 3
    planar = [{"name": f"{side}-plantar-foot-joint", "rows": ["x", "y"]} for side in ("left", "right")]
    tree = LoopTree(load_robot(mjcf, loops=planar, snap=0.0), cassie.neutral(model))
    require_same_rows(found, pinocchios_rows(tree, 0.3, 60))
