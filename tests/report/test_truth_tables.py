"""The demonstration's page: that the robot is virtual, its truth, and the paper's tables beside what was found."""

from __future__ import annotations

import html
import re
from dataclasses import replace

import numpy as np
import pytest
from made_up_denso import OFF, STD, denso, made_up_record, plant

from psdmc.calibration.verdict.record import Calibration
from psdmc.report.calibrate_report import report_html
from psdmc.report.truth import LINK_NAMES, TABLE_2, TABLE_4, PublishedParameter, TruthView, truth_view

LENGTHS = {"a1": 0.075, "a2": -0.27, "a3": -0.09, "d4": 0.295}


@pytest.fixture(scope="module")
def record() -> Calibration:
    return made_up_record()


@pytest.fixture(scope="module")
def view(record: Calibration) -> TruthView:
    return truth_view(record, denso(), plant())


def cells(markup: str) -> list[list[str]]:
    """A table's rows as text, without its head."""
    rows = re.findall(r"<tr>(.*?)</tr>", markup)[1:]
    return [[html.unescape(cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", row)] for row in rows]


@pytest.mark.parametrize("line", TABLE_4, ids=lambda line: line.name)
def test_the_paper_s_parameters_are_those_of_their_printed_equations(line: PublishedParameter):
    """By Python's own arithmetic on the equation's text, with standard parameters of the virtual robot's links."""
    chain = denso().mechanism
    known = {f"{name}{k + 1}": chain.parameters[k, c] for k in range(6) for c, name in enumerate(LINK_NAMES)}
    text = re.sub(r"(\d) (?=[A-Za-z])", r"\1*", line.equation)
    text = re.sub(r"([ad]\d) (?=[A-Za-z])", r"\1*", text)

    by_text = eval(text, {"__builtins__": {}}, known | LENGTHS)

    assert line.by_base_parameters(denso()) @ denso().known_theta_b() == pytest.approx(
        by_text, rel=1e-9, abs=1e-12
    )


def test_the_virtual_robot_is_like_the_paper_s_where_the_page_says_so():
    """Within 2 %, the worst of small inertias within 7 %; the others are its own."""
    errors = {
        line.name: line.by_base_parameters(denso()) @ denso().known_theta_b() / line.value - 1.0
        for line in TABLE_4
        if line.fitted
    }

    assert max(map(abs, errors.values())) < 0.07
    assert sum(abs(error) < 0.02 for error in errors.values()) >= 12


def test_the_plant_has_the_paper_s_motors_and_friction_but_for_two_repairs():
    for k, joint in enumerate(plant().joints):
        for name, values in TABLE_2.items():
            repaired = name == "static" and k == 5
            own = {"torque_constant": joint.torque_constant, **joint.friction}
            assert own[name] == pytest.approx(1.76 if repaired else values[k], rel=1e-12)


def test_it_says_first_that_the_robot_is_virtual(record: Calibration, view: TruthView):
    page = report_html(record, truth=view)

    assert page.index("This robot is virtual.") < page.index("Accuracy on held-out data")
    assert "0.005 A of noise" in page
    assert "virtual" not in report_html(record)
    with_harness = truth_view(record, denso(), plant(harness=True))
    assert "A cable harness pulls at J4, J5, J6." in with_harness.banner
    assert "a cable harness and its sensors' noise" in with_harness.why


def test_every_parameter_stands_beside_its_truth(record: Calibration, view: TruthView):
    rows = cells(view.parameters)

    assert len(rows) == denso().l == 32
    for row, true in zip(rows, denso().known_theta_b(), strict=True):
        assert float(row[1]) == pytest.approx(true, rel=1e-5)
        assert float(row[2]) == pytest.approx(true + OFF * STD * abs(true), rel=1e-5)
        assert float(row[4]) == OFF


def test_a_parameter_that_the_data_do_not_fix_has_no_error_in_standard_deviations(record: Calibration):
    rows = (replace(record.parameters[0], std=float("inf")), *record.parameters[1:])

    found = cells(truth_view(replace(record, parameters=rows), denso(), plant()).parameters)

    assert found[0][3:5] == ["–", "–"]


def test_table_two_has_found_truth_and_paper_of_every_joint(view: TruthView):
    rows = cells(view.joints)

    assert [row[1] for row in rows] == ["found", "truth", "paper"] * 6
    assert rows[0][:4] == ["J1", "found", "36.28 ± 0.4", "9.638 ± 0.1"]
    assert rows[16][4] == "1.76"
    assert rows[17][4] == "1.53"


def test_table_three_has_the_paper_s_r_squared_beside_its_own(view: TruthView):
    rows = cells(view.accuracy)

    assert rows[0][:4] == ["J1", "this page", "0.2", "0.9876"]
    assert rows[1][-2:] == ["–", "0.99"]
    assert rows[7][8:10] == ["0.95", "0.05"]
    assert rows[11][5] == "–"


def test_table_four_gives_each_line_its_truth_and_a_standard_deviation_of_its_combination(view: TruthView):
    rows = {row[0]: row for row in cells(view.published)}
    truth = denso().known_theta_b()

    second = next(line for line in TABLE_4 if line.name == "θ2").by_base_parameters(denso())
    assert rows["θ2"][1] == "0.566"
    assert float(rows["θ2"][2]) == pytest.approx(second @ truth, rel=1e-3)
    assert float(rows["θ2"][4]) == pytest.approx(STD * np.linalg.norm(second * truth), rel=0.05)
    assert np.count_nonzero(second) == 3


def test_the_reason_for_the_differences_is_one_sentence(view: TruthView):
    assert view.why.count(".") == 1
    assert view.why.endswith(".")
