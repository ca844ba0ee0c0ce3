"""The pages that psdmc makes, in Chromium: nothing scrolls sideways, no table is cut, no legend hides a curve and no first
screen is empty at 400, 800 and 1280 px, light and dark, and axe-core finds no serious fault. `make test-pages` runs it and
keeps the screenshots in generated/pages; `make test`, where Chromium and Playwright are installed, takes the pages that
psdmc's commands write, at the narrowest width."""

from __future__ import annotations

import io
import os
import shutil
import sys
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_bench import made_up_result
from made_up_denso import denso, made_up_record, plant
from matplotlib.image import imread

from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_files import write_log
from psdmc.calibration.verdict.record import Calibration
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
from psdmc.report.bench_page import write_page
from psdmc.report.calibrate_report import write_report
from psdmc.report.truth import truth_view
from psdmc.report.view import viewed, write_view
from psdmc.robot.load import load_robot

pytest.importorskip("playwright")
ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "docs"))
BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
KEPT = os.environ.get("PSDMC_SCREENSHOTS")
"""`make test-pages`: the folder for screenshots."""
WIDTHS = (400, 800, 1280) if KEPT else (400,)
SITE = (
    (
        "index",
        "functions",
        "reference/cli",
        "decisions/index",
        "tutorials/controller",
        "benchmarks",
        "reliability",
        "calibration",
        "how_tested",
        "how-to/payload",
    )
    if KEPT
    else ()
)
OWN = ("bench", "calibration", "virtual", *(("view",) if find_spec("plotly") else ()))
JOINTS = tuple(f"a_rather_long_joint_name_{k}" for k in range(6))


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The pages by name: the benchmark's, a calibration's, and some of the site's."""
    folder = tmp_path_factory.mktemp("pages")
    if SITE:
        import site_pages

        site_pages.gather(folder / "source")
        assert site_pages.render(folder / "source", folder / "site") == 0
    write_page(made_up_result(), folder / "bench.html")
    write_report(calibration(), folder / "calibration.html")
    virtual = made_up_record()
    write_report(virtual, folder / "virtual.html", truth=truth_view(virtual, denso(), plant(harness=True)))
    if "view" in OWN:
        write_log(still_log(), folder / "log.npz")
        write_view(
            viewed(load_robot(ROOT / "examples/robots/kr6.toml"), folder / "log.npz"), folder / "view.html"
        )
    own = {name: folder / f"{name}.html" for name in OWN}
    return own | {f"site_{name.replace('/', '_')}": folder / f"site/{name}.html" for name in SITE}


def still_log() -> Log:
    """KR6 moving slowly."""
    time = np.arange(500) / 50.0
    q = 0.5 * np.sin(0.7 * time[:, None] + np.arange(6))
    return Log(
        "log", tuple(f"joint_{k}" for k in range(1, 7)), time, q, None, 10.0 * np.cos(q), "motor_torque"
    )


NAMES = (*OWN, *(f"site_{name.replace('/', '_')}" for name in SITE))


