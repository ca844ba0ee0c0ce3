"""Interfaces in the compile cache: a package is made once, and made again where anything is not as it was."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from traced import arm_package

import psdmc
from psdmc import emission
from psdmc.backends.c.package import PackageView
from psdmc.errors import InputError, InternalError
from psdmc.toolchain import compile
from psdmc.toolchain.call import CompiledRobot
from psdmc.toolchain.compile import INTERFACE, LIBRARY, compiled_once
from psdmc.toolchain.interface import interface_from_json, interface_of, interface_to_json

PARTS = ("hash", "auto", "float64")
TRIG = [file.name for file in (resources.files("psdmc.templates") / "trig").iterdir()]


class Counted:
    """A package that is made, and how often it was."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self) -> PackageView:
        self.calls += 1
        return arm_package(names=["gravity"])


def calls(
    parts: tuple[str, ...] = PARTS, then: Callable[[], None] = lambda: None, same_library: bool = True
) -> int:
    """How often a package is made for two calls, with something done between; both libraries work."""
    make = Counted()
    first = compiled_once(PARTS, make)
    expected = CompiledRobot(*first).gravity([0.1, 0.2, 0.3, 0.4])
    then()
    second = compiled_once(parts, make)
    assert second[0] == first[0]
    assert (second[1] == first[1]) == same_library
    np.testing.assert_array_equal(CompiledRobot(*second).gravity([0.1, 0.2, 0.3, 0.4]), expected)
    return make.calls


def test_an_equal_call_makes_no_package(own_cache: Path) -> None:
    assert calls() == 1


@pytest.mark.parametrize("parts", [("other", "auto", "float64"), ("hash", "factored", "float64")])
def test_another_model_or_option_makes_one(own_cache: Path, parts: tuple[str, ...]) -> None:
    assert calls(parts) == 2


@pytest.fixture
def editable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A copy of everything that decides a package's bytes, which the cache's key is made of in place of psdmc's own."""
    copies = {}
    for package in ("psdmc", "psdmc.templates"):
        copies[package] = tmp_path / "sources" / package
        shutil.copytree(
            str(resources.files(package)), copies[package], ignore=shutil.ignore_patterns("__pycache__")
        )
    monkeypatch.setattr(resources, "files", copies.__getitem__)
    yield tmp_path / "sources"
    forget_digests()


def forget_digests() -> None:
    compile._emission.cache_clear()
    compile.sources_digests.cache_clear()


@pytest.mark.parametrize(
    "file",
    [
        "psdmc.templates/trig/" + min(TRIG),
        "psdmc.templates/header.h.jinja",
        "psdmc/backends/c/reserved/libraries.txt",
        "psdmc/reproducible.py",
        "psdmc/lower/factored.py",
        "psdmc/toolchain/direct_call.c",
    ],
)
def test_an_edited_source_makes_one(own_cache: Path, editable: Path, file: str) -> None:
    def edit() -> None:
        with (editable / file).open("a") as source:
            source.write("\n")
        forget_digests()

    forget_digests()
    assert calls(then=forget_digests) == 1
    assert calls(then=edit) == 1  # the first of its two calls finds what the line above has made


def test_another_compiler_makes_one(own_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = compile.find_compiler()

    def update() -> None:
        monkeypatch.setattr(compile, "find_compiler", lambda target: replace(found, version="newer"))

    assert calls(then=update, same_library=False) == 2


def test_damage_heals(own_cache: Path) -> None:
    """Of the interface, which is made again, and of the library, which is compiled again."""

    def cut(name: str) -> None:
        (path,) = own_cache.glob(f"*/{name}")
        content = path.read_bytes()[:-9]
        path.unlink()  # a library that is cut in place takes this process with it
        path.write_bytes(content)

    def remove_library() -> None:
        (path,) = own_cache.glob(f"*/{LIBRARY}")
        path.unlink()

    assert calls(then=lambda: cut(INTERFACE)) == 2
    for damage in (lambda: cut(LIBRARY), remove_library):
        make = Counted()
        before = compiled_once(PARTS, make)
        damage()
        assert compiled_once(PARTS, make) == before
        assert make.calls == 1
        assert CompiledRobot(*before).gravity([0.1, 0.2, 0.3, 0.4]).shape == (4,)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda whole: {},
        lambda whole: whole | {"format": 0},
        lambda whole: whole | {"interface": {}},
        lambda whole: whole | {"interface": whole["interface"] | {"kernels": [1]}},
        lambda whole: whole | {"interface": whole["interface"] | {"more": 1}},
        lambda whole: [],
    ],
)
def test_text_of_another_making_is_refused(spoil: Callable[[dict], object]) -> None:
    text = interface_to_json(interface_of(arm_package(names=["gravity"])), "key")

    assert interface_from_json(text) == (interface_of(arm_package(names=["gravity"])), "key")
    with pytest.raises(InternalError, match="interface cannot be read"):
        interface_from_json(json.dumps(spoil(json.loads(text))))


def test_a_key_is_no_path(own_cache: Path) -> None:
    assert calls() == 1
    (kept,) = own_cache.glob(f"*/{INTERFACE}")
    for forged in ("../cache", "/etc", "", kept.parent.name.upper()):
        kept.write_text(interface_to_json(interface_of(arm_package(names=["gravity"])), forged))
        assert compile._opened(kept.parent) is None


def test_an_error_of_the_making_is_the_callers(own_cache: Path) -> None:
    def fail() -> PackageView:
        raise InputError("no such function")

    with pytest.raises(InputError):
        compiled_once(PARTS, fail)
    assert not list(own_cache.glob(f"*/{INTERFACE}"))


def test_a_second_compile_of_a_model_neither_lowers_nor_renders(
    own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = psdmc.derive(Path(__file__).parents[2] / "examples" / "robots" / "two_link.toml")
    functions = ["inverse_dynamics", "forward_dynamics"]
    first = psdmc.compile(model, functions=functions)

    def never(*arguments: object) -> None:
        raise AssertionError("made again")

    monkeypatch.setattr(emission, "lowered_once", never)
    monkeypatch.setattr(emission, "package_view", never)
    second = psdmc.compile(model, functions=functions)

    states = np.random.default_rng(0).normal(size=(3, 7, 2))
    theta = 1.1 * model.theta_b
    for robot in (first, second):
        assert robot.joint_names == model.joint_names
        np.testing.assert_allclose(robot.inverse_dynamics(*states), model.inverse_dynamics(*states))
    np.testing.assert_array_equal(
        first.forward_dynamics(*states, theta_b=theta), second.forward_dynamics(*states, theta_b=theta)
    )
    with pytest.raises(AssertionError, match="made again"):
        psdmc.compile(model, functions=functions, real="float32")
    with pytest.raises(InputError, match="real is 'float16'"):
        psdmc.compile(model, functions=functions, real="float16")  # type: ignore[arg-type]
