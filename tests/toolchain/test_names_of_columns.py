"""Data frames, masked arrays and labelled arrays: columns by their names, in compiled robots and in models."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from bundled import bundled_model
from unoptimised import without_optimisation
from urdf_text import BALL, joint, link, urdf

import psdmc
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import states_of
from psdmc.robot.load import load_robot_text

pd = pytest.importorskip("pandas")

RANDOM = np.random.default_rng(5)
JOINTS = ["J1", "J2", "J3", "J4"]
TURNED = ["J3", "J1", "J4", "J2"]

LEG = joint("leg", "hull", "foot", kind="prismatic", xyz="0 0 0")
HOPPER = urdf(link("hull", BALL), link("foot", BALL), LEG, name="hopper")
OF_Q = [f"root_joint.{name}" for name in ("x", "y", "z", "qx", "qy", "qz", "qw")] + ["leg"]
OF_V = [f"root_joint.{name}" for name in ("vx", "vy", "vz", "wx", "wy", "wz")] + ["leg"]


@cache
def scara() -> tuple[DynamicsModel, object]:
    model = bundled_model("scara")
    with without_optimisation():
        return model, psdmc.compile(model, functions=["inverse_dynamics", "gravity", "semi_implicit_euler"])


@cache
def hopper() -> tuple[DynamicsModel, object]:
    model = derive_model(load_robot_text(HOPPER, "urdf", source_name="hopper.urdf", floating=True).mechanism)
    with without_optimisation():
        return model, psdmc.compile(model, functions=["inverse_dynamics", "forward_kinematics"])


@pytest.fixture(params=[0, 1], ids=["model", "compiled"])
def robot(request: pytest.FixtureRequest):
    return scara()[request.param]


@pytest.fixture(params=[0, 1], ids=["model", "compiled"])
def floating(request: pytest.FixtureRequest):
    return hopper()[request.param]


def test_columns_are_found_by_name(robot) -> None:
    q, qd, qdd = RANDOM.normal(size=(3, 5, 4))
    given = (pd.DataFrame(values, columns=JOINTS)[TURNED] for values in (q, qd, qdd))
    np.testing.assert_array_equal(robot.inverse_dynamics(*given), robot.inverse_dynamics(q, qd, qdd))


def test_a_series_is_one_state_by_its_index(robot) -> None:
    q = RANDOM.normal(size=4)
    series = pd.Series(q, index=JOINTS)
    np.testing.assert_array_equal(robot.gravity(series[TURNED]), robot.gravity(q))
    rows = pd.DataFrame([q, 2 * q], columns=JOINTS)[TURNED]
    np.testing.assert_array_equal(robot.gravity(rows.iloc[1]), robot.gravity(2 * q))


@pytest.mark.parametrize("columns", [None, range(4), range(3, 7), [0, 1, 2, 3], [1, 2, 5, 9]], ids=str)
def test_arrays_lists_and_numbered_columns_go_by_position(robot, columns) -> None:
    q = RANDOM.normal(size=(5, 4))
    expected = robot.gravity(q)
    for given in (q.tolist(), pd.DataFrame(q, columns=columns)):
        np.testing.assert_array_equal(robot.gravity(given), expected)
    np.testing.assert_array_equal(robot.gravity(pd.Series(q[0], index=columns)), expected[0])


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (
            ["J1", "J2", "J3", "wrist"],
            "q has columns 'J1', 'J2', 'J3', 'wrist': the robot has no 'wrist', and 'J4' is missing",
        ),
        (["J1", "J2", "J3"], "q has columns 'J1', 'J2', 'J3': 'J4' is missing"),
        (["time", *JOINTS], "the robot has no 'time'"),
        (["J1", "J1", "J2", "J3"], "'J4' is missing"),
        ([*JOINTS, "J4"], "a name is there twice"),
        ([3, 2, 1, 0], "q has columns 3, 2, 1, 0: the robot has no 3, 2, 1, 0"),
    ],
)
def test_other_names_are_refused_by_name(robot, columns: list, message: str) -> None:
    with pytest.raises(InputError, match=f"gravity: {message}" if message[0] == "q" else message) as caught:
        robot.gravity(pd.DataFrame(np.zeros((5, len(columns))), columns=columns))
    assert caught.value.hint == "the names are J1, J2, J3, J4"
    if len(columns) == 4:
        with pytest.raises(InputError, match="gravity: q has index"):
            robot.gravity(pd.Series(np.zeros(4), index=columns))


def test_a_number_per_state_has_no_names(robot) -> None:
    """The index of dt is time."""
    q, qd, tau = RANDOM.normal(size=(3, 2, 4))
    dt = pd.Series([0.01, 0.02], index=["monday", "tuesday"])
    for one, other in zip(
        robot.semi_implicit_euler(q, qd, tau, dt),
        robot.semi_implicit_euler(q, qd, tau, [0.01, 0.02]),
        strict=True,
    ):
        np.testing.assert_array_equal(one, other)


def test_theta_b_has_numbers_and_no_names(robot) -> None:
    q, theta = RANDOM.normal(size=4), pd.Series(np.asarray(robot.theta_b))
    np.testing.assert_array_equal(robot.gravity(q, theta_b=theta), robot.gravity(q))
    for wrong in (theta[::-1], theta.rename(str)):
        with pytest.raises(InputError, match="gravity: theta_b has index"):
            robot.gravity(q, theta_b=wrong)


def test_a_floating_base_has_names_for_every_coordinate(floating) -> None:
    model = hopper()[0]
    assert list(floating.q_names) == OF_Q
    assert list(floating.v_names) == OF_V
    q, qd, qdd = states_of(model.mechanism, np.random.default_rng(3), 6)
    table = pd.DataFrame(q, columns=OF_Q)[sorted(OF_Q)]
    rates = (pd.DataFrame(v, columns=OF_V)[sorted(OF_V)] for v in (qd, qdd))
    np.testing.assert_array_equal(
        floating.inverse_dynamics(table, *rates), floating.inverse_dynamics(q, qd, qdd)
    )
    with pytest.raises(InputError, match=r"the robot has no 'root_joint\.x', .* and 'root_joint\.vx'"):
        floating.inverse_dynamics(q, pd.DataFrame(q, columns=OF_Q), qdd)


def test_masked_entries_are_refused_with_the_remedy(robot) -> None:
    q = np.ma.masked_greater(np.array([0.1, 0.2, 9.0, 9.0]), 1.0)
    with pytest.raises(InputError, match="gravity: q is a masked array with 2 masked entries") as caught:
        robot.gravity(q)
    assert caught.value.hint == "leave these states out, or fill them with numbers, as .filled(0.0) does"
    np.testing.assert_array_equal(robot.gravity(np.ma.array(q.data)), robot.gravity(q.data))
    with pytest.raises(InputError, match="theta_b is a masked array with 1 masked entry"):
        robot.gravity(q.data, theta_b=np.ma.masked_equal(robot.theta_b, robot.theta_b[0]))


def test_torques_for_matches_names_too() -> None:
    model, q = scara()[0], RANDOM.normal(size=(5, 4))
    table = pd.DataFrame(q, columns=JOINTS)[TURNED]
    found = model.torques_for(model.theta_b, table, table, table)
    np.testing.assert_array_equal(found, model.inverse_dynamics(q, q, q))


class TestXarray:
    @pytest.fixture
    def xr(self):
        return pytest.importorskip("xarray")

    def test_a_models_functions_take_named_dimensions(self, xr) -> None:
        model, compiled = scara()
        values = RANDOM.normal(size=(4, 5))
        q = xr.DataArray(values, dims=("joint", "time"), coords={"joint": JOINTS}).isel(joint=[2, 0, 3, 1])
        found = model.inverse_dynamics(q, 0 * q, 0 * q, theta_b=2 * model.theta_b)
        assert found.dims == ("time", "joint")
        expected = compiled.inverse_dynamics(q, 0 * q, 0 * q, theta_b=2 * model.theta_b)
        np.testing.assert_allclose(
            found.sel(joint=JOINTS), expected.sel(joint=JOINTS), rtol=1e-12, atol=1e-12
        )

    def test_a_floating_bases_q_and_rates_differ_in_length(self, xr, floating) -> None:
        q, qd, qdd = states_of(hopper()[0].mechanism, np.random.default_rng(3), 6)
        table = xr.DataArray(q, dims=("time", "joint"), coords={"joint": OF_Q}).isel(
            joint=slice(None, None, -1)
        )
        rates = xr.DataArray(qd, dims=("time", "joint"), coords={"joint": OF_V})
        found = floating.inverse_dynamics(table, rates, xr.DataArray(qdd, dims=("time", "joint")))
        assert found.joint.values.tolist() == OF_V
        np.testing.assert_array_equal(found.values, floating.inverse_dynamics(q, qd, qdd))
        assert floating.forward_kinematics(table).position.frame.values.tolist() == list(floating.frame_names)

    def test_errors_name_the_dimension(self, xr, robot) -> None:
        q = xr.DataArray(np.zeros((5, 4)), dims=("time", "joint"))
        with pytest.raises(InputError, match="gravity: q has 3 entries along dimension 'joint', expected 4"):
            robot.gravity(q[:, :3])
        with pytest.raises(InputError, match="dimension 'time' has 5 entries in q and 4 in qd"):
            robot.inverse_dynamics(q, q[:4], q)
        moved = q.assign_coords(time=range(5)), q.assign_coords(time=range(1, 6))
        with pytest.raises(
            InputError, match="dimension 'time' has other coordinates in qd than in q"
        ) as caught:
            robot.inverse_dynamics(*moved, q)
        assert "xr.align(q, qd, join='inner')" in caught.value.hint

    def test_what_reads_no_dimensions_refuses_them(self, xr) -> None:
        model, q = scara()[0], xr.DataArray(np.zeros((4, 4)), dims=("joint", "time"))
        with pytest.raises(InputError, match="q is a DataArray, whose dimensions are not read here"):
            model.torques_for(model.theta_b, q, q, q)

    def test_data_frames_beside_them_are_matched_too(self, xr, robot) -> None:
        q, qd = RANDOM.normal(size=(2, 4))
        named = xr.DataArray(q, dims="joint")
        found = robot.inverse_dynamics(named, pd.Series(qd, index=JOINTS)[TURNED], 0 * named)
        np.testing.assert_array_equal(found.values, robot.inverse_dynamics(q, qd, 0 * q))


class TestDask:
    @pytest.fixture
    def da(self):
        return pytest.importorskip("dask.array")

    def test_a_models_functions_are_lazy(self, da) -> None:
        model, q = scara()[0], RANDOM.normal(size=(6, 4))
        found = model.gravity(da.from_array(q, chunks=(2, 4)))
        assert found.chunks == ((2, 2, 2), (4,))
        np.testing.assert_array_equal(found.compute(scheduler="sync"), model.gravity(q))

    def test_errors_name_the_dimension(self, da, robot) -> None:
        q = da.zeros((8, 4), chunks=2)
        with pytest.raises(InputError, match=r"its axis 1, dimension 'joint', has 3 entries"):
            robot.gravity(q[:, :3])
        with pytest.raises(InputError, match=r"q has shape \(\), expected the dimensions 'joint' last"):
            robot.gravity(da.zeros(()))
        with pytest.raises(InputError, match="q has 8 states along its axis 0, qd has 6 along its axis 0"):
            robot.inverse_dynamics(q, q[:6], q)

    def test_data_frames_of_dasks_are_refused(self, da, robot) -> None:
        dd = pytest.importorskip("dask.dataframe")
        table = dd.from_pandas(pd.DataFrame(np.zeros((8, 4)), columns=TURNED), npartitions=2)
        with pytest.raises(InputError, match="q is a DataFrame of Dask's, expected an array") as caught:
            robot.gravity(table)
        assert "to_dask_array" in caught.value.hint
