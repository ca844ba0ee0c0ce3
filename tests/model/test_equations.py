"""Base parameters in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bundled import bundled_model, bundled_robot
from random_chains import random_chain

from psdmc.derivation.derive import derive_model
from psdmc.model.equations import base_parameters, dh_lengths, standard_symbol
from psdmc.robot.mechanism import Mechanism


def equations(name: str) -> list[str]:
    return [parameter.equation for parameter in bundled_model(name).base_parameters]


def test_two_link() -> None:
    found = bundled_model("two_link_full").base_parameters
    assert [(parameter.equation, parameter.unit) for parameter in found] == [
        ("m1 + mx1/a1 - mx2/a2", "kg"),
        ("my1", "kg m"),
        ("Izz1 + a1 mx1", "kg m^2"),
        ("m2 + mx2/a2", "kg"),
        ("my2", "kg m"),
        ("Izz2 + a2 mx2", "kg m^2"),
    ]


def test_denso_has_the_published_ones() -> None:
    """Table 4 of Denso-2022: theta_1, 4, 5, 20, 27 and the drive inertias, letter for letter."""
    published = {
        "m1 + mx1/a1 - mx2/a2",
        "m2 + mx2/a2 - mx3/a3",
        "my2",
        "mz4 + my5",
        "mx4",
        "mz5",
        "Im3",
        "Im4",
        "Im5",
        "Im6",
        "Iyy5",
    }
    assert published <= set(equations("denso_wall"))


def test_lengths_appear_by_name_and_twice_a_length_too() -> None:
    text = " | ".join(equations("denso_wall"))
    assert "Iyy3 + a3 mx3 + d4^2 m4 - 2 d4 my4 + Izz4 + d4^2 m5" in text


def test_values_and_units_go_with_the_equations() -> None:
    model = bundled_model("scara")
    found = model.base_parameters
    assert [parameter.value for parameter in found] == model.theta_b.tolist()
    assert {parameter.unit for parameter in found} <= {"kg", "kg m", "kg m^2"}


def test_a_urdf_has_numbers_where_no_name_is_known() -> None:
    assert dh_lengths(bundled_model("rounded_arm").chain) == {}
    assert any("0.425 m3" in equation for equation in equations("rounded_arm"))


@pytest.mark.parametrize("kinds", ["R", "P", "RP"])
def test_unknown_values_are_none(kinds: str) -> None:
    chain = random_chain(0, kinds)
    model = derive_model(chain)
    assert all(parameter.value is not None for parameter in model.base_parameters)
    assert len(model.base_parameters) == model.l


def test_the_drive_inertia_of_a_sliding_joint_is_a_mass() -> None:
    chain = random_chain(0, "P")
    geared = type(chain)(
        chain.name,
        chain.convention,
        chain.base_name,
        chain.tip_name,
        chain.joints,
        np.full((1, 11), np.nan),
        np.eye(11)[:, 10:],
        chain.gravity,
        chain.tip,
    )
    (parameter,) = derive_model(geared).base_parameters
    assert (parameter.equation, parameter.unit, parameter.value) == ("Im1", "kg", None)


def test_standard_names() -> None:
    assert [str(standard_symbol(index)) for index in (0, 12, 15, 32)] == ["m1", "mx2", "Ixx2", "Im3"]


def test_lengths_whose_squares_are_no_doubles_have_no_name() -> None:
    """A forged model file: 1e-200 m."""
    chain = bundled_robot("two_link").chain
    short = replace(chain.joints[0].link_frame, translation=np.array([1e-200, 0.0, -0.3]))
    found = replace(chain, joints=(replace(chain.joints[0], link_frame=short), *chain.joints[1:]))
    l = 11 * len(chain)

    def first_equation(robot: Mechanism, length: float) -> str:
        B = np.eye(l)
        B[0, 1] = 1.0 / length
        return base_parameters(robot, B, range(l), [None] * l)[0].equation

    assert first_equation(chain, 1.2) == "m1 + mx1/a1"
    assert first_equation(found, 1e-200) == "m1 + 1e+200 mx1"
