"""check: passes what is right and notices what is not; and what show is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bundled import bundled_model, bundled_robot
from random_chains import random_chain

from psdmc.cli.show import model_json
from psdmc.derivation.derive import derive_model, provenance_of
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.expansion import Expansion
from psdmc.model.summary import term_texts
from psdmc.robot.load import load_robot_text
from psdmc.verification.check import check_model


@pytest.mark.parametrize("name", ["two_link", "scara", "denso_floor", "kr6", "rounded_arm"])
def test_bundled_models_pass(name: str) -> None:
    rows = check_model(bundled_model(name))
    assert {row.against for row in rows} >= {"rnea", "crba", "nonLinearEffects", "aba"}
    assert all(row.passed for row in rows), rows


UPRIGHT = """
[[joint]]
a = 0.4
alpha = "180 deg"
[joint.link]
mass = 2.0
com = [-0.15, 0.02, 0.1]
inertia_com = { xx = 0.02, yy = 0.05, zz = 0.05, xy = 0.0, xz = 0.0, yz = 0.0 }
[[joint]]
a = 0.3
[joint.link]
mass = 1.5
com = [-0.1, -0.01, 0.0]
inertia_com = { xx = 0.02, yy = 0.03, zz = 0.03, xy = 0.0, xz = 0.0, yz = 0.0 }
"""
"""Two turning joints whose axes gravity follows, one of them upside down by an angle that has no exact sine."""


def derived(text: str) -> DynamicsModel:
    loaded = load_robot_text(text, "dh")
    return derive_model(loaded.chain, provenance=provenance_of(loaded))


def test_a_gravity_that_is_rounding_alone_is_not_measured_against_itself() -> None:
    model = derived(UPRIGHT)
    (row,) = (row for row in check_model(model) if row.name == "gravity")
    assert not model.gravity(np.full((1, 2), 0.3)).any()
    assert row.passed

    tilted = derived("gravity = [1e-6, 0.0, -9.81]" + UPRIGHT)
    (row,) = (
        row for row in check_model(replace(model, provenance=tilted.provenance)) if row.name == "gravity"
    )
    assert not row.passed


def test_snapping_is_told_and_bounded() -> None:
    (row,) = (row for row in check_model(bundled_model("rounded_arm")) if row.name.startswith("effect"))
    assert 1e-7 < row.error < row.limit < 1e-3
    assert row.passed


def wrong_theta(model: DynamicsModel) -> DynamicsModel:
    return replace(model, theta_b=None, B=model.B * (1 + 1e-6))


def wrong_P(model: DynamicsModel) -> DynamicsModel:
    matrices = [matrix.copy() for matrix in model.P]
    matrices[0].data[7] += 1e-5
    return replace(model, expansion=Expansion.of(model.E, matrices))


def wrong_E(model: DynamicsModel) -> DynamicsModel:
    exponents = model.E.copy()
    exponents[[model.n + 1, 2 * model.n + 1]] = exponents[[2 * model.n + 1, model.n + 1]]
    return replace(model, expansion=replace(model.expansion, E=exponents))


@pytest.mark.parametrize("spoil", [wrong_theta, wrong_P, wrong_E])
def test_mistakes_are_noticed(spoil) -> None:
    rows = check_model(spoil(bundled_model("denso_floor")))
    assert not all(row.passed for row in rows)


def test_unknown_and_changed_parameters_are_checked_under_their_own() -> None:
    model = bundled_model("kr6")
    loaded = model.with_payload(2.0, [0.0, 0.01, 0.1])
    calibrated = replace(model, theta_b=1.1 * model.theta_b)
    for other in (replace(model, theta_b=None), loaded, calibrated):
        assert all(row.passed for row in check_model(other))


def test_unexpanded_models_are_checked_too() -> None:
    model = bundled_model("scara")
    plain = derive_model(model.chain, expand=False, provenance=model.provenance)
    assert all(row.passed for row in check_model(plain))


def test_another_robot_is_refused() -> None:
    with pytest.raises(InputError, match="has joints"):
        check_model(bundled_model("scara"), bundled_robot("kr6"))


def test_a_source_with_other_links_is_refused() -> None:
    """A forged model file: its chain's links are not those of the text that it holds."""
    model = bundled_model("scara")
    renamed = replace(model.mechanism.joints[0], link_name="nowhere")
    forged = replace(model, mechanism=replace(model.mechanism, joints=(renamed, *model.mechanism.joints[1:])))
    with pytest.raises(InputError, match=r"has links .*, the model has nowhere"):
        check_model(forged)


OUTPUTS_OF_ROUNDING = {
    "the Coriolis matrix of one joint": """
convention = "modified"
[[joint]]
alpha = "-90 deg"
a = 0.1
link = { mass = 1.3, com = [0.1, 0.2, 0.3], inertia_com = { xx = 0.2, yy = 0.3, zz = 0.4, xy = 0.01, xz = 0.0, yz = 0.0 } }
""",
    "the drift of a tip on an oblique axis": """<robot name="pendulum"><link name="base"/><link name="arm"><inertial>
<origin xyz="0.1 0 0.02" rpy="0.2 0 0"/><mass value="1.5"/>
<inertia ixx="0.02" iyy="0.03" izz="0.025" ixy="0.001" ixz="0" iyz="0"/></inertial></link>
<joint name="pivot" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="1e-3 1 0"/></joint></robot>""",
}


@pytest.mark.parametrize("what", OUTPUTS_OF_ROUNDING)
def test_what_is_zero_but_for_rounding_passes(what: str) -> None:
    text = OUTPUTS_OF_ROUNDING[what]
    loaded = load_robot_text(text, "urdf" if text.startswith("<") else "dh")
    rows = check_model(derive_model(loaded.mechanism, provenance=provenance_of(loaded)))
    assert [row.name for row in rows if not row.passed] == []


def test_a_model_without_source_is_refused() -> None:
    with pytest.raises(InputError, match="holds no source"):
        check_model(derive_model(random_chain(0, "R")))


def test_what_show_prints_as_json() -> None:
    found = model_json(bundled_model("two_link"))
    assert (found["name"], found["p"], found["l"]) == ("two_link", 10, 4)
    assert list(found["monomials"].values()) == [3, 4, 2, 1]
    assert found["entries_of_P"] == sum(np.count_nonzero(m.toarray()) for m in bundled_model("two_link").P)
    assert len(found["joints"]) == 2
    assert found["source"]["name"] == "two_link.toml"
    plain = model_json(derive_model(random_chain(0, "RR"), expand=False))
    assert (plain["p"], plain["monomials"], plain["entries_of_P"]) == (None, None, None)
    assert plain["source"]["name"] is None


def test_terms_in_words() -> None:
    assert list(term_texts(bundled_model("two_link"))) == [
        "g s1 s2",
        "g c1",
        "g c1 c2",
        "qdd1",
        "qdd1 c2",
        "qdd2",
        "qdd2 c2",
        "qd1^2 s2",
        "qd2^2 s2",
        "qd1 qd2 s2",
    ]