def calibration() -> Calibration:
    """A record with six joints, every kind of row and a verdict with doubts."""
    x = np.linspace(0.0, 10.0, 400)
    samples = tuple(
        Sample(j, "time [s]", x, 10 * np.sin(x + k), 10 * np.sin(x + k) + 0.1, x > 8.0)
        for k, j in enumerate(JOINTS)
    )
    quality = JointQuality(Quality(0.1, 0.999), Quality(0.2, 0.9876))
    figures = tuple(JointFigures(j, 0.98, 0.3, 1.02, 0.05, True, 3.0, 0.2, 1.5, 0.4) for j in JOINTS)
    log = LogUsed("a_log_of_a_long_name_2026-11-22_exciting_motion.csv", 90000, 90.0)
    doubt = "the model lacks an effect at a joint: the residual is no sensor noise"
    verdict = Verdict((), (Ground("said", {"text": doubt}),), (), figures, 40.0)
    equation = "Izz1 + 0.0025 m2 + Iyy2 + 0.183125 m3 + Iyy3 + 0.183525 m4 + 0.183525 m5 + 0.183525 m6"
    return Calibration(
        robot="a robot",
        method="linear fit",
        joint_names=JOINTS,
        model=None,  # type: ignore[arg-type]
        parameters=tuple(
            ParameterRow(f"theta_{k}", "inertial", 7.4, 0.01, "kg m^2", equation, True, file=6.9)
            for k in range(36)
        ),
        motors=tuple(NumberRow(j, "torque_constant", 36.1, 0.02, "Nm/A") for j in JOINTS),
        friction=tuple(NumberRow(j, "stribeck_velocity", 0.02, 0.5, "rad/s", seen=False) for j in JOINTS),
        steps=tuple(
            StepQuality(step, dict.fromkeys(JOINTS, quality), samples) for step in ("Gravity", "Inertial")
        ),
        warnings=("a joint hardly moves",),
        facts={"rank": 31, "singular_values": [3.0, 0.5]},
        logs=(log,) * 3,
        versions={"psdmc": "1.0", "numpy": "2.1"},
        prediction=Prediction("linear", {"all": StepUsed(8.0)}),
        notes=("physical consistency moved the parameters by 3 standard deviations",),
        verdict=verdict,
    )


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    if BROWSER is None:
        pytest.skip("no chromium")
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(
            executable_path=BROWSER, args=["--no-sandbox", "--enable-unsafe-swiftshader"]
        )
        yield found
        found.close()


@pytest.fixture(scope="module")
def page(request: pytest.FixtureRequest, browser: Any, pages: dict[str, Path]) -> Iterator[Any]:
    """A page in Chromium, opened once for all tests of this page, width and scheme, which leave it as they find it."""
    name, width, scheme = request.param
    opened = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
    opened.goto(pages[name].as_uri())
    yield opened
    opened.close()


def of(
    *names: str, widths: Sequence[int] = WIDTHS, schemes: Sequence[str] = ("light",)
) -> pytest.MarkDecorator:
    """A test of these pages; `make test` leaves dark ones to `make test-slow`."""
    cases = [
        pytest.param(
            (name, width, scheme),
            id=f"{name}-{width}-{scheme}",
            marks=[pytest.mark.slow] if scheme == "dark" else [],
        )
        for name in names
        for width in widths
        for scheme in schemes
    ]
    return pytest.mark.parametrize("page", cases, indirect=True, scope="module")


@of(*NAMES, schemes=("light", "dark"))
def test_nothing_scrolls_sideways(page: Any, request: pytest.FixtureRequest):
    if KEPT:
        page.screenshot(path=Path(KEPT) / f"{request.node.callspec.id.replace('-', '_')}.png", full_page=True)

    assert page.evaluate("document.documentElement.scrollWidth") <= page.viewport_size["width"]


CUT = """() => {
  const folded = document.querySelectorAll("details:not([open])");
  for (const details of folded) details.open = true;
  dispatchEvent(new Event("resize"));
  const cut = [];
  for (const table of document.querySelectorAll("main table, article table")) {
    const over = table.getBoundingClientRect().right - table.parentElement.getBoundingClientRect().right;
    const cells = [...table.tBodies].flatMap((body) => [...body.rows]).flatMap((row) => [...row.cells]);
    const hidden = cells.find((cell) => cell.scrollWidth > cell.clientWidth + 1);
    if (over > 1 || hidden) cut.push(`${Math.round(over)} px: ${(hidden ?? table).textContent.trim().slice(0, 60)}`);
  }
  for (const details of folded) details.open = false;
  dispatchEvent(new Event("resize"));
  return cut;
}"""
"""Tables that reach beyond what holds them, or one of whose cells does."""


@of(*NAMES)
def test_no_table_is_cut(page: Any):
    assert page.evaluate(CUT) == []


@of("bench", widths=(400,))
def test_a_table_that_became_a_list_names_each_value(page: Any):
    heads = page.eval_on_selector_all("table.stacked tr:first-child > td", "e => e.map(c => c.dataset.head)")
    role = page.eval_on_selector("table.stacked td", "e => e.getAttribute('role')")

    assert heads[:4] == [
        "robot",
        "inverse dynamics: ns per call",
        "inverse dynamics: × Pinocchio",
        "inverse dynamics: × CasADi",
    ]
    assert role == "cell"


