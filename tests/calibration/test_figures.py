"""`psdmc figures` and the calibrated part of `psdmc view`: numbers are the file's, files are sound LaTeX, SVG and PDF."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from calibration.conftest import smooth_log
from command_line import typed
from matplotlib.figure import Figure

from psdmc.calibration.calibrate import calibrate
from psdmc.calibration.logs.log_files import write_log
from psdmc.calibration.motions.excite import excite
from psdmc.calibration.motions.excite_options import ExciteOptions
from psdmc.calibration.verdict.record import Calibration
from psdmc.errors import InputError
from psdmc.friction.law import Term
from psdmc.friction.laws import LAWS
from psdmc.model.calibrated import NumberRow, Remark, by_joint
from psdmc.report.calibrate_report import RESIDUAL, excitation_figure
from psdmc.report.drawing import document
from psdmc.report.figures import (
    MARK,
    draw_friction,
    draw_parameters,
    draw_torque,
    escaped,
    friction_curves,
    number,
    require_own_folder,
    steady,
    tables,
    tabular,
    unit,
    write_figures,
)
from psdmc.report.view import CALIBRATED, FILE, page, viewed

NUMBER = re.compile(r"\\num\{([^ {}]+)(?: \+- ([^ {}]+))?\}")
NASTY = "a_b%$&#{x}~^\\<关节>"
"""A joint's name."""


@pytest.fixture(scope="module")
def given(arm, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Calibration]:
    """A log and what it calibrates."""
    path = tmp_path_factory.mktemp("figures") / "log.npz"
    write_log(smooth_log(arm), path)
    return path, calibrate(arm.model, path, regressor=arm.regressor)


@pytest.fixture(scope="module")
def nasty(given: tuple[Path, Calibration]) -> Calibration:
    """The same with a joint of that name."""
    record = given[1]

    def renamed(rows: tuple[NumberRow, ...]) -> tuple[NumberRow, ...]:
        return tuple(replace(row, joint=NASTY) if row.joint == "elbow" else row for row in rows)

    steps = tuple(
        replace(
            step,
            joints={NASTY if name == "elbow" else name: each for name, each in step.joints.items()},
            samples=tuple(
                replace(each, joint=NASTY) if each.joint == "elbow" else each for each in step.samples
            ),
        )
        for step in record.steps
    )
    return replace(record, joint_names=("shoulder", NASTY), friction=renamed(record.friction), steps=steps)


def require_sound(text: str) -> None:
    """Braces close, environments end, each row has the head's cells, and no special letter is bare."""
    plain = re.sub(r"\\[\\{}$&#_%]", "", text.replace(r"\\", "\n"))
    depth = 0
    for letter in plain:
        depth += (letter == "{") - (letter == "}")
        assert depth >= 0
    assert depth == 0
    assert re.findall(r"\\begin\{(\w+)\}", text) == re.findall(r"\\end\{(\w+)\}", text)
    rows = [line for line in text.splitlines() if line.endswith(r"\\")]
    cells = {len(re.findall(r"(?<!\\)&", row)) for row in rows}
    assert len(cells) == 1
    for row in rows:
        outside = re.sub(r"\$[^$]*\$|\\[a-z]+\{[^{}]*(\{[^{}]*\}[^{}]*)*\}", "", row.replace(r"\$", ""))
        assert not re.search(r"(?<!\\)[_^%#$]", outside), row
        assert row.isascii()


