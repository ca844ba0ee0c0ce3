"""Constrained forward dynamics of robots with closed loops: dense systems, a four-bar mechanism, MuJoCo, and refusals."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from loop_trees import loop_tree
from slow_cases import slow_but_for
from test_loop_error import TREES

import psdmc
from psdmc.errors import InputError
from psdmc.functions import RECIPES, SIGNATURES
from psdmc.program.signature import Sizes
from psdmc.recipes.recipe import Needs
from psdmc.robot.load import load_robot
from psdmc.robot.reference import reference

NAME = "constrained_forward_dynamics"
Array = np.ndarray

BAR = '<inertial><origin xyz="{com}"/><mass value="{mass}"/><inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/>'
LENGTHS = {"crank": 0.2, "coupler": 0.5, "rocker": 0.4}
GROUND = 0.45
"""m: bars, and the distance of the two pins on the ground."""

FOUR_BAR = (
    '<robot name="four_bar"><link name="ground"/>'
    + "".join(
        f'<link name="{name}">{BAR.format(com=f"{length / 2} 0 0", mass=2.0 * length, i=0.01 * length)}</inertial></link>'
        for name, length in LENGTHS.items()
    )
    + "".join(
        f'<joint name="{name}_pin" type="continuous"><parent link="{parent}"/><child link="{name}"/>'
        f'<origin xyz="{x} 0 0"/><axis xyz="0 -1 0"/></joint>'
        for name, parent, x in (
            ("crank", "ground", 0),
            ("coupler", "crank", 0.2),
            ("rocker", "ground", GROUND),
        )
    )
    + "</robot>"
)
"""In the plane x z; angles turn x towards z."""

PIN = {
    "name": "pin",
    "rows": ["x", "z"],
    "first": {"link": "rocker", "xyz": [0.4, 0.0, 0.0]},
    "second": {"link": "coupler", "xyz": [0.5, 0.0, 0.0]},
}


def four_bar(tmp_path: Path, **changes: object) -> psdmc.DynamicsModel:
    path = tmp_path / "four_bar.urdf"
    path.write_text(FOUR_BAR, encoding="utf-8")
    return psdmc.derive(path, loops=[PIN | changes], expand=False)


def assembled(crank: float) -> Array:
    """Crank, coupler (relative) and rocker by the law of cosines; the coupler is above the line of its ends' pins."""
    a, b, c = LENGTHS.values()
    x, z = GROUND - a * math.cos(crank), -a * math.sin(crank)
    d, line = math.hypot(x, z), math.atan2(z, x)
    coupler = line + math.acos((b * b + d * d - c * c) / (2 * b * d))
    rocker = math.atan2(
        a * math.sin(crank) + b * math.sin(coupler), a * math.cos(crank) + b * math.cos(coupler) - GROUND
    )
    return np.array([crank, coupler - crank, rocker])


def rates(q: Array, rate: float) -> Array:
    """Freudenstein's relations: rates of all bars from that of the crank."""
    a, b, c = LENGTHS.values()
    t2, t3, t4 = q[0], q[0] + q[1], q[2]
    coupler = a * math.sin(t2 - t4) / (b * math.sin(t4 - t3)) * rate
    rocker = a * math.sin(t2 - t3) / (c * math.sin(t4 - t3)) * rate
    return np.array([rate, coupler - rate, rocker])


DERIVATIVES = (
    *(f"{name}_{kind}" for name in (NAME, "impulse") for kind in ("derivatives", "vjp", "jvp")),
    "constrained_semi_implicit_euler_derivatives",
)
VALUES = (
    NAME,
    "impulse",
    "passive_motion",
    "loop_inverse_dynamics",
    "constrained_semi_implicit_euler",
    "delassus",
    "contact_space_inertia",
    "contact_inverse_dynamics",
    "constrained_rk4_step",
)


QUICK = (NAME, f"{NAME}_derivatives", f"{NAME}_vjp", "impulse", "passive_motion", "loop_inverse_dynamics")


