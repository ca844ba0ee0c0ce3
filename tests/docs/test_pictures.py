"""The pictures of docs/images are what their scripts draw, and their text can be read at a width of 400 px."""

from __future__ import annotations

import re
import sys
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree

import pytest
from blocks import ROOT

sys.path.insert(0, str(ROOT / "docs"))
import picture
from pictures import canvas, link_frames, speed

NAMES = tuple(f"{name}.svg" for name in picture.MODULES)


@pytest.mark.parametrize("name", NAMES)
def test_a_picture_is_what_its_script_draws(name: str):
    stored = (picture.IMAGES / name).read_text(encoding="utf-8")

    assert stored == picture.pictures()[name](), f"python docs/picture.py {name} draws it anew"


@pytest.mark.parametrize("name", NAMES)
def test_a_picture_is_a_file_for_both_schemes(name: str):
    text = (picture.IMAGES / name).read_text(encoding="utf-8")
    root = ElementTree.fromstring(text)

    assert root.get("viewBox", "").startswith(f"0 0 {canvas.WIDTH} ")
    assert len(root.get("aria-label", "")) > 60
    assert "prefers-color-scheme: dark" in text
    assert not re.search(r"https?://(?!www\.w3\.org)", text)


def test_no_text_is_small():
    sizes = [float(size) for size in re.findall(r"(?:font: |font-size: )([\d.]+)px", canvas.STYLE)]

    assert min(sizes) >= canvas.SMALLEST


@pytest.mark.parametrize("name", NAMES)
def test_no_text_leaves_the_picture_or_lies_on_another(name: str, monkeypatch: pytest.MonkeyPatch):
    drawn: list[canvas.Canvas] = []

    class Kept(canvas.Canvas):
        def __init__(self, height: float, says: str, title: str = "") -> None:
            super().__init__(height, says, title)
            drawn.append(self)

    module = sys.modules[picture.pictures()[name].__module__]
    monkeypatch.setattr(module, "Canvas", Kept)
    module.draw()
    texts = drawn[0].texts

    assert [words for left, right, _, words in texts if left < 6 or right > canvas.WIDTH - 4] == []
    assert [words for *_, y, words in texts if not 14 < y < drawn[0].height - 6] == []
    assert [(a[3], b[3]) for a, b in combinations(texts, 2) if _overlap(a, b)] == []


def test_an_overlap_is_found():
    here = canvas.Canvas(100, "")
    here.text(10, 20, "one text")
    here.text(50, 28, "another")

    assert _overlap(here.texts[0], here.texts[1])


def test_speeds_are_those_of_the_table():
    table = """| robot | inverse dynamics | mass matrix |
|---|---|---|
| KR6 | 47.0 (14.1× / 3.2×) | 33 (11.5× / 4.5×) |
"""

    assert speed.table(table, "KR6") == [
        speed.Bars("inverse dynamics", 47.0, 47.0 * 3.2, 47.0 * 14.1),
        speed.Bars("mass matrix", 33.0, 33.0 * 4.5, 33.0 * 11.5),
    ]
    with pytest.raises(ValueError, match="no 'time"):
        speed.table(table.replace("47.0 (", "47.0 ["), "KR6")


def test_a_named_picture_is_drawn_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(picture, "IMAGES", tmp_path)
    monkeypatch.setattr(sys, "argv", ["picture.py", link_frames.NAME])
    picture.main()

    assert [path.name for path in tmp_path.iterdir()] == [link_frames.NAME]


def _overlap(a: tuple[float, float, float, str], b: tuple[float, float, float, str]) -> bool:
    return abs(a[2] - b[2]) < 12 and a[0] < b[1] and b[0] < a[1]
