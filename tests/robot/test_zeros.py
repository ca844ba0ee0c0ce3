"""What may be assumed zero, and which parameters are left."""

from __future__ import annotations

import numpy as np
import pytest
from small_robots import EXAMPLES, load_dh, load_urdf
from urdf_text import joint, link

from psdmc.errors import InputError
from psdmc.robot.inertia import COM_NAMES, column_echelon, link_span, standard_parameters
from psdmc.robot.load import load_robot
from psdmc.robot.mechanism import PARAMETER_NAMES

TWO_LINKS = (link("base"), link("arm"), link("hand"), joint("j1", "base", "arm"), joint("j2", "arm", "hand"))


def vanishing(span):
    return [name for name, row in zip(PARAMETER_NAMES, span, strict=True) if not row.any()]


def test_zeros_about_the_centre_of_mass_strike_only_what_must_vanish_about_the_frame():
    denso = load_robot(EXAMPLES / "denso_wall.toml").chain
    span = denso.parameter_span.reshape(6, 11, -1)

    assert vanishing(span[3]) == []
    assert vanishing(span[4]) == ["mx", "Ixy", "Ixz"]
    assert vanishing(span[5]) == list(PARAMETER_NAMES[:10])
    assert denso.parameter_span.shape == (66, 10 * 4 + 7 + 6)


@pytest.mark.parametrize(
    "names",
    [
        (),
        ("rx",),
        ("ry", "rz", "Ixx@com", "Iyy@com", "Ixy@com", "Ixz@com", "Iyz@com"),
        ("rx", "ry", "Izz@com", "Ixy@com", "Ixz@com", "Iyz@com"),
        ("Ixx@com", "Iyy@com", "Izz@com", "Ixy@com", "Ixz@com", "Iyz@com"),
        ("rz", "Ixx@com", "Iyy@com", "Izz@com", "Ixy@com", "Ixz@com", "Iyz@com"),
    ],
)
def test_the_span_is_what_random_bodies_with_these_zeros_span(names):
    rng = np.random.default_rng(7)
    bodies = []
    for _ in range(60):
        values = dict(zip(COM_NAMES, rng.normal(size=9), strict=True)) | dict.fromkeys(names, 0.0)
        com, inertia = [values[name] for name in COM_NAMES[:3]], [values[name] for name in COM_NAMES[3:]]
        bodies.append(standard_parameters(rng.uniform(1, 2), np.array(com), np.array(inertia)))
    sampled = np.array(bodies).T

    span = link_span((*names, "Im"))[:10]

    rank = np.linalg.matrix_rank(sampled, tol=1e-9)
    assert span.shape[1] == rank == np.linalg.matrix_rank(np.hstack([sampled, span]), tol=1e-9)


def test_a_span_is_in_reduced_column_echelon_form():
    span = link_span(("rx", "Ixx@com", "Iyy@com"))

    leads = [int(np.flatnonzero(column)[0]) for column in span.T]
    assert leads == sorted(leads)
    assert span[leads].tolist() == np.eye(len(leads)).tolist()
    assert column_echelon(span).tolist() == span.tolist()


def test_a_linear_parameter_is_struck_and_its_value_dropped():
    chain = load_urdf(*TWO_LINKS, assume_zero=("hand:mx", "j1:Ixz")).chain
    span = chain.parameter_span.reshape(2, 11, -1)

    assert vanishing(span[0]) == ["Ixz", "Im"]
    assert vanishing(span[1]) == ["mx", "Im"]
    assert chain.parameters[0, 7] == chain.parameters[1, 1] == 0.0
    assert chain.parameters[1, 2] == pytest.approx(-0.075)
    assert "link 'hand': assumed zero: mx; the file's values there are dropped" in chain.notes


def test_the_values_always_lie_in_the_span():
    chain = load_urdf(*TWO_LINKS, assume_zero=("hand:rx", "hand:Ixy@com", "arm:Ixx", "arm:mz")).chain
    x, span = chain.parameters.ravel(), chain.parameter_span

    leads = [int(np.flatnonzero(column)[0]) for column in span.T]
    np.testing.assert_allclose(span @ x[leads], x, atol=1e-15)


def test_unknown_names_are_refused_with_those_that_would_do():
    with pytest.raises(InputError) as refused:
        load_urdf(*TWO_LINKS, assume_zero=("arm:Iab", "leg:mx", "mx"))

    assert "'arm:Iab': no parameter 'Iab'" in refused.value.message
    assert "'leg:mx': no link 'leg'" in refused.value.message
    assert "'mx': no link ''" in refused.value.message
    assert "links: arm, hand" in str(refused.value.hint)


def test_a_link_without_inertia_has_no_parameters():
    chain = load_urdf(
        link("base"), link("bare", ""), link("hand"), joint("j1", "base", "bare"), joint("j2", "bare", "hand")
    ).chain

    assert not chain.parameters[0].any()
    assert vanishing(chain.parameter_span.reshape(2, 11, -1)[0]) == list(PARAMETER_NAMES)
    assert chain.massless == ("bare",)


def test_drive_inertia_is_a_parameter_only_when_asked_for():
    rows = ('name = "one"\ndrive_inertia = 0.5', 'name = "two"', 'name = "three"\ndrive_inertia = "unknown"')

    def drives(**options):
        chain = load_dh(*rows, **options).chain
        span = chain.parameter_span.reshape(3, 11, -1)[:, 10]
        return chain.parameters[:, 10].tolist(), [bool(row.any()) for row in span]

    assert drives() == (pytest.approx([0.5, 0.0, np.nan], nan_ok=True), [True, False, True])
    assert drives(drive_inertia=True) == (pytest.approx([0.5, 0.0, np.nan], nan_ok=True), [True] * 3)
    assert drives(drive_inertia=[1, 2, 3]) == ([1.0, 2.0, 3.0], [True] * 3)
    with pytest.raises(InputError, match="2 drive inertias for 3 joints"):
        load_dh(*rows, drive_inertia=[1, 2])
    with pytest.raises(InputError, match="not all finite and positive"):
        load_dh(*rows, drive_inertia=[1, 2, -3])


def test_unknown_inertia_is_nan_but_for_what_is_said_to_be_zero():
    rows = ('name = "one"', 'name = "two"\nlink = { com = [0.0, 0.2, 0.0], zero = ["rx", "Ixy@com"] }')
    chain = load_dh(*rows).chain

    assert np.isnan(chain.parameters[0, :10]).all()
    known = dict(zip(PARAMETER_NAMES, chain.parameters[1], strict=True))
    assert known["mx"] == known["Ixy"] == known["mz"] == 0.0
    assert np.isnan([known["m"], known["my"], known["Ixx"]]).all()