def test_tables_hold_the_file_s_numbers(given: tuple[Path, Calibration]):
    record = given[1]

    found = tables(record.model, record)

    rows = [line for line in found["parameters.tex"].splitlines() if line.startswith("${\\theta")]
    assert len(rows) == len(record.parameters)
    for line, row in zip(rows, record.parameters, strict=True):
        *file, (value, std) = NUMBER.findall(line)
        require_rounded(value, row.value, std, row.std)
        if row.file is not None:
            assert float(file[0][0]) == pytest.approx(row.file, rel=5e-4)
    said = [line.split(" & ") for line in found["joints.tex"].splitlines() if " & " in line][1:]
    assert [(cells[0], cells[1]) for cells in said] == [(row.joint, row.name) for row in record.friction]
    for cells, row in zip(said, record.friction, strict=True):
        (value, std) = NUMBER.findall(cells[2])[0]
        require_rounded(value, row.value, std, row.std)
    accuracy = [NUMBER.findall(line) for line in found["accuracy.tex"].splitlines() if r"\num" in line]
    own = [record.steps[0].joints[name].held_out for name in record.joint_names]
    for ((r2, _), (rmse, _)), quality in zip(accuracy, own, strict=True):
        assert float(r2) == pytest.approx(quality.r2, abs=5e-5)
        assert float(rmse) == pytest.approx(quality.rmse, rel=5e-4)


def require_rounded(value: str, own: float, std: str, own_std: float) -> None:
    """A table's number is the file's, rounded to its last digit, which is the second of the standard deviation."""
    if not np.isfinite(own_std):
        assert std == ""
        assert float(value) == pytest.approx(own, rel=5e-4)
        return
    last = 10.0 ** -len(value.partition(".")[2])
    assert abs(float(value) - own) <= 0.500001 * last
    assert float(std) == pytest.approx(own_std, abs=0.500001 * last)
    assert own_std >= 9.4 * last or last == 1.0


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (1.23456, 0.0234, r"\num{1.235 +- 0.023}"),
        (-0.00004, 0.18, r"\num{0.00 +- 0.18}"),
        (1234.5, 98.7, r"\num{1234 +- 99}"),
        (1e-7, 2e-8, r"\num{0.000000100 +- 0.000000020}"),
        (5.0, np.inf, r"\num{5}"),
        (5.0, 0.0, r"\num{5}"),
        (np.nan, 1.0, "--"),
    ],
)
def test_numbers_are_rounded_to_two_digits_of_their_standard_deviation(value: float, std: float, text: str):
    assert number(value, std) == text


@pytest.mark.parametrize(
    ("text", "latex"),
    [
        ("kg m^2", r"\unit{kg.m^{2}}"),
        ("Nms/rad", r"\unit{N.m.s/rad}"),
        ("Nm/A", r"\unit{N.m/A}"),
        ("Ns/m", r"\unit{N.s/m}"),
        ("-", ""),
        (r"\input{x}", r"\textbackslash{}input\{x\}"),
    ],
)
def test_units(text: str, latex: str):
    assert unit(text) == latex


def test_names_of_a_file_are_escaped():
    assert escaped(NASTY) == (
        r"a\_b\%\$\&\#\{x\}\textasciitilde{}\textasciicircum{}\textbackslash{}\textless{}U+5173U+8282\textgreater{}"
    )
    assert escaped("a\nb") == "aU+000Ab"


def test_every_table_is_sound(given: tuple[Path, Calibration], nasty: Calibration):
    for record in (given[1], nasty):
        for text in tables(given[1].model, record).values():
            assert text.startswith(MARK)
            require_sound(text)
    with pytest.raises(AssertionError):
        require_sound(tabular("ll", ["a", "b"], [["1 % 2", "3"]]))


@pytest.mark.slow
@pytest.mark.skipif(
    shutil.which("pdflatex") is None
    or subprocess.run(["kpsewhich", "siunitx.sty"], capture_output=True, check=False).returncode != 0,
    reason="no LaTeX with siunitx",
)
def test_latex_typesets_the_tables_and_figures(
    given: tuple[Path, Calibration], nasty: Calibration, tmp_path: Path
):
    write_figures(given[1].model, tmp_path)
    for name, text in tables(given[1].model, nasty).items():
        (tmp_path / name).write_text(text, encoding="utf-8")

    done = subprocess.run(
        ["pdflatex", "-halt-on-error", "-interaction=nonstopmode", "preview.tex"],
        cwd=tmp_path,
        capture_output=True,
        check=False,
    )

    assert done.returncode == 0, done.stdout.decode(errors="replace")[-2000:]
    assert (tmp_path / "preview.pdf").stat().st_size > 10_000