@pytest.mark.parametrize(
    ("seed", "floating", "name"),
    slow_but_for(
        [(0, True, name) for name in QUICK],
        [(*tree.values, name) for tree in TREES for name in (*VALUES, *DERIVATIVES)],
        spread=True,
    ),
)
def test_trees_with_loops_have_the_dense_systems_solution(seed: int, floating: bool, name: str) -> None:
    """From Pinocchio's numbers of both frames, with the contact on and off, and mu = 0 or more. A stage of a step can be
    where rows of a loop nearly depend on each other. The dense solution loses digits with its condition number."""
    own = loop_tree(seed, floating)
    if RECIPES[name].needs is Needs.PASSIVE and not own.model.mechanism.passive_rates:
        with pytest.raises(InputError, match="passive"):
            getattr(own.robot, name)
        return
    bound = 1e-8 if name in (*DERIVATIVES, VALUES[-1]) else 1e-10
    far = own.far if name in DERIVATIVES else slice(None)
    bounds = (bound + np.finfo(float).eps * own.conditions)[far]
    for mu in (0.0, 0.3):
        other = {"mu": np.full(len(own.given["q"]), mu)}
        expected = own.expected(name, **other)
        for found in own.found(name, **other):
            for value, array in zip(found, expected.values(), strict=True):
                errors = np.abs(value - array)[far].reshape(len(bounds), -1).max(axis=1)
                assert (errors <= bounds * np.abs(array).max()).all()


@pytest.mark.parametrize(
    ("name", "rate"), slow_but_for([(NAME, "qd")], [(NAME, "qd"), ("impulse", "qd_before")], spread=True)
)
def test_derivatives_are_differences_of_the_dense_systems_solutions(name: str, rate: str) -> None:
    """Central differences of sixth order, with gains, of Pinocchio's numbers alone."""
    own, step = loop_tree(0, True), 2e-3
    found = dict(
        zip(
            (output.name for output in SIGNATURES[f"{name}_derivatives"].outputs),
            own.found(f"{name}_derivatives")[0],
            strict=True,
        )
    )
    q, rates, theirs = own.given["q"], own.given[rate], reference(own.loaded, snapped=False)
    outputs = [output.name for output in SIGNATURES[name].outputs]
    for by in ("q", rate):
        columns = []
        for way in step * np.eye(own.model.nv):

            def moved(k: int, way: Array = way, by: str = by) -> Array:
                there = theirs.integrated(q, k * way) if by == "q" else rates + k * way
                return np.concatenate(list(own.expected(name, **{by: there}).values()), axis=1)

            near = (w * (moved(k) - moved(-k)) for k, w in enumerate((3 / 4, -3 / 20, 1 / 60), start=1))
            columns.append(sum(near) / step)
        expected = np.split(np.stack(columns, axis=-1), [own.model.nv], axis=1)
        for output, array in zip(outputs, expected, strict=True):
            values = found[f"d{output}_d{by}"]
            assert np.abs(values - array)[own.far].max() < 1e-8 * np.abs(array[own.far]).max()


def test_an_impact_stops_loops_and_contacts_rebound() -> None:
    """Loops hold still, whatever they did before; if they held before, an elastic impact keeps the energy."""
    own = loop_tree(0, True)
    model, q, qd = own.model, own.given["q"], own.given["qd"]
    before = model.impulse(q, qd, [0.0]).qd_after
    after = own.robot.impulse(q, before, [1.0], 1.0)
    scale = np.abs(qd).max()
    for rates in (before, after.qd_after):
        assert np.abs(np.einsum("kij,kj->ki", model.loop_jacobian(q), rates)).max() < 1e-10 * scale
    sums = np.einsum("kij,kj->ki", model.contact_jacobian(q), after.qd_after + before)
    assert np.abs(sums).max() < 1e-10 * scale
    assert np.abs(after.qd_after - before).max() > 0.1
    energies = [model.kinetic_energy(q, rates) for rates in (before, after.qd_after)]
    np.testing.assert_allclose(*energies, rtol=1e-10)


def test_a_loop_that_closes_leaves_a_four_bar_the_rate_of_its_one_coordinate(tmp_path: Path) -> None:
    """The momentum along the closed form's motion stays."""
    model, before = four_bar(tmp_path), np.array([1.0, -2.0, 0.5])
    for crank in (-2.0, 0.4, 1.5):
        q = assembled(crank)
        way, mass = rates(q, 1.0), model.mass_matrix(q)
        found = model.impulse(q, before, np.zeros(len(model.contacts)))
        expected = way * (way @ mass @ before) / (way @ mass @ way)
        np.testing.assert_allclose(found.qd_after, expected, atol=1e-12)
        assert found.impulses.shape == (sum(model.contacts.values()) + 2,)