HIDING = """() => {
  const hiding = [];
  for (const svg of document.querySelectorAll("svg")) {
    const legend = svg.querySelector("g[id^=legend]")?.getBoundingClientRect();
    if (!legend) continue;
    for (const curve of svg.querySelectorAll("g[id^=axes] > g[id^=line2d]")) {
      const box = curve.getBoundingClientRect();
      if (box.left < legend.right && legend.left < box.right && box.top < legend.bottom && legend.top < box.bottom)
        hiding.push(svg.getAttribute("aria-label"));
    }
  }
  return hiding;
}"""
"""Pictures whose legend lies on a curve's box."""


@of("bench", "calibration", widths=(800,))
def test_no_legend_hides_a_curve(page: Any):
    assert page.locator("svg g[id^=legend]").count() > 0
    assert page.evaluate(HIDING) == []


GAP = """() => {
  const main = document.querySelector("article") ?? document.body, shown = [];
  const words = document.createTreeWalker(main, NodeFilter.SHOW_TEXT);
  while (words.nextNode()) {
    if (!words.currentNode.textContent.trim()) continue;
    const range = document.createRange();
    range.selectNodeContents(words.currentNode);
    shown.push(...range.getClientRects());
  }
  for (const picture of main.querySelectorAll("img, svg")) shown.push(picture.getBoundingClientRect());
  const ends = shown.filter((box) => box.width > 0 && box.top < innerHeight).sort((a, b) => a.top - b.top);
  let reached = 0, gap = 0;
  for (const box of ends) { gap = Math.max(gap, box.top - reached); reached = Math.max(reached, box.bottom); }
  return Math.max(gap, Math.min(innerHeight, main.getBoundingClientRect().bottom) - reached);
}"""
"""px: the tallest stretch of the first screen with neither text nor picture."""


@of(*NAMES)
def test_no_first_screen_is_empty(page: Any):
    assert page.evaluate(GAP) < 200


@of(*NAMES, widths=(800,), schemes=("light", "dark"))
def test_axe_finds_no_serious_fault(page: Any):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    found = axe.run(page).response["violations"]
    serious = [
        f"{v['id']}: {v['nodes'][0]['html'][:120]}" for v in found if v["impact"] in ("serious", "critical")
    ]

    assert serious == []


@pytest.mark.skipif("view" not in OWN, reason="plotly is not installed")
@of("view", widths=(400, 800))
def test_legend_and_texts_of_a_view_have_the_plot_s_size(page: Any):
    """The style of other pictures, which scale with the page, would cut them."""
    found = page.evaluate("document.querySelector('#plot .main-svg').getBoundingClientRect().width")
    expected = page.evaluate("document.getElementById('plot').clientWidth")

    assert found == pytest.approx(expected, abs=1.0)


@pytest.mark.skipif("view" not in OWN, reason="plotly is not installed")
@of("view", widths=(400, 800), schemes=("light", "dark"))
def test_the_axes_of_a_view_lie_within_the_plot(page: Any):
    """Lines and labels keep away from its left and right edge, also after the window was wider."""
    wide, high = page.viewport_size["width"], page.viewport_size["height"]
    for width in (wide, 1000, wide):
        page.set_viewport_size({"width": width, "height": high})
        page.wait_for_function(DRAWN, arg=width)
        page.wait_for_timeout(DRAWN_AFTER)
    plot = imread(io.BytesIO(page.locator("#plot").screenshot()))[:-LEGEND, :, :3]
    is_ink = (np.abs(plot - plot[0, 0]) > 0.05).any(axis=(0, 2))

    assert is_ink.sum() > 0.4 * len(is_ink), "the plot is drawn"
    assert not is_ink[:EDGE].any()
    assert not is_ink[-EDGE:].any()


DRAWN = (
    "width => plot.clientWidth < width && plot.clientWidth === plot.querySelector('.main-svg').clientWidth"
)
DRAWN_AFTER = 500
"""ms, in which WebGL draws."""
LEGEND, EDGE = 150, 8
"""px, of the legend's height and of the edges."""
