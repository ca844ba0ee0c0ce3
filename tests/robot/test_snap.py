"""Rotations near one with exact zeros become that one; others stay as they are."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_robots import EXAMPLES, load_dh, load_urdf
from urdf_text import joint, link

from psdmc.robot.load import load_robot
from psdmc.robot.placement import (
    about,
    angle_between,
    roll_pitch_yaw,
    snap_axis,
    snap_rotation,
    snap_translation,
)

angles = st.floats(-3.0, 3.0)


def zeros(rotation):
    return int(np.sum(rotation == 0.0))


def assert_rotation(matrix):
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=4e-16)
    assert np.linalg.det(matrix) > 0.0


def test_a_rounded_right_angle_becomes_exact():
    snapped, angle = snap_rotation(about(0, 1.5708), 1e-5)

    assert snapped.tolist() == [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    assert angle == pytest.approx(1.5708 - np.pi / 2, rel=1e-6)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_turn_about_an_axis_keeps_its_angle_and_gets_its_zeros(axis):
    noise = about((axis + 1) % 3, 3e-6) @ about((axis + 2) % 3, -2e-6)

    snapped, angle = snap_rotation(noise @ about(axis, 0.5), 1e-5)

    assert zeros(snapped) == 4
    assert snapped[axis, axis] == 1.0
    np.testing.assert_allclose(snapped, about(axis, 0.5), atol=1e-10)
    assert angle == pytest.approx(np.hypot(3e-6, 2e-6), rel=1e-3)


@given(angles, angles, st.sampled_from([(0, 1), (1, 0), (0, 2), (2, 0), (1, 2), (2, 1)]), st.integers(0, 2))
def test_two_turns_about_two_axes_keep_their_one_zero(a, b, axes, noise_axis):
    exact = about(axes[0], a) @ about(axes[1], b)

    snapped, angle = snap_rotation(about(noise_axis, 2e-6) @ exact, 1e-5)

    assert zeros(snapped) >= 1
    assert angle <= 1e-5
    assert angle_between(snapped, exact) <= 1.3e-5
    assert_rotation(snapped)


@given(angles, angles, angles, st.sampled_from([0.0, 1e-5, 1e-2]))
def test_the_result_is_a_rotation_within_the_tolerance(roll, pitch, yaw, tolerance):
    rotation = roll_pitch_yaw((roll, pitch, yaw))

    snapped, angle = snap_rotation(rotation, tolerance)

    assert_rotation(snapped)
    assert angle_between(rotation, snapped) <= max(tolerance, 1e-14)
    assert angle == pytest.approx(angle_between(rotation, snapped), abs=1e-15)


def test_a_general_rotation_and_a_rounded_one_without_snapping_stay():
    general = roll_pitch_yaw((0.3, 0.4, 0.5))

    assert snap_rotation(general, 1e-5)[0].tolist() == general.tolist()
    assert snap_rotation(about(0, 1.5708), 0.0)[0].tolist() == about(0, 1.5708).tolist()


def test_rounding_noise_goes_even_without_snapping():
    snapped, _ = snap_rotation(about(2, np.pi / 2) @ about(0, -np.pi), 0.0)

    assert zeros(snapped) == 6


def test_axes_and_translations():
    assert snap_axis(np.array([0.0, 3e-6, -2.0]), 1e-5)[0].tolist() == [0.0, 0.0, -1.0]
    assert snap_axis(np.array([0.6, 3e-6, -0.8]), 1e-5)[0][1] == 0.0
    assert snap_axis(np.array([0.0, 3e-4, 1.0]), 1e-5)[0][1] != 0.0
    assert snap_translation(np.array([1e-17, 0.2, -1e-6]), 1.0).tolist() == [0.0, 0.2, -1e-6]


def test_the_rounded_robot_has_only_exact_rotations_and_says_so():
    loaded = load_robot(EXAMPLES / "rounded_arm.urdf")

    assert all(zeros(each.placement.rotation) == 6 for each in loaded.chain.joints)
    assert [snap.where for snap in loaded.snap_report] == [
        "joint 'shoulder'",
        "joint 'elbow'",
        "joint 'roll'",
        "joint 'pitch'",
        "joint 'tool_mount'",
    ]
    assert max(snap.angle for snap in loaded.snap_report) < 1.1e-5
    assert "joint 'shoulder': turned by 3.7e-06 rad to exact zeros" in loaded.chain.notes
    assert loaded.unsnapped().snap_report == ()
    assert zeros(loaded.unsnapped().chain.joints[1].placement.rotation) == 4


def test_angles_that_fixed_joints_add_up_to_are_snapped_after_merging():
    loaded = load_urdf(
        link("base"),
        link("plate"),
        link("arm"),
        joint("half", "base", "plate", kind="fixed", rpy="0 0 0.785398"),
        joint("other_half", "plate", "arm", rpy="0 0 0.785398", xyz="0 0 0.1"),
    )

    assert zeros(loaded.chain.joints[0].placement.rotation) == 6
    assert [snap.where for snap in loaded.snap_report] == ["joint 'other_half', merged"]


def test_rounded_fixed_joints_leave_no_stray_offsets():
    loaded = load_urdf(
        link("base"),
        link("plate"),
        link("arm"),
        joint("turn", "base", "plate", kind="fixed", rpy="1.5708 0 0", xyz="0 0 0"),
        joint("move", "plate", "arm", xyz="0 0 0.5"),
    )

    assert loaded.chain.joints[0].placement.translation.tolist() == [0.0, -0.5, 0.0]


def test_dh_right_angles_are_exact_however_they_are_written():
    rows = [
        f'name = "j{k}"\nalpha = {alpha}'
        for k, alpha in enumerate(('"-90 deg"', "1.5707963267948966", "-1.5708"))
    ]
    loaded = load_dh(*rows)

    assert all(zeros(each.link_frame.rotation) == 6 for each in loaded.chain.joints)
    assert [snap.where for snap in loaded.snap_report] == ["alpha of joint 'j2'"]
