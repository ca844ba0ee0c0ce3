"""Compiled functions over Dask's and xarray's arrays: lazy, in chunks, by name, on a cluster."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from bundled import bundled_model

import psdmc
from psdmc.errors import InputError
from psdmc.functions import SIGNATURES
from psdmc.toolchain.call import CompiledRobot
from psdmc.toolchain.labelled_arrays import dimensions

da = pytest.importorskip("dask.array")

FUNCTIONS = ["inverse_dynamics", "gravity", "mass_matrix", "regressor", "forward_kinematics"]
RANDOM = np.random.default_rng(2)


@pytest.fixture(scope="module")
def robot() -> CompiledRobot:
    return psdmc.compile(bundled_model("scara"), functions=FUNCTIONS)


def tuples(found: object) -> tuple[object, ...]:
    return found if isinstance(found, tuple) else (found,)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_chunk_is_what_the_call_gives(robot: CompiledRobot, name: str) -> None:
    """Chunks cut states unevenly, and joints too; several outputs, matrices and named frames."""
    states = [RANDOM.normal(size=(10, 7, 4)) for _ in SIGNATURES[name].inputs]
    lazy = [da.from_array(array, chunks=((4, 4, 2), 7, (3, 1))) for array in states]

    found, expected = getattr(robot, name)(*lazy), getattr(robot, name)(*states)

    assert type(found).__name__ == (type(expected).__name__ if isinstance(expected, tuple) else "Array")
    for one, other in zip(tuples(found), tuples(expected), strict=True):
        assert one.chunks[0] == (4, 4, 2)
        assert (one.shape, one.dtype) == (other.shape, other.dtype)
        assert np.array_equal(one.compute(scheduler="sync"), other)


def test_nothing_is_computed_before_it_is_asked_for(robot: CompiledRobot) -> None:
    def never(block: np.ndarray) -> np.ndarray:
        raise AssertionError("computed")

    q = da.zeros((8, 4), chunks=2).map_blocks(never, meta=np.empty((0, 0)))
    found = robot.inverse_dynamics(q, q, q)
    assert found.shape == (8, 4)
    with pytest.raises(AssertionError, match="computed"):
        found.compute(scheduler="sync")


def test_arrays_of_both_kinds_broadcast_and_theta_b_goes_along(robot: CompiledRobot) -> None:
    q = RANDOM.normal(size=(6, 4))
    found = robot.inverse_dynamics(da.from_array(q, chunks=(2, 4)), np.zeros(4), q, 2.0 * robot.theta_b)
    expected = robot.inverse_dynamics(q, np.zeros(4), q, 2.0 * robot.theta_b)
    assert np.array_equal(found.compute(scheduler="sync"), expected)


def test_single_precision_stays_single() -> None:
    robot = psdmc.compile(bundled_model("scara"), functions="gravity", real="float32")
    found = robot.gravity(da.zeros((4, 4), chunks=2))
    assert found.dtype == np.float32
    assert found.compute(scheduler="sync").dtype == np.float32


def test_wrong_shapes_and_out_are_refused_at_once(robot: CompiledRobot) -> None:
    with pytest.raises(InputError, match=r"gravity: q has shape \(8, 3\), expected \(\.\.\., 4\)"):
        robot.gravity(da.zeros((8, 3)))
    with pytest.raises(InputError, match="gravity: out is for NumPy arrays"):
        robot.gravity(da.zeros((8, 4)), out=np.empty((8, 4)))


def test_equal_robots_have_equal_tokens(robot: CompiledRobot) -> None:
    """Dask computes equal calls once."""
    from dask.base import tokenize

    q = da.zeros((8, 4), chunks=2)
    assert tokenize(robot) == tokenize(pickle.loads(pickle.dumps(robot)))
    assert robot.gravity(q).name == robot.gravity(q).name
    other = psdmc.compile(bundled_model("scara"), functions="gravity")
    assert tokenize(other) != tokenize(robot)


@pytest.mark.slow
def test_a_cluster_of_processes_has_the_same_values(robot: CompiledRobot, tmp_path) -> None:
    """Any cluster by its address: the client connects to the scheduler of a LocalCluster by one."""
    distributed = pytest.importorskip("distributed")
    q = RANDOM.normal(size=(4000, 4))
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "dashboard_address": None}
    with (
        distributed.LocalCluster(**options, local_directory=tmp_path) as cluster,
        distributed.Client(cluster.scheduler_address) as client,
    ):
        lazy = da.from_array(q, chunks=(500, 4))
        found = robot.inverse_dynamics(lazy, lazy, lazy).compute()
        mapped = client.gather(client.map(robot.gravity, [q[:3], q[3:9]]))
    assert np.array_equal(found, robot.inverse_dynamics(q, q, q))
    assert np.array_equal(np.concatenate(mapped), robot.gravity(q[:9]))


class TestNamedDimensions:
    """xarray."""

    @pytest.fixture
    def xr(self):
        return pytest.importorskip("xarray")

    def test_dimensions_are_found_and_kept_by_name(self, xr, robot: CompiledRobot) -> None:
        values = RANDOM.normal(size=(4, 5, 3))
        q = xr.DataArray(values, dims=("joint", "time", "run"), coords={"run": ["a", "b", "c"]})
        qd = xr.DataArray(RANDOM.normal(size=(5, 4)), dims=("time", "joint"))

        tau = robot.inverse_dynamics(q, qd, 0.0 * qd)
        mass = robot.mass_matrix(q)

        assert set(tau.dims) == {"time", "run", "joint"}
        assert tau.name == "tau"
        assert tau.coords["joint"].values.tolist() == list(robot.joint_names)
        states = values.transpose(1, 2, 0)
        expected = robot.inverse_dynamics(states, qd.values[:, None], 0.0 * qd.values[:, None])
        assert np.array_equal(tau.transpose("time", "run", "joint").values, expected)
        assert mass.dims[-2:] == ("joint", "joint_column")
        assert mass.sel(run="b", joint="J3", joint_column="J3").sizes == {"time": 5}

    def test_joints_in_another_order_are_put_in_the_robots(self, xr, robot: CompiledRobot) -> None:
        q = xr.DataArray(RANDOM.normal(size=4), dims="joint", coords={"joint": list(robot.joint_names)})
        turned = q.isel(joint=[2, 0, 3, 1])
        assert np.array_equal(robot.gravity(turned).values, robot.gravity(q.values))

    def test_other_joints_are_refused_by_name(self, xr, robot: CompiledRobot) -> None:
        q = xr.DataArray(np.zeros(4), dims="joint", coords={"joint": ["J1", "J2", "J3", "wrist"]})
        with pytest.raises(
            InputError, match="q's dimension 'joint' has the names 'J1', 'J2', 'J3', 'wrist'"
        ) as caught:
            robot.gravity(q)
        assert "the robot has no 'wrist', and 'J4' is missing" in caught.value.message
        assert caught.value.hint == "the names are J1, J2, J3, J4"

    def test_a_missing_dimension_is_named(self, xr, robot: CompiledRobot) -> None:
        with pytest.raises(
            InputError, match=r"q has dimensions \('time', 'axis'\), expected one called 'joint'"
        ):
            robot.gravity(xr.DataArray(np.zeros((5, 4)), dims=("time", "axis")))

    def test_a_dataset_is_refused(self, xr, robot: CompiledRobot) -> None:
        with pytest.raises(InputError, match="q is a Dataset, expected a DataArray"):
            robot.gravity(xr.Dataset({"q": ("joint", np.zeros(4))}))

    def test_lazy_data_stay_lazy(self, xr, robot: CompiledRobot) -> None:
        values = RANDOM.normal(size=(40, 4))
        q = xr.DataArray(da.from_array(values, chunks=(10, 4)), dims=("time", "joint"))
        found = robot.forward_kinematics(q)
        assert found.position.chunks is not None
        assert found.position.dims == ("time", "frame", "axis")
        assert found.rotation.dims == ("time", "frame", "axis", "axis_column")
        expected = robot.forward_kinematics(values).rotation
        assert np.array_equal(found.rotation.compute(scheduler="sync").values, expected)


@pytest.mark.parametrize("name", SIGNATURES)
def test_every_function_has_dimensions_that_differ(name: str) -> None:
    for quantity in (*SIGNATURES[name].inputs, *SIGNATURES[name].outputs):
        found = dimensions(quantity)
        assert len(set(found)) == len(found) == len(quantity.axes)