def test_forces_on_a_four_bar_move_its_one_coordinate(tmp_path: Path) -> None:
    """The rows of the loop are eliminated from the Delassus matrix and from the contact-space inertia."""
    model = four_bar(tmp_path)
    cut, count = sum(model.contacts.values()), len(model.contacts)
    for crank in (-2.0, 0.4, 1.5):
        q = assembled(crank)
        way = rates(q, 1.0)
        along = model.contact_jacobian(q) @ way
        expected = np.outer(along, along) / (way @ model.mass_matrix(q) @ way)
        seen = model.delassus(q)
        assert seen.shape == (cut + 2, cut + 2)
        found = seen[:cut, :cut] - seen[:cut, cut:] @ np.linalg.solve(seen[cut:, cut:], seen[cut:, :cut])
        np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(seen).max())
        inertia = model.contact_space_inertia(q, np.ones(count), 0.1)[:cut, :cut]
        shifted = seen[cut:, cut:] + 0.1 * np.eye(2)
        found = seen[:cut, :cut] - seen[:cut, cut:] @ np.linalg.solve(shifted, seen[cut:, :cut])
        np.testing.assert_allclose(inertia @ (found + 0.1 * np.eye(cut)), np.eye(cut), atol=1e-11)


def test_rates_of_a_four_bar_are_in_closed_form(tmp_path: Path) -> None:
    model = four_bar(tmp_path)
    assert model.loops == {"pin": ("x", "z")}
    for crank in np.linspace(-3.0, 3.0, 13):
        q = assembled(crank)
        assert np.abs(model.loop_error(q)).max() < 1e-14
        assert np.abs(model.loop_jacobian(q) @ rates(q, 2.0)).max() < 1e-13


def test_a_four_bar_moves_with_one_coordinate(tmp_path: Path) -> None:
    """Its equation of motion by the crank's angle alone: energies along the closed form, differentiated."""
    model, step = four_bar(tmp_path), 1e-4
    active = np.zeros(len(model.contacts))

    def inertia(crank: float) -> float:
        along = rates(assembled(crank), 1.0)
        return float(along @ model.mass_matrix(assembled(crank)) @ along)

    def slope(function: object, crank: float) -> float:
        near, far = (function(crank + k * step) - function(crank - k * step) for k in (1, 2))
        return (8 * near - far) / (12 * step)

    for crank, rate, torque in ((0.4, 3.0, 0.0), (2.0, -1.5, 0.7), (-1.0, 0.0, -0.3)):
        q = assembled(crank)
        pull = slope(lambda angle: float(model.potential_energy(assembled(angle))), crank)
        expected = (torque - pull - 0.5 * slope(inertia, crank) * rate**2) / inertia(crank)
        qdd, forces = model.constrained_forward_dynamics(q, rates(q, rate), [torque, 0.0, 0.0], active)
        assert abs(qdd[0] - expected) < 1e-8 * max(1.0, abs(expected))
        assert forces.shape == (sum(model.contacts.values()) + 2,)