def test_friction_curves_by_closed_form(given: tuple[Path, Calibration]):
    """Of a linear law: (F_c + F_v |v|) tanh(v / v_s); the offset, which is large here, is left out."""
    record = given[1]
    friction = [replace(row, value=7.0) if row.name == "offset" else row for row in record.friction]
    record = replace(record, friction=tuple(friction))
    values = by_joint(record.friction)

    found = friction_curves(record)

    assert list(found) == ["shoulder", "elbow"]
    for joint, (v, torque) in found.items():
        names = {name: value for (own, name), value in values.items() if own == joint}
        assert set(names) == {"coulomb", "viscous", "offset"}
        sign = np.tanh(v / record.prediction.sign_speed)
        expected = (names["coulomb"] + names["viscous"] * np.abs(v)) * sign
        np.testing.assert_allclose(torque, expected, rtol=1e-12)
        np.testing.assert_allclose(v, -v[::-1])


def test_lugre_friction_in_steady_motion_by_closed_form():
    """(13) and (14) of Denso-2022 with dz/dt = 0: [F_c + (F_s - F_c) exp(-(v / v_s)^2) + F_v |v|^d] sign(v)."""
    coulomb, static, stribeck, viscous, exponent = 3.0, 3.8, 0.03, 4.0, 0.7
    v = np.concatenate([-np.geomspace(2.0, 1e-3, 40), np.geomspace(1e-3, 2.0, 40)])

    found = steady([(Term(LAWS["lugre"]), [coulomb, static, stribeck, viscous, exponent, 9e3, 12.0])], v, 0.0)

    size = coulomb + (static - coulomb) * np.exp(-((v / stribeck) ** 2)) + viscous * np.abs(v) ** exponent
    np.testing.assert_allclose(found, size * np.sign(v), rtol=1e-9)


def test_what_is_not_identified_is_grey_in_pictures_and_in_brackets_in_tables(
    given: tuple[Path, Calibration],
):
    record = given[1]
    weak = Remark("weakly visible", "weak")
    rows = tuple(
        replace(row, identifiable=k % 2 == 0, visibility="identified" if k % 2 == 0 else weak)
        for k, row in enumerate(record.parameters)
    )
    record = replace(record, parameters=rows)
    figure = Figure()

    draw_parameters(figure, record)
    table = tables(record.model, record)["parameters.tex"]

    grey = set()
    for axis in figure.axes:
        names = [label.get_text() for label in axis.get_yticklabels()]
        points = [
            line for line in axis.lines if line.get_marker() == "o" and line.get_markerfacecolor() != "none"
        ]
        grey |= {names[int(line.get_ydata()[0])] for line in points if line.get_color() == RESIDUAL}
    cells = [line.split(" & ")[3] for line in table.splitlines() if line.startswith("${\\theta")]
    assert [cell.startswith("(") for cell in cells] == [row.name in grey for row in rows]
    assert len(grey) == len(rows) // 2


@pytest.mark.parametrize("spread", [1e-9, 3e-5, 0.02, 0.9, 8.0, 40.0, np.inf])
@pytest.mark.parametrize("largest", [0.5, 10.0, 3e4])
def test_labels_of_parameters_do_not_overlap(given: tuple[Path, Calibration], spread: float, largest: float):
    """On an axis that is linear about zero and logarithmic beyond."""
    record = given[1]
    ends = (-largest, 0.0, 0.3 * min(spread, 1.0), largest)
    rows = tuple(
        replace(row, value=ends[k % 4], std=spread, file=None, unit="kg m")
        for k, row in enumerate(record.parameters)
    )
    figure = Figure(figsize=(7.0, 3.0), layout="constrained")

    draw_parameters(figure, replace(record, parameters=rows))
    figure.canvas.draw()

    axis = figure.axes[0]
    low, high = axis.get_xlim()
    boxes = [label.get_window_extent() for label in axis.get_xticklabels() if label.get_text()]
    assert len(boxes) >= 3
    assert low < -largest
    assert high > largest
    for left, right in pairwise(boxes):
        assert left.x1 + 4.0 < right.x0, "4 of 100 pixels per inch"


