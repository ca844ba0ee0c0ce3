"""`psdmc show --json`: one document, nothing else on standard output, all digits, null where nothing is known."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model, robot_path
from command_line import typed

from psdmc.model.dynamics_model import DynamicsModel


@pytest.fixture(scope="module")
def model() -> DynamicsModel:
    return bundled_model("scara")


def document(*words: object) -> dict[str, object]:
    done = typed(*words)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))
    assert isinstance(found, dict)
    return found


def test_a_model_is_all_there_with_all_digits(model: DynamicsModel, tmp_path: Path) -> None:
    model.save(tmp_path / "m.npz")
    found = document("show", tmp_path / "m.npz", "--json")

    assert (found["schema"], found["kind"], found["p"], found["l"]) == (1, "model", model.p, model.l)
    joints, parameters = found["joints"], found["base_parameters"]
    assert isinstance(joints, list)
    assert isinstance(parameters, list)
    assert [joint["name"] for joint in joints] == list(model.joint_names)
    assert [each["index"] for each in parameters] == list(range(model.l))
    assert [each["name"] for each in parameters] == list(model.base_parameters.labels)
    assert [each["equation"] for each in parameters] == [b.equation for b in model.base_parameters]
    assert model.theta_b is not None
    np.testing.assert_array_equal([each["value"] for each in parameters], model.theta_b)
    assert found["gravity_m_s2"] == model.mechanism.gravity.tolist()
    assert found["model_hash"] == model.content_hash


def test_what_is_unknown_is_null(tmp_path: Path) -> None:
    urdf = """<robot name="a"><link name="base"/><link name="arm"><inertial>
    <mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <joint name="j" type="continuous">
    <parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint></robot>"""
    (tmp_path / "a.urdf").write_text(urdf, encoding="utf-8")
    assert typed("derive", tmp_path / "a.urdf", "-o", tmp_path / "a.npz").returncode == 0

    found = document("show", tmp_path / "a.npz", "--json")

    assert found["joints"][0]["limits"] == dict.fromkeys(  # type: ignore[index]
        ("lower", "upper", "speed", "acceleration", "effort")
    )
    json.dumps(found, allow_nan=False)


def test_a_robot_file_its_terms_and_its_cost(model: DynamicsModel, tmp_path: Path) -> None:
    model.save(tmp_path / "m.npz")

    robot = document("show", robot_path("scara"), "--json")
    terms = document("show", tmp_path / "m.npz", "--terms", "--json")
    cost = document("show", tmp_path / "m.npz", "--cost", "--json")

    assert robot["kind"] == "robot"
    assert [joint["link"] for joint in robot["joints"]] == [  # type: ignore[attr-defined]
        joint.link_name for joint in model.mechanism.joints
    ]
    assert len(terms["terms"]) == model.p  # type: ignore[arg-type]
    rows = cost["functions"]
    assert {"inverse_dynamics", "forward_dynamics"} <= {row["function"] for row in rows}  # type: ignore[attr-defined]
    assert all(row["total"] == row["mul"] + row["add"] for row in rows)  # type: ignore[attr-defined]


def test_latex_is_what_python_gives_and_nothing_else(model: DynamicsModel, tmp_path: Path) -> None:
    model.save(tmp_path / "m.npz")
    done = typed("show", tmp_path / "m.npz", "--latex")

    assert done.stdout == model.to_latex() + "\n"
    assert done.stdout.startswith("\\begin{aligned}\n\\theta_{0} &= ")
    assert typed("show", robot_path("scara"), "--latex").returncode == 2


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--terms", "--cost"), "--terms and --cost"),
        (("--latex", "--cost"), "--cost and --latex"),
        (("--latex", "--json"), "--latex and --json"),
    ],
)
def test_two_questions_at_once_are_refused(
    options: tuple[str, ...], said: str, model: DynamicsModel, tmp_path: Path
) -> None:
    model.save(tmp_path / "m.npz")
    done = typed("show", tmp_path / "m.npz", *options)

    assert done.returncode == 2
    assert done.stderr.startswith(f"error: {said} are several questions\nhint: ")
    assert done.stdout == ""
