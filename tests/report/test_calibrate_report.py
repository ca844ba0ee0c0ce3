"""The calibration's page: complete, self-contained, and safe with names from files."""

from __future__ import annotations

import html
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from psdmc.calibration.verdict.record import Calibration
from psdmc.errors import InputError
from psdmc.model.calibrated import (
    JointFigures,
    JointQuality,
    LogUsed,
    NumberRow,
    ParameterRow,
    Prediction,
    Quality,
    Sample,
    StepQuality,
    StepUsed,
    Verdict,
)
from psdmc.model.grounds import Ground
from psdmc.report.calibrate_commands import calibrate_command
from psdmc.report.calibrate_report import report_html, require_free_numbers, write_report

X = np.linspace(0.0, 1.0, 50)
SAMPLE = Sample("a", "time [s]", X, np.sin(X), np.sin(X) + 0.01, X > 0.8)


@pytest.fixture
def record() -> Calibration:
    quality = JointQuality(Quality(0.1, 0.999), Quality(0.2, 0.9876))
    return Calibration(
        robot="arm <7>",
        method="linear fit",
        joint_names=("a",),
        model=None,  # type: ignore[arg-type]
        parameters=(
            ParameterRow("theta_b[0]", "gravity", 7.4174, 0.01, "kg", "m1 + mx1/a1 <i>", True),
            ParameterRow(
                "theta_b[1]",
                "inertial",
                0.25,
                float("inf"),
                "kg m^2",
                "Izz1",
                False,
                "not visible: kept at the file's value",
            ),
        ),
        motors=(NumberRow("a", "torque_constant", 36.1, 0.02, "Nm/A"),),
        friction=(NumberRow("a", "stribeck_velocity", 0.02, 0.5, "rad/s", seen=False),),
        steps=(StepQuality("All", {"a": quality}, (SAMPLE,)),),
        warnings=("joint a: <script>alert(1)</script>",),
        facts={"rank": 31, "singular_values": [3.0, 0.5]},
        notes=("physical consistency moved the parameters by 3 standard deviations",),
    )


def test_it_shows_every_number(record: Calibration):
    page = report_html(record)

    for text in (
        "7.4174",
        "m1 + mx1/a1 &lt;i&gt;",
        "0.9876",
        "1 of 2 base parameters identified",
        "not visible: kept at the file&#x27;s value",
        "physical consistency moved",
        "36.1 ± 0.02",
        "not seen",
        "3, 0.5",
    ):
        assert text in page


def test_each_parameter_has_the_file_s_value_beside_the_found_one(record: Calibration):
    known, unknown = record.parameters
    page = report_html(replace(record, parameters=(replace(known, file=6.25), unknown)))

    row = re.search(r"<tr><td>theta_b\[0\]</td>.*?</tr>", page)
    assert row is not None
    cells = [html.unescape(cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", row[0])]
    assert cells[:7] == ["theta_b[0]", "6.25", "7.4174", "0.01", "0.13%", "kg", "m1 + mx1/a1 <i>"]
    assert "<tr><td>theta_b[1]</td><td>–</td><td>0.25</td>" in page


def test_accuracy_is_labelled_held_out(record: Calibration):
    page = report_html(record)

    assert "All: RMSE held out (fitted)" in page
    assert "0.2 (0.1)" in page
    assert "All: R² held out (fitted)" in page
    assert "0.9876 (0.9990)" in page


def test_logs_cut_offs_versions_and_what_shading_means_are_on_the_page(record: Calibration):
    log = LogUsed("one<b>.csv", 45000, 45.0, "2026-11-22")
    logs, versions = (log, replace(log, log="two.csv", use="with_load")), {"psdmc": "9.8", "numpy": "7.6"}
    steps = {"gravity": StepUsed(4.0), "all": StepUsed(8.5, held_out=0.3, blocks=0)}

    page = report_html(replace(record, logs=logs, versions=versions, prediction=Prediction("linear", steps)))

    for cells in (
        "<td>one&lt;b&gt;.csv</td><td>45,000</td><td>45</td><td>2026-11-22</td><td>fitted and held out</td>",
        "<td>two.csv</td><td>45,000</td><td>45</td><td>2026-11-22</td><td>with the known load</td>",
        "<td>gravity</td><td>4</td><td>8, both ways</td><td>15%, spread over 40 blocks</td>",
        "<td>whole log</td><td>8.5</td><td>8, both ways</td><td>30%, the end</td>",
        "Computed by psdmc 9.8, numpy 7.6.",
        "Shaded: held out, not used by the fit.",
    ):
        assert cells in page


def test_it_loads_nothing_from_outside(record: Calibration):
    page = report_html(record)

    assert "<svg" in page
    for outside in ('src="http', 'href="http', "url(http", "<script ", "@import", "fetch("):
        assert outside not in page
    assert page.count("<script>") == 1  # the page's own, which lets wide tables become lists


def test_names_are_escaped(record: Calibration):
    page = report_html(replace(record, joint_names=("j<i>",)))

    assert "arm &lt;7&gt;" in page
    assert "<script>alert" not in page
    assert "j&lt;i&gt;" in page
    assert "j<i>" not in page


def test_the_same_record_gives_the_same_bytes(record: Calibration):
    assert report_html(record) == report_html(record)


def test_the_numbers_stand_beside_it_as_json(record: Calibration, tmp_path: Path):
    _, numbers = write_report(replace(record, robot="arm"), tmp_path / "page.html")

    data = json.loads(numbers.read_text(encoding="utf-8"))

    assert data["base_parameters"][1]["std"] is None
    assert data["quality"]["All"]["a"]["held_out"]["r2"] == 0.9876


def test_the_numbers_replace_no_file_of_the_users(record: Calibration, tmp_path: Path) -> None:
    mine = tmp_path / "page.json"
    mine.write_text('{"base_parameters": []}', encoding="utf-8")

    with pytest.raises(InputError, match=r"page\.json: psdmc did not write this file") as refused:
        calibrate_command(tmp_path / "none.npz", [], tmp_path / "out.npz", tmp_path / "page.html")

    assert "--report" in str(refused.value.hint)
    mine.unlink()
    write_report(record, tmp_path / "page.html")
    require_free_numbers(tmp_path / "page.html")  # its own it replaces


def test_the_verdict_comes_first_with_its_figures(record: Calibration, tmp_path: Path):
    figures = JointFigures("a", 0.25, 0.2, -1.02, 0.03, True, -4.5, 0.1, float("nan"), 0.7)
    hidden = replace(figures, joint="b", gain=11.6, visible=False)
    grounds = [
        (Ground("said", {"text": text}),)
        for text in ("friction <gives> power", "few samples", "a & b swapped")
    ]
    verdict = Verdict(*grounds, (figures, hidden), 5.0)

    page, numbers = write_report(replace(record, robot="arm", verdict=verdict), tmp_path / "page.html")
    text = page.read_text(encoding="utf-8")

    assert text.index("Verdict: not usable") < text.index("Warnings") < text.index("Accuracy")
    for part in (
        "friction &lt;gives&gt; power",
        "a &amp; b swapped",
        "few samples",
        "-1.02 ± 0.03",
        "(11.6 ± 0.03)",
    ):
        assert part in text
    data = json.loads(numbers.read_text(encoding="utf-8"))
    assert next(iter(data)) == "verdict"
    assert data["verdict"]["joints"]["a"]["noise_ratio"] is None