def require_white(picture: bytes) -> None:
    """The first thing that an SVG draws is a white rectangle over the whole of it."""
    root = ElementTree.fromstring(picture)
    _, _, wide, high = map(float, root.attrib["viewBox"].split())
    first = next(root.iter("{http://www.w3.org/2000/svg}path"))
    assert "fill: #ffffff" in first.attrib["style"]
    assert "opacity: 0" not in first.attrib["style"]
    corners = [float(word) for word in re.findall(r"[-0-9.]+", first.attrib["d"])]
    assert (max(corners[::2]), max(corners[1::2])) == pytest.approx((wide, high))
    assert min(corners) == pytest.approx(0.0)


@pytest.mark.filterwarnings("ignore:Glyph")
def test_pictures_are_the_same_bytes_sound_and_without_dates(
    given: tuple[Path, Calibration], nasty: Calibration
):
    efforts = dict.fromkeys(nasty.joint_names, "N m")
    drawers = (
        lambda figure: draw_parameters(figure, nasty),
        lambda figure: draw_friction(figure, friction_curves(nasty), efforts),
        lambda figure: draw_torque(figure, nasty.steps[0], efforts),
    )
    assert document("x", drawers[1], (7.0, 4.0)) == document("x", drawers[1], (7.0, 4.0))
    for draw in drawers:
        once = document("x", draw, (7.0, 4.0))
        require_white(once["x.svg"])
        root = ElementTree.fromstring(once["x.svg"])
        assert root.tag == "{http://www.w3.org/2000/svg}svg"
        assert len(root.findall(".//{http://www.w3.org/2000/svg}path")) > 10
        assert once["x.pdf"].startswith(b"%PDF-")
        for word in (b"CreationDate", b"<dc:date>", b"ModDate"):
            assert word not in once["x.pdf"] + once["x.svg"]


def test_the_picture_of_an_exciting_motion_is_a_file_on_white_ground(arm):
    found = excite(arm.model.chain, arm.regressor, ExciteOptions(evaluations=1, seconds=0.0, random=20))

    require_white(excitation_figure(found, arm.model.joint_names))


def test_the_command_writes_a_folder_of_its_own(given: tuple[Path, Calibration], tmp_path: Path):
    log, record = given
    record.model.save(tmp_path / "arm.npz")
    shutil.copy(log, tmp_path / "log.npz")

    done = typed("figures", "arm.npz", "log.npz", cwd=tmp_path)

    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        f"arm_figures/{name}: written"
        for name in (
            *("parameters.tex", "joints.tex", "accuracy.tex", "preview.tex"),
            *(f"{name}.{kind}" for name in ("parameters", "friction", "torque") for kind in ("pdf", "svg")),
        )
    ]
    assert r"\input{joints.tex}" in (tmp_path / "arm_figures" / "preview.tex").read_text(encoding="utf-8")
    require_own_folder(tmp_path / "arm_figures")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("", encoding="utf-8")
    refused = typed("figures", "arm.npz", "-o", "mine", cwd=tmp_path)
    assert refused.returncode == 2
    assert "psdmc did not write the files in this folder: thesis.tex" in refused.stderr
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["thesis.tex"]


