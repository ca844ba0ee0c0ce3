"""What a terminal and a notebook show of a model."""

from __future__ import annotations

from dataclasses import replace
from html.parser import HTMLParser

import pytest
from bundled import ROBOTS, bundled_model

from psdmc.model.dynamics_model import DynamicsModel

NAMES = sorted(path.stem for path in ROBOTS.iterdir() if path.suffix in {".toml", ".urdf"})
HOSTILE = "<script>alert('x')</script>\x1b[31m & more"


class Tables(HTMLParser):
    """Counts tags, and holds that each is closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.open.append(tag)
        self.seen.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.mark.parametrize("name", NAMES)
def test_a_repr_has_at_most_twelve_lines(name: str) -> None:
    model = bundled_model(name)
    lines = repr(model).splitlines()
    assert len(lines) <= 12
    assert max(map(len, lines)) <= 200
    assert f"l = {model.l} base parameters" in repr(model)
    assert str(model) == repr(model)


def test_two_link_as_a_reader_sees_it() -> None:
    assert repr(bundled_model("two_link")).splitlines()[:4] == [
        "DynamicsModel 'two_link': 2 joints, 'base' to 'link2', standard DH frames",
        "  joints: 'shoulder' revolute, 'elbow' revolute",
        "  gravity: 0 -9.81 0 m/s^2 in the base frame",
        "  p = 10 monomials, l = 4 base parameters, theta_b known",
    ]


def renamed(model: DynamicsModel, name: str) -> DynamicsModel:
    joints = tuple(replace(joint, name=f"{name}{k}") for k, joint in enumerate(model.mechanism.joints))
    return replace(model, mechanism=replace(model.mechanism, name=name, joints=joints))


def test_names_of_files_stay_names() -> None:
    """Neither markup of a notebook nor the terminal's control characters."""
    model = renamed(bundled_model("two_link"), HOSTILE)
    assert "\x1b" not in repr(model)
    assert "<script" not in model._repr_html_()
    assert "&lt;script&gt;" in model._repr_html_()


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_gets_joints_and_base_parameters(name: str) -> None:
    model = bundled_model(name)
    found = Tables()
    found.feed(model._repr_html_())
    assert not found.open
    assert found.seen.count("table") == 2
    assert found.seen.count("tr") == model.n + model.l + 2


def test_what_is_unknown_is_said() -> None:
    unknown = replace(bundled_model("two_link"), theta_b=None, expansion=None)
    assert "no E and P, l = 4 base parameters, theta_b unknown" in repr(unknown)
    assert r"\text{unknown}" in unknown._repr_latex_()
