"""Templates' compiled code is kept beside them, as Python keeps that of modules, and believed only where it belongs."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from jinja2 import DictLoader, Environment

from psdmc.backends import render as kept_templates
from psdmc.backends.c.render import environment
from psdmc.backends.render import CodeBesideTemplates

NAME = "rates.h.jinja"
SOURCE = "{% for x in rates %}\n{{ x }};\n{% endfor %}"


@pytest.fixture(autouse=True)
def _modules_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    monkeypatch.setattr(sys, "pycache_prefix", None)


def made(folder: Path, source: str = SOURCE, *, may_compile: bool = True, **options: bool) -> Environment:
    """What a process of its own would set up; one that may not compile fails where it has to."""
    fresh = Environment(
        loader=DictLoader({NAME: source}), bytecode_cache=CodeBesideTemplates(folder), **options
    )
    if not may_compile:

        def refuse(*given: object) -> None:
            raise AssertionError("compiled again")

        fresh._compile = refuse  # type: ignore[assignment, method-assign]
    return fresh


def filled(env: Environment) -> str:
    return env.get_template(NAME).render(rates=[1, 2])


def kept(folder: Path) -> Path:
    (file,) = (folder / "__pycache__").iterdir()
    return file


def test_a_template_is_compiled_once(tmp_path: Path) -> None:
    first = filled(made(tmp_path))
    assert filled(made(tmp_path, may_compile=False)) == first == "\n1;\n\n2;\n"


def test_an_edited_template_is_compiled_again(tmp_path: Path) -> None:
    filled(made(tmp_path))
    assert filled(made(tmp_path, SOURCE.replace(";", ","))) == "\n1,\n\n2,\n"
    assert filled(made(tmp_path)) == "\n1;\n\n2;\n"


def test_other_options_of_jinja_are_other_code(tmp_path: Path) -> None:
    filled(made(tmp_path))
    assert filled(made(tmp_path, trim_blocks=True)) == "1;\n2;\n"


def test_another_jinja_is_another_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    filled(made(tmp_path))
    monkeypatch.setattr(kept_templates, "_jinja", lambda: (0, 0))
    with pytest.raises(AssertionError, match="compiled again"):
        filled(made(tmp_path, may_compile=False))


@pytest.mark.parametrize("place", [0, 40, -1])
def test_altered_code_is_not_believed_and_made_again(tmp_path: Path, place: int) -> None:
    expected = filled(made(tmp_path))
    content = bytearray(kept(tmp_path).read_bytes())
    content[place] ^= 1
    kept(tmp_path).write_bytes(content)
    with pytest.raises(AssertionError, match="compiled again"):
        filled(made(tmp_path, may_compile=False))
    assert filled(made(tmp_path)) == expected
    assert filled(made(tmp_path, may_compile=False)) == expected


@pytest.mark.parametrize("length", [0, 10, 32, 60])
def test_code_cut_short_is_made_again(tmp_path: Path, length: int) -> None:
    expected = filled(made(tmp_path))
    kept(tmp_path).write_bytes(kept(tmp_path).read_bytes()[:length])
    assert filled(made(tmp_path)) == expected


def test_a_folder_that_cannot_be_written_to_costs_time_only(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    assert filled(made(tmp_path / "file")) == "\n1;\n\n2;\n"


def test_nothing_is_kept_where_python_keeps_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    filled(made(tmp_path))
    assert not (tmp_path / "__pycache__").exists()


def test_code_goes_where_python_is_told_to_keep_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "pycache_prefix", str(tmp_path / "elsewhere"))
    filled(made(tmp_path / "templates"))
    assert not (tmp_path / "templates").exists()
    assert [path for path in (tmp_path / "elsewhere").rglob("*") if path.is_file()]
    assert filled(made(tmp_path / "templates", may_compile=False))


def test_psdmc_keeps_the_code_of_its_templates() -> None:
    assert isinstance(environment().bytecode_cache, CodeBesideTemplates)
