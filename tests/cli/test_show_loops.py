"""Robots with closed loops: what derive and show say of their base parameters, and which commands refuse them."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from command_line import typed

import psdmc

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "loops.md"
COUNT = "8 of 9 base parameters can be identified from the motors' torques (by numerical rank: singular values fall from "


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("four_bar")
    text = re.search(r"```toml file=four_bar.toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert text
    (folder / "four_bar.toml").write_text(text[1], encoding="utf-8")
    psdmc.derive(folder / "four_bar.toml").save(folder / "four_bar.npz")
    return folder / "four_bar.npz"


def test_derive_and_show_count_what_can_be_identified(model: Path, tmp_path: Path) -> None:
    derived = typed("derive", model.with_suffix(".toml"), "-o", tmp_path / "again.npz")
    shown = typed("show", model)
    assert f"\n{COUNT}" in derived.stdout
    assert f"\n{COUNT}" in shown.stdout
    assert "\n3 of them can be identified alone, and 5 in these combinations:\n" in shown.stdout
    rows = re.findall(r"^(\d+) +(.*theta_b.*)$", shown.stdout, re.MULTILINE)
    assert rows[0] == ("0", "theta_b[0] - 0.4 theta_b[3]")
    assert [number for number, _ in rows] == ["0", "2", "5", "6", "8"]
    assert (tmp_path / "again.npz").read_bytes() == model.read_bytes()


def test_show_json_has_the_combinations(model: Path) -> None:
    found = json.loads(typed("show", model, "--json").stdout)["loop_base_parameters"]
    assert (found["count"], found["kept"]) == (8, [0, 1, 2, 4, 5, 6, 7, 8])
    assert found["combinations"][1] == "theta_b[1]"


def test_a_robot_whose_loops_are_not_found_closed_is_shown_with_a_note(
    model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("psdmc.model.loop_base_parameters.CLOSED", -1.0)
    shown = typed("show", model)
    assert shown.returncode == 0
    assert (
        "note: 'four_bar': no closed position of its loops is found near the zero position; psdmc cannot"
        in (shown.stdout)
    )
    assert json.loads(typed("show", model, "--json").stdout)["loop_base_parameters"] is None


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (("calibrate", "MODEL", "log.csv", "-o", "c.npz"), "calibration"),
        (("payload", "MODEL", "log.csv", "-o", "load.toml"), "payload identification"),
        (("compare", "MODEL", "MODEL"), "comparison"),
        (("excite", "MODEL", "-o", "campaign"), "a campaign"),
    ],
)
def test_commands_that_need_torques_without_forces_of_loops_refuse(
    model: Path, tmp_path: Path, words: tuple[str, ...], what: str
) -> None:
    (tmp_path / "log.csv").write_text("time_s\n", encoding="utf-8")
    done = typed(*(model if word == "MODEL" else word for word in words), cwd=tmp_path)
    assert done.returncode == 2
    error, hint = done.stderr.splitlines()[-2:]
    assert error == (
        f"error: 'four_bar': {what} is of robots without closed loops: torques of its motors contain forces of loop 'pin'"
    )
    assert hint.startswith("hint: fit model.loop_base_parameters to the logs yourself")