def test_the_next_command_after_a_calibration_does_not_meet_its_report(
    arm, given: tuple[Path, Calibration], tmp_path: Path
):
    """`psdmc view OUT.npz` would write OUT.html, which often is the report."""
    arm.model.save(tmp_path / "arm.npz")
    shutil.copy(given[0], tmp_path / "log.npz")

    done = typed("calibrate", "arm.npz", "log.npz", "-o", "out.npz", "--report", "out.html", cwd=tmp_path)
    words = next(line for line in done.stderr.splitlines() if line.startswith("next: psdmc view")).split()[2:]
    shown = typed(*words, cwd=tmp_path)

    assert done.returncode == 0, done.stderr
    assert shown.returncode == 0, shown.stderr
    assert (tmp_path / "out_view.html").exists()


def test_models_and_logs_that_do_not_fit_are_refused(arm, given: tuple[Path, Calibration], tmp_path: Path):
    with pytest.raises(InputError, match="not calibrated"):
        write_figures(arm.model, tmp_path / "a")
    (tmp_path / "campaign.toml").write_text("[[run]]\n", encoding="utf-8")
    with pytest.raises(InputError, match="run 1: step: missing"):
        write_figures(given[1].model, tmp_path / "a", tmp_path)
    assert not (tmp_path / "a").exists()


def test_the_folder_of_a_campaign_of_one_log_gives_the_figures_of_its_log(
    given: tuple[Path, Calibration], tmp_path: Path
):
    """So do campaigns with other runs, of which the exciting one is taken, and those with a motion for validation."""
    log, record = given
    plain = {path.name: path.read_bytes() for path in write_figures(record.model, tmp_path / "plain", log)}
    run = '[[run]]\nstep = "{0}"\nname = "{0}"\nlog = "{1}"\n'
    campaigns = {
        "one_log": run.format("inertial", log.as_posix()),
        "four_steps": run.format("inertial", log.as_posix()) + run.format("gravity", log.as_posix()),
        "validation": run.format("inertial", "none.npz") + run.format("validation", log.as_posix()),
    }
    for name, text in campaigns.items():
        (tmp_path / name).mkdir()
        (tmp_path / name / "campaign.toml").write_text(text, encoding="utf-8")

        found = write_figures(record.model, tmp_path / f"{name}_figures", tmp_path / name)

        assert {path.name: path.read_bytes() for path in found} == plain, name


@pytest.mark.slow
def test_a_campaign_s_model_is_drawn_with_its_campaign(
    noisy: tuple[Path, Calibration], given: tuple[Path, Calibration], tmp_path: Path
):
    folder, record = noisy

    found = write_figures(record.model, tmp_path / "a", folder)

    assert {"torque.pdf", "friction.svg", "joints.tex"} <= {path.name for path in found}
    assert len(viewed(record.model, folder).times) > 100
    exciting = folder / "logs" / "inertial.npz"
    assert "torque.pdf" in {path.name for path in write_figures(record.model, tmp_path / "b", exciting)}


def test_the_view_lays_a_calibration_over_the_file(given: tuple[Path, Calibration]):
    """The drawn bodies have the calibration's base parameters: their centre of mass and first moments give its gravity."""
    pytest.importorskip("cvxpy")
    log, record = given

    found = viewed(record.model, log)

    assert list(found.layers) == [FILE, CALIBRATED]
    q = found.poses
    chain, own = found.chain, found.layers[CALIBRATED]
    for pose in (0, 50, len(q) - 1):
        gravity = np.zeros(2)
        for each in own:
            at = q[pose, each.joint, :9].reshape(3, 3) @ each.com + q[pose, each.joint, 9:]
            for joint in range(
                each.joint + 1
            ):  # torque that holds the weight about z of each joint that carries it
                arm_of_force = at - q[pose, joint, 9:]
                gravity[joint] -= each.mass * np.cross(arm_of_force, chain.gravity)[2]
        angle = [np.arctan2(q[pose, 0, 3], q[pose, 0, 0]), 0.0]
        angle[1] = np.arctan2(q[pose, 1, 3], q[pose, 1, 0]) - angle[0]
        np.testing.assert_allclose(gravity, record.model.gravity(np.array(angle)), rtol=1e-6, atol=1e-6)
    assert "Verdict of the calibration" in page(found, "")
