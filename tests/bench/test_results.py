"""Results go to JSON and back, and into a table and a page."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace

import jinja2
import pytest
from made_up_bench import made_up_result

from psdmc.bench.results import BenchResult, Unavailable, as_text
from psdmc.errors import InputError
from psdmc.report.bench_markdown import markdown
from psdmc.report.bench_page import page, write_page

BROWSER = next((path for name in ("chromium", "chromium-browser") if (path := shutil.which(name))), None)


@pytest.fixture
def result() -> BenchResult:
    return made_up_result()


def test_json_gives_the_same_result_back(result):
    assert BenchResult.from_json(result.to_json()) == result


def test_the_headline_table_gives_times_ratios_and_the_command(result):
    lines = markdown(result, "make bench").splitlines()

    assert lines[2].startswith("| Denso | 50.0 (12.0× / –) | 50.0 (20.0× / –) | – |")
    assert lines[-1].endswith("`make bench`.")


@pytest.mark.parametrize("text", ["", "[]", '{"schema": 1}', '{"schema": 99}'])
def test_foreign_json_is_one_clear_error(text):
    with pytest.raises(InputError, match="JSON"):
        BenchResult.from_json(text)


def test_ratios_are_to_the_rivals_better_way(result):
    case = result.cases[0]

    assert case.ratio("forward_dynamics", over="Pinocchio") == 20.0
    assert case.ratio("inverse_dynamics", "rows", over="Pinocchio") == 60.0
    assert case.ratio("gravity", over="Pinocchio") is None


def test_the_table_names_who_is_missing(result):
    text = as_text(result)

    assert "not measured: CasADi: the wheel 'casadi' is <not> installed" in text
    assert "psdmc factored                   state       225 + 222       50.0 ns" in text


def test_a_busy_machine_is_said_in_table_and_page(result):
    busy = replace(result, cases=(replace(result.cases[0], idle=False),))

    assert "MACHINE BUSY" in as_text(busy)
    assert "Do not trust these times" in page(busy)
    assert "Do not trust these times" not in page(result)


def test_the_page_needs_no_network_and_escapes_names(result):
    text = page(result)

    assert "src=" not in text
    assert 'href="http' not in text
    assert "&lt;not&gt; installed" in text
    assert ">20.0<" in text
    assert "17.2 µs" in text


def test_plots_take_the_pages_ink(result):
    text = page(result)

    assert "currentColor" in text
    assert "#010203" not in text
    assert text.count("<svg") == 4


def test_the_same_result_gives_the_same_page(result):
    assert page(result) == page(result)


def test_the_page_needs_only_options_that_jinja_3_1_0_has(result, monkeypatch):
    overlay = jinja2.Environment.overlay

    def first(self, *, autoescape):
        return overlay(self, autoescape=autoescape)

    monkeypatch.setattr(jinja2.Environment, "overlay", first)

    assert page(result).endswith("</html>\n")


def test_an_unwritable_page_is_one_clear_error(result, tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        write_page(result, tmp_path / "missing" / "page.html")


@pytest.mark.skipif(BROWSER is None, reason="chromium is not installed")
def test_a_browser_shows_the_page(result, tmp_path):
    write_page(result, tmp_path / "page.html")
    command = [
        str(BROWSER),
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--dump-dom",
        f"file://{tmp_path}/page.html",
    ]

    dom = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout

    assert "At a glance" in dom
    assert dom.count("<svg") == 4


def test_rivals_that_miss_the_same_are_one_line_and_an_empty_note_is_none() -> None:
    result = made_up_result()
    (case,) = result.cases
    missing = tuple(
        Unavailable(name, "Eigen's headers are missing") for name in ("Pinocchio", "CppADCodeGen")
    )
    text = as_text(
        replace(result, cases=(replace(case, note="", unavailable=(*missing, *case.unavailable)),))
    )

    assert "  not measured: Pinocchio, CppADCodeGen: Eigen's headers are missing\n" in text
    assert "Denso: n 6, p 1295, l 30; 10 trials, machine idle\n" in text
