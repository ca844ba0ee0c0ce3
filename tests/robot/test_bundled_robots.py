"""The bundled robots: bodies that can be, and each published inertia that no body has beside the one that replaces it."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bundled import ROBOTS, bundled_robot, robot_path

OURS = sorted(path.stem for path in ROBOTS.iterdir() if not path.stem.endswith("_published"))
THINNEST = 0.01
"""Least share of a body's largest second moment, as the files' first lines say."""
WRITTEN = 0.5e-6
"""kg m^2, half of the last digit in the files."""


@pytest.mark.parametrize("name", OURS)
def test_no_bundled_robot_has_a_body_that_cannot_be(name: str) -> None:
    assert [note for note in bundled_robot(name).chain.notes if "not physical" in note] == []


@pytest.mark.parametrize("name", OURS)
def test_second_moments_of_bundled_bodies_are_not_negative(name: str) -> None:
    if robot_path(name).suffix != ".toml":
        pytest.skip("a URDF")
    for row in read(robot_path(name))["joint"]:
        if not any(zero.startswith("I") for zero in row["link"].get("zero", ())):
            assert np.linalg.eigvalsh(second_moments(row["link"])).min() >= -1e-18


@pytest.mark.parametrize(("name", "replaced"), [("kr6", [5]), ("lbr7", [4, 6])])
def test_replaced_inertias_are_the_nearest_to_the_published_ones(name: str, replaced: list[int]) -> None:
    """The nearest matrix whose eigenvalues are bounded below has the same eigenvectors and bounded eigenvalues."""
    ours, published = read(robot_path(name)), read(robot_path(f"{name}_published"))
    for k, (own, theirs) in enumerate(zip(ours["joint"], published["joint"], strict=True), start=1):
        if k not in replaced:
            assert own == theirs
            continue
        values, axes = np.linalg.eigh(second_moments(theirs["link"]))
        assert values[0] < 0.0
        nearest = (axes * np.maximum(values, THINNEST * values[-1])) @ axes.T
        expected = np.trace(nearest) * np.eye(3) - nearest
        assert np.abs(inertia(own["link"]) - expected).max() <= WRITTEN + 1e-12
        own["link"]["inertia_com"] = theirs["link"]["inertia_com"]
        assert own == theirs
    assert ours | {"name": ""} == published | {"name": ""}


def read(path: Path) -> dict[str, Any]:
    return tomllib.loads(path.read_text(encoding="utf-8"))


def inertia(link: dict[str, Any]) -> np.ndarray:
    """(3, 3) about the centre of mass, kg m^2."""
    value = link["inertia_com"]
    rows = (("xx", "xy", "xz"), ("xy", "yy", "yz"), ("xz", "yz", "zz"))
    return np.array([[value[name] for name in row] for row in rows])


def second_moments(link: dict[str, Any]) -> np.ndarray:
    """(3, 3) about the centre of mass, kg m^2: of any body positive semidefinite."""
    return np.trace(inertia(link)) / 2 * np.eye(3) - inertia(link)