def test_the_energy_of_a_swinging_four_bar_stays(tmp_path: Path) -> None:
    """RK4 for 2 s. Halving the step lowers the drift by at least eight; Baumgarte's gains pull an open loop closed."""
    model = four_bar(tmp_path)
    robot = psdmc.compile(model, functions=[NAME])
    still, active = np.zeros(3), np.zeros(len(model.contacts))

    def moved(step: float, q: Array, qd: Array, **gains: float) -> tuple[Array, Array]:
        def slope(q: Array, qd: Array) -> tuple[Array, Array]:
            return qd, robot.constrained_forward_dynamics(q, qd, still, active, **gains).qdd

        for _ in range(round(2.0 / step)):
            k1 = slope(q, qd)
            k2 = slope(q + step / 2 * k1[0], qd + step / 2 * k1[1])
            k3 = slope(q + step / 2 * k2[0], qd + step / 2 * k2[1])
            k4 = slope(q + step * k3[0], qd + step * k3[1])
            q, qd = (
                x + step / 6 * (a + 2 * b + 2 * c + d)
                for x, a, b, c, d in zip((q, qd), k1, k2, k3, k4, strict=True)
            )
        return q, qd

    def energy(q: Array, qd: Array) -> float:
        return float(model.kinetic_energy(q, qd) + model.potential_energy(q))

    first = assembled(0.3), rates(assembled(0.3), 1.0)
    drifts = [abs(energy(*moved(step, *first)) - energy(*first)) for step in (4e-3, 2e-3)]
    assert drifts[1] < min(1e-6 * 9.81, drifts[0] / 8.0)
    opened = first[0] + [0.0, 0.01, 0.0]
    assert np.abs(model.loop_error(opened)).max() > 1e-3
    q, _ = moved(2e-3, opened, first[1], kp=400.0, kd=40.0)
    assert np.abs(model.loop_error(q)).max() < 1e-9


def test_mujoco_has_these_accelerations(tmp_path: Path) -> None:
    """Its equality constraint is soft, with the least softness that it takes."""
    model = four_bar(tmp_path)
    spec = mujoco.MjSpec.from_string(
        FOUR_BAR.replace(
            '<link name="ground"/>', '<mujoco><compiler fusestatic="false"/></mujoco><link name="ground"/>'
        )
    )
    spec.compiler.fusestatic = False
    joined = spec.add_equality(name="pin", type=mujoco.mjtEq.mjEQ_CONNECT, objtype=mujoco.mjtObj.mjOBJ_BODY)
    joined.name1, joined.name2 = "rocker", "coupler"
    joined.data[:3] = [0.4, 0.0, 0.0]
    joined.solref, joined.solimp = [-1e-3, -1e-3], [0.99999, 0.99999, 1e-3, 0.5, 2.0]
    spec.option.cone, spec.option.disableflags = (
        mujoco.mjtCone.mjCONE_ELLIPTIC,
        mujoco.mjtDisableBit.mjDSBL_CONTACT,
    )
    spec.option.tolerance, spec.option.iterations = 0.0, 200
    theirs = spec.compile()
    data = mujoco.MjData(theirs)
    names = [theirs.joint(k).name.removesuffix("_pin") for k in range(3)]
    order = [("crank", "coupler", "rocker").index(name) for name in names]
    for crank, rate in ((0.4, 0.0), (2.0, 1.0)):
        q = assembled(crank)
        # MuJoCo takes the second anchor at the zero position: the coupler's end is at 0.5 along it wherever that is.
        theirs.eq_data[0, 3:6] = [0.5, 0.0, 0.0]
        data.qpos[:], data.qvel[:] = q[order], rates(q, rate)[order]
        mujoco.mj_forward(theirs, data)
        found = model.constrained_forward_dynamics(
            q, rates(q, rate), np.zeros(3), np.zeros(len(model.contacts))
        )
        assert np.abs(found.qdd[order] - data.qacc).max() < 1e-3 * np.abs(data.qacc).max()


@pytest.mark.parametrize(
    ("rows", "lost", "kept"),
    [
        (3, "y of loop 'pin'", 'rows = ["x", "z"] in loop \'pin\''),
        (["x", "z", "rx", "rz"], "rx, rz of loop 'pin'", 'rows = ["x", "z"] in loop \'pin\''),
    ],
)
def test_redundant_rows_are_named(tmp_path: Path, rows: object, lost: str, kept: str) -> None:
    with pytest.raises(InputError, match=f"redundant rows: {lost}: ") as error:
        four_bar(tmp_path, rows=rows)
    assert kept in str(error.value.hint)


def test_a_load_estimator_knows_no_loops(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="it knows no forces of closed loops"):
        psdmc.emit_c(four_bar(tmp_path), tmp_path / "package", functions="gravity", estimator="mass")
    assert not (tmp_path / "package").exists()


def test_more_loops_than_rates_are_refused_at_once(tmp_path: Path) -> None:
    path = tmp_path / "four_bar.urdf"
    path.write_text(FOUR_BAR, encoding="utf-8")
    loops = [PIN | {"name": f"pin{k}", "rows": ["x"]} for k in range(2000)]
    with pytest.raises(InputError, match="2000 loops close a robot with 3 joint rates"):
        psdmc.derive(path, loops=loops, expand=False)


