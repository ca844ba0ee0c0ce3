"""Links without <inertial>: how many base parameters a robot has where they are massless, and where they are unknown.

The oracle is Pinocchio's joint-torque regressor: its rank over random states in the columns of the bodies that count.
"""

from __future__ import annotations

import re

import numpy as np
import pinocchio
import pytest
from installed import in_wheel
from urdf_text import joint, link, urdf

from psdmc.derivation.derive import derive_model
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.load import load_robot_text

GAP = 1e-9
"""Of a singular value to the largest, columns of length one: below is rounding (1e-15 times the condition, under 1e5)."""

FRAME = link("tool0", "") + joint("flange", "hand", "tool0", kind="fixed")


def three_joints(*bare: str) -> str:
    """An arm whose links `bare` have no <inertial>."""
    links = [link(name, "") if name in bare else link(name) for name in ("upper", "fore", "hand")]
    return urdf(
        link("base"),
        *links,
        joint("j1", "base", "upper"),
        joint("j2", "upper", "fore", axis="0 1 0"),
        joint("j3", "fore", "hand", axis="1 0 0"),
        FRAME,
    )


def without_inertia(text: str, *names: str) -> str:
    """A URDF whose links of these names (none: all) have no <inertial>."""
    links = "|".join(map(re.escape, names)) or "[^\"']*"
    inside = rf"(<link\s+name=[\"'](?:{links})[\"'][^>]*(?<!/)>(?:(?!</link>).)*?)<inertial.*?</inertial>"
    return re.sub(inside, r"\1", text, flags=re.DOTALL)


def derived(text: str, expand: bool = False, **options: object) -> DynamicsModel:
    found = load_robot_text(text, "urdf", source_name="arm.urdf", **options)  # type: ignore[arg-type]
    return derive_model(found.mechanism, expand=expand)


def rank(text: str, model: DynamicsModel, massless: tuple[str, ...] = (), floating: bool = False) -> int:
    """Of Pinocchio's regressor, without the columns of the bodies of these links."""
    root = (pinocchio.JointModelFreeFlyer(),) if floating else ()
    robot = pinocchio.buildModelFromXML(text, *root)
    names = ["root_joint" if floating and k == 0 else name for k, name in enumerate(model.joint_names)]
    links = [each.link_name for each in model.mechanism.joints]
    kept = [
        k
        for name, own in zip(names, links, strict=True)
        if own not in massless
        for k in [robot.getJointId(name) - 1]
    ]
    data, rng = robot.createData(), np.random.default_rng(5)
    pinocchio.seed(5)
    low, high = np.full(robot.nq, -2.0), np.full(robot.nq, 2.0)
    rows = [
        pinocchio.computeJointTorqueRegressor(
            robot,
            data,
            pinocchio.randomConfiguration(robot, low, high),
            rng.normal(size=robot.nv),
            rng.normal(size=robot.nv),
        ).reshape(robot.nv, -1, 10)[:, kept]
        for _ in range(20)
    ]
    stacked = np.concatenate(rows).reshape(len(rows) * robot.nv, -1)
    size = np.linalg.norm(stacked, axis=0)
    found = np.linalg.svd(stacked[:, size > 0] / size[size > 0], compute_uv=False)
    return int(np.sum(found > GAP * found[0]))


CASES = [("fore",), ("hand",), ("fore", "hand"), ("upper", "fore")]


@pytest.mark.parametrize("floating", [False, True])
@pytest.mark.parametrize("bare", CASES)
def test_massless_and_unknown_links_have_pinocchio_s_rank(bare: tuple[str, ...], floating: bool) -> None:
    text = three_joints(*bare)
    massless, unknown = derived(text, floating=floating), derived(text, floating=floating, unknown=bare)

    assert massless.l == rank(text, massless, bare, floating)
    assert massless.theta_b is not None
    assert massless.mechanism.massless == bare
    assert unknown.l == rank(text, unknown, (), floating)
    assert unknown.theta_b is None
    assert unknown.mechanism.massless == ()


@pytest.mark.parametrize("floating", [False, True])
def test_a_file_without_any_inertia_has_all_base_parameters_unknown(floating: bool) -> None:
    text = without_inertia(three_joints())
    model = derived(text, floating=floating)

    assert model.l == rank(text, model, (), floating)
    assert model.theta_b is None
    assert model.mechanism.massless == ()
    assert model.unknown_base_parameters == tuple(range(model.l))
    assert {parameter.value for parameter in model.base_parameters} == {None}
    assert (
        "no moving link has <inertial>, so all inertial parameters are unknown, as with --unknown all: "
        "find them with psdmc calibrate, or add <inertial>" in model.mechanism.notes
    )


def test_e_and_p_of_a_file_without_any_inertia_are_those_of_the_full_file() -> None:
    text = three_joints()
    full, bare = derived(text, expand=True), derived(without_inertia(text), expand=True)

    assert np.array_equal(bare.B, full.B)
    assert bare.E is not None
    assert full.E is not None
    assert np.array_equal(bare.E, full.E)
    for own, other in zip(bare.P or (), full.P or (), strict=True):
        assert np.array_equal(own.toarray(), other.toarray())


def test_all_missing_and_names_of_links_choose_what_is_unknown() -> None:
    text = three_joints("fore", "hand")
    every, missing = derived(text, unknown=("all",)), derived(text, unknown=("missing",))
    by_frame = derived(text, unknown=("tool0", "fore"))

    assert np.isnan(every.mechanism.parameters[:, :10]).all()
    assert np.isnan(missing.mechanism.parameters[:, :10]).all(axis=1).tolist() == [False, True, True]
    assert np.array_equal(by_frame.mechanism.parameters, missing.mechanism.parameters, equal_nan=True)
    assert every.l == missing.l == rank(text, every)


def test_what_is_known_of_a_partly_unknown_robot_is_its_known_links() -> None:
    """Entries that contain no unknown have the full file's values; the others are told apart."""
    full, model = derived(three_joints()), derived(three_joints(), unknown=("upper",))

    assert np.array_equal(model.B, full.B)
    x = np.array(full.mechanism.parameters)
    x[0] = 0.0
    assert model.file_theta_b == pytest.approx(full.B @ x.reshape(-1), rel=1e-14)
    expected = tuple(k for k in range(full.l) if full.B[k, :10].any())
    assert model.unknown_base_parameters == expected
    assert 0 < len(expected) < model.l
    for k, (own, other) in enumerate(zip(model.base_parameters, full.base_parameters, strict=True)):
        assert own.value == (None if k in expected else other.value)
    assert full.unknown_base_parameters == ()


def test_a_robot_of_example_robot_data_without_inertias_has_pinocchio_s_rank() -> None:
    text = without_inertia(in_wheel("ur5_robot.urdf").read_text())
    model = derived(text)

    assert "<inertial" not in text
    assert model.l == rank(text, model)
    assert model.theta_b is None


def test_a_quadruped_with_unknown_thighs_has_pinocchio_s_rank() -> None:
    thighs = ("FL_UPPER_LEG", "HR_UPPER_LEG")
    text = without_inertia(in_wheel("solo.urdf").read_text(), *thighs)
    massless = derived(text, floating=True)
    unknown = derived(text, floating=True, unknown=thighs)

    assert set(massless.mechanism.massless) == set(thighs)
    assert massless.l == rank(text, massless, thighs, floating=True)
    assert unknown.l == rank(text, unknown, floating=True)
