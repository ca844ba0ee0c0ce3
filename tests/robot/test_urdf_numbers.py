"""Numbers in a URDF's attributes: what is trimmed, what is refused, and that bodies are what both readers read."""

from __future__ import annotations

import numpy as np
import pinocchio
import pytest
from installed import in_wheel
from small_robots import largest_difference, load_urdf
from urdf_text import INERTIAL, joint, link, urdf

from psdmc.errors import InputError
from psdmc.robot.load import load_robot, load_robot_text
from psdmc.robot.urdf import urdf_draft
from psdmc.robot.urdf.read_urdf import read_urdf

BASE = link("base", "")


def arm(inertial: str = INERTIAL, **options: str) -> str:
    return urdf(BASE, link("arm", inertial), joint("shoulder", "base", "arm", **options))


def parameters(text: str) -> np.ndarray:
    return load_robot_text(text, "urdf", source_name="arm.urdf").chain.parameters


def refused(text: str) -> str:
    with pytest.raises(InputError) as caught:
        load_robot_text(text, "urdf", source_name="arm.urdf")
    assert "\n" not in caught.value.message
    return caught.value.message


@pytest.mark.parametrize(
    ("plain", "spaced"),
    [
        ('value="1.5"', 'value="1.5 "'),
        ('value="1.5"', 'value=" 1.5"'),
        ('value="1.5"', 'value="&#9;1.5&#10;"'),
        ('iyy="0.03"', 'iyy="0.03 "'),
        ('xyz="0.1 -0.05 0.2"', 'xyz="0.1&#9;-0.05   0.2 "'),
        ('rpy="0.3 -0.2 0.5"', 'rpy=" 0.3&#13;-0.2 0.5"'),
    ],
)
def test_white_space_around_numbers_changes_nothing(
    plain: str, spaced: str, capfd: pytest.CaptureFixture[str]
):
    text = arm().replace(plain, spaced)
    assert text != arm()

    assert parameters(text).tobytes() == parameters(arm()).tobytes()
    assert parameters(text)[0, 0] == 1.5
    assert largest_difference(load_robot_text(text, "urdf"), snapped=False) < 1e-13
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("place", ["shoulder", "limit"])
def test_white_space_around_a_joints_numbers(place: str, capfd: pytest.CaptureFixture[str]):
    text = arm(xyz="0.1 0.2 0.3 ", axis=" 0  1 0") if place == "shoulder" else arm().replace('"40"', '"240 "')

    chain = load_robot_text(text, "urdf").chain

    assert chain.joints[0].placement.translation.tolist() == [0.1, 0.2, 0.3]
    assert chain.joints[0].limits.effort == (40.0 if place == "shoulder" else 240.0)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    "word",
    [
        "\u0661",
        "\uff19.4",
        "9.4\u00a0",
        "\u20099.4",
        "9_4",
        "0x10",
        "9,4",
        "1e",
        "nan",
        "1e400",
        "1e-400",
        "--1",
    ],
)
@pytest.mark.parametrize(
    ("plain", "named"),
    [
        ('value="1.5"', "link 'arm': <mass> value="),
        ('ixy="0.001"', "link 'arm': <inertia> ixy="),
        ('lower="-1"', "joint 'shoulder': <limit> lower="),
    ],
)
def test_other_writings_are_refused_by_name(word: str, plain: str, named: str):
    attribute = plain.partition("=")[0]

    found = refused(arm().replace(plain, f'{attribute}="{word}"'))

    assert found.startswith(f"arm.urdf: {named}{word!a}")
    assert "expected a finite number" in found


@pytest.mark.parametrize("word", ["2", "+2", "2.", "2.0e0", "200E-2", "0.2e+1", "02", "2" + "." + "0" * 60])
def test_every_writing_of_a_decimal_is_read_alike_by_both_readers(word: str):
    assert parameters(arm().replace('value="1.5"', f'value="{word}"'))[0, 0] == 2.0


@pytest.mark.parametrize("attribute", ["xyz", "rpy"])
@pytest.mark.parametrize("numbers", ["1 2", "1 2 3 4", "", "1 2 x"])
def test_triples_have_three_numbers(attribute: str, numbers: str):
    text = arm().replace('rpy="0 0 0"', f'rpy="{numbers}"' if attribute == "rpy" else 'rpy="0 0 0"')
    text = text if attribute == "rpy" else text.replace('xyz="0.1 0.2 0.3"', f'xyz="{numbers}"')

    assert f"joint 'shoulder': <origin> {attribute}='{numbers}', expected 3 finite numbers" in refused(text)