def test_what_cannot_be_assembled_or_holds_no_angle_is_refused(tmp_path: Path) -> None:
    far = {"link": "rocker", "xyz": [4.0, 0.0, 0.0]}
    with pytest.raises(
        InputError, match="loop 'pin' cannot be assembled: in 256 tries, the smallest gap along x"
    ):
        four_bar(tmp_path, first=far)
    with pytest.raises(InputError, match="cannot be assembled") as weld:
        four_bar(tmp_path, rows=6)
    assert weld.value.hint == (
        "correct the frames of the loop, or close fewer rows: without y, rx, rz, which joints prevent already; its rows rx, "
        "ry and rz weld the frames, and a pin leaves out the one about its axis"
    )
    with pytest.raises(InputError, match=r"rows: found \['x', 'x'\], which names a row twice"):
        four_bar(tmp_path, rows=["x", "x"])
    with pytest.raises(InputError, match="both frames are on one body"):
        four_bar(tmp_path, first="coupler")
    with pytest.raises(InputError, match=r"loop 'pin': rows: found \['up'\], expected 3"):
        four_bar(tmp_path, rows=["up"])
    with pytest.raises(InputError, match="frame 'nowhere' is no link"):
        four_bar(tmp_path, first="nowhere")
    with pytest.raises(InputError, match="second is missing"):
        psdmc.derive(tmp_path / "four_bar.urdf", loops=[{"rows": 3, "first": "rocker"}])


def test_faults_name_the_file_of_the_loops_and_the_key(tmp_path: Path) -> None:
    four_bar(tmp_path)
    path = tmp_path / "loops.toml"
    for first, said in (
        ('"rocker"', "loop 'loop1': rows: found 7"),
        ('"no"', "loop 'loop1': first: four_bar.urdf: frame 'no'"),
    ):
        path.write_text(f'[[loop]]\nrows = 7\nfirst = {first}\nsecond = "coupler"\n', encoding="utf-8")
        with pytest.raises(InputError, match="^" + re.escape(f"loops.toml: {said}")):
            psdmc.derive(tmp_path / "four_bar.urdf", loops=path, expand=False)
    for wrong in (math.nan, object(), np.array([np.nan, 0.0, 0.0])):
        with pytest.raises(InputError, match=r"^loops: table 1: first is "):
            four_bar(tmp_path, first={"link": "rocker", "xyz": wrong})


def test_loops_can_have_numbers_of_numpy(tmp_path: Path) -> None:
    place = {"link": "rocker", "xyz": np.array([0.4, 0.0, 0.0])}
    model = four_bar(tmp_path, first=place, rows=np.array(["x", "z"]))
    assert model.content_hash == four_bar(tmp_path).content_hash


def test_a_dead_point_names_the_loop(tmp_path: Path) -> None:
    """Crank, coupler and rocker in one line hold the same motion twice."""
    path = tmp_path / "flat.urdf"
    path.write_text(FOUR_BAR.replace(f'xyz="{GROUND} 0 0"', 'xyz="0.3 0 0"'), encoding="utf-8")
    model = psdmc.derive(path, loops=[PIN], expand=False)
    state = (np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(len(model.contacts)))
    with pytest.raises(InputError, match=f"{NAME}: loop 'pin': J M"):
        model.constrained_forward_dynamics(*state)
    robot = psdmc.compile(model, functions=[NAME, "constrained_rk4_step"])
    with pytest.raises(InputError, match=f"{NAME}: loop 'pin': J M"):
        robot.constrained_forward_dynamics(*state)
    for each in (model, robot):
        with pytest.raises(InputError, match="constrained_rk4_step: loop 'pin': J M"):
            each.constrained_rk4_step(*state[:3], 0.01, state[3])
    assert np.isfinite(model.constrained_forward_dynamics(*state, mu=1e-6).qdd).all()