def test_a_number_of_thousands_of_digits_is_cut_off_in_the_message():
    found = refused(arm().replace('value="1.5"', f'value="{"9" * 5000}"'))

    assert "expected a finite number of at most 100 characters" in found
    assert len(found) < 250


def closed_form(inertials: list[tuple[float, np.ndarray, np.ndarray, pinocchio.SE3]]) -> np.ndarray:
    """Sum of bodies about the frame, by point sums: mass, moments, and the integral of r^2 1 - r r^T."""
    mass, moment, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
    for m, com, about_com, place in inertials:
        c = place.rotation @ com + place.translation
        mass, moment = mass + m, moment + m * c
        turned = place.rotation @ about_com @ place.rotation.T
        inertia = inertia + turned + m * (c @ c * np.eye(3) - np.outer(c, c))
    return np.array([mass, *moment, *inertia[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]])


def test_merged_bodies_are_the_sum_about_the_links_frame():
    loaded = load_urdf(
        BASE,
        *(link(name) for name in ("arm", "plate", "camera", "finger")),
        joint("shoulder", "base", "arm"),
        joint("mount", "arm", "plate", kind="fixed", xyz="0.3 0 0.1", rpy="0.2 0.4 -0.1"),
        joint("clamp", "plate", "camera", kind="fixed", xyz="0 0.1 0", rpy="0 1.1 0"),
        joint("grip", "camera", "finger", kind="prismatic", xyz="0 0 0.2", rpy="-0.7 0 0"),
        tip="arm",
        snap=0.0,
    )
    rpy = pinocchio.rpy.rpyToMatrix
    own = (1.5, np.array([0.1, -0.05, 0.2]))
    turn = rpy(0.3, -0.2, 0.5)
    about_com = (
        turn @ np.array([[0.02, 0.001, -0.002], [0.001, 0.03, 0.0015], [-0.002, 0.0015, 0.025]]) @ turn.T
    )
    plate = pinocchio.SE3(rpy(0.2, 0.4, -0.1), np.array([0.3, 0.0, 0.1]))
    camera = plate * pinocchio.SE3(rpy(0.0, 1.1, 0.0), np.array([0.0, 0.1, 0.0]))
    finger = camera * pinocchio.SE3(rpy(-0.7, 0.0, 0.0), np.array([0.0, 0.0, 0.2]))

    expected = closed_form(
        [(*own, about_com, at) for at in (pinocchio.SE3.Identity(), plate, camera, finger)]
    )

    np.testing.assert_allclose(loaded.chain.parameters[0, :10], expected, rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize("field", ["mass", "inertia"])
def test_a_body_that_pinocchio_reads_otherwise_is_an_error_that_names_the_link(field: str, monkeypatch):
    real = urdf_draft.pinocchio_model

    def misreading(*arguments, **options):
        model = real(*arguments, **options)
        for k in range(1, model.njoints):
            body = model.inertias[k].copy()
            if field == "mass":
                body.mass *= 1.0 + 1e-9
            else:
                body.inertia = body.inertia * (1.0 + 1e-9)
            model.inertias[k] = body
        return model

    monkeypatch.setattr(urdf_draft, "pinocchio_model", misreading)

    found = refused(arm())

    assert found.startswith("arm.urdf: link 'arm': psdmc and Pinocchio read the body differently: ")


def test_bodies_come_from_the_files_own_numbers(monkeypatch):
    """Not from Pinocchio: a robot whose bodies are not held against it has the same ones."""
    path = in_wheel("tiago.urdf")
    expected = load_robot(path).chain.parameters
    monkeypatch.setattr("psdmc.robot.urdf.urdf_draft.hold_against_pinocchio", lambda *arguments: None)
    monkeypatch.setattr(pinocchio, "buildModelFromXML", None)

    assert load_robot(path).chain.parameters.tobytes() == expected.tobytes()
    assert (
        read_urdf(path.read_text(encoding="utf-8"), "tiago.urdf").inertials["wrist_ft_tool_link"] is not None
    )