@pytest.mark.parametrize("away", [1e-9, 1e-5])
def test_near_a_dead_point_lost_digits_are_not_returned(tmp_path: Path, away: float) -> None:
    """The bars are in one line but for this angle, and the pin's force along the line grows as 1 / angle. It is refused
    where rounding decides it; at 1e-5 rad the dense system has it, with the digits that its condition number leaves."""
    path = tmp_path / "flat.urdf"
    path.write_text(FOUR_BAR.replace(f'xyz="{GROUND} 0 0"', 'xyz="0.3 0 0"'), encoding="utf-8")
    model = psdmc.derive(path, loops=[PIN], expand=False)
    state = (away * np.array([1.0, 1.0, -2.0]), np.zeros(3), np.zeros(3), np.zeros(len(model.contacts)))
    for robot in (model, psdmc.compile(model, functions=[NAME])):
        if away < 1e-7:
            with pytest.raises(InputError, match=f"{NAME}: loop 'pin': J M"):
                robot.constrained_forward_dynamics(*state)
            continue
        own = reference(load_robot(path, loops=[PIN]))
        sizes = Sizes(3, 3, 3, 0, 1, 0, model.mechanism.rows_of_contacts, model.mechanism.rows_of_loops)
        given = {q.name: np.zeros((1, *sizes.shape(q.axes))) for q in SIGNATURES[NAME].inputs}
        expected = RECIPES[NAME].pinocchio(own, given | {"q": state[0][None]})
        found = robot.constrained_forward_dynamics(*state)
        assert np.abs(found.qdd - expected["qdd"]).max() < 1e-5
        assert np.abs(found.forces - expected["forces"]).max() < 1e-5 * np.abs(found.forces).max()


def test_functions_without_loops_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model = four_bar(tmp_path)
    with monkeypatch.context() as patch:
        patch.setitem(RECIPES, "delassus", replace(RECIPES["delassus"], closes=False))
        with pytest.raises(InputError, match="no delassus: for robots with closed loops"):
            model.delassus(np.zeros(3))
    plain = psdmc.derive("examples/robots/scara.toml", expand=False)
    assert plain.loops == {}
    with pytest.raises(InputError, match="no loop_error: the robot has no closed loops"):
        psdmc.compile(plain, functions=["loop_error"])
    with pytest.raises(InputError, match="no loop_error: the robot has no closed loops"):
        plain.loop_error(np.zeros(4))


def test_a_saved_model_has_its_loops(tmp_path: Path) -> None:
    model = four_bar(tmp_path)
    model.save(tmp_path / "four_bar.npz")
    again = psdmc.load(tmp_path / "four_bar.npz")
    q = assembled(1.0)
    assert again.loops == model.loops
    assert again.content_hash == model.content_hash
    assert again.mechanism.passive_rates == model.mechanism.passive_rates == (1, 2)
    assert np.array_equal(again.loop_jacobian(q), model.loop_jacobian(q))


def test_a_urdf_is_not_written_without_its_parallelogram(tmp_path: Path) -> None:
    """Its joints follow one joint each, as mimic joints do, but the URDF has no <mimic>."""
    path = tmp_path / "parallelogram.urdf"
    path.write_text(FOUR_BAR.replace(str(GROUND), str(LENGTHS["coupler"])), encoding="utf-8")
    loop = PIN | {"first": {"link": "rocker", "xyz": [LENGTHS["crank"], 0.0, 0.0]}}
    model = psdmc.derive(path, loops=[loop], expand=False)
    assert model.mechanism.has_mimic_joints
    assert not model.mechanism.has_sums
    with pytest.raises(InputError, match="joint 'coupler_pin' follows another by a closed loop"):
        psdmc.export_urdf(model, tmp_path / "written.urdf")


def test_a_mimic_joint_cannot_be_passive(tmp_path: Path) -> None:
    fan = (
        '<link name="fan"/><joint name="fan_pin" type="continuous"><parent link="ground"/><child link="fan"/>'
        '<axis xyz="0 0 1"/><mimic joint="crank_pin"/></joint></robot>'
    )
    path = tmp_path / "fan.urdf"
    path.write_text(FOUR_BAR.replace("</robot>", fan), encoding="utf-8")
    for names in (["fan_pin"], ["fan_pin", "coupler_pin", "rocker_pin"]):
        with pytest.raises(InputError, match="joint 'fan_pin' follows others and cannot be passive"):
            psdmc.derive(path, loops=[PIN | {"passive": names}], expand=False)
