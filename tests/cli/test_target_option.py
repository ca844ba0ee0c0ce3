"""`psdmc emit-c --target`: what a user types, sees and is refused."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from bundled import bundled_model
from command_line import status

import psdmc
from psdmc.errors import InputError
from psdmc.target.presets import PRESETS


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("model") / "two_link.npz"
    bundled_model("two_link_full").save(path)
    return path


def emit(model: Path, folder: Path, *options: str) -> int | str | None:
    """Exit status of `psdmc emit-c`."""
    words = ["emit-c", str(model), "-o", str(folder), "--functions", "gravity", *options]
    return status(*words)


@pytest.mark.parametrize(
    ("options", "real", "trig"),
    [
        ((), "float32", "freestanding"),
        (("--real", "float64"), "float64", "freestanding"),
        (("--trig", "libm"), "float32", "libm"),
    ],
)
def test_precision_and_sines_are_the_targets_unless_chosen(
    model: Path, tmp_path: Path, options: tuple[str, ...], real: str, trig: str
) -> None:
    assert emit(model, tmp_path / "arm", "--target", "cortex-m4f", *options) in (0, None)

    chosen = json.loads((tmp_path / "arm" / "manifest.json").read_text())["options"]
    assert (chosen["target"], chosen["real"], chosen["trig"]) == ("cortex-m4f", real, trig)


def test_the_default_is_native_and_says_nothing(model: Path, tmp_path: Path) -> None:
    for folder, options in (("plain", ()), ("named", ("--target", "native"))):
        assert emit(model, tmp_path / folder, *options) in (0, None)
    texts = [
        {path.name: path.read_bytes() for path in sorted((tmp_path / folder).rglob("*.*"))}
        for folder in ("plain", "named")
    ]
    assert texts[0] == texts[1]
    assert b"target=" not in texts[0]["two_link_full.h"]


def test_an_unknown_target_is_refused_in_a_line_with_the_list(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert emit(model, tmp_path / "arm", "--target", "cortex-m5\x1b") == 2

    said = capsys.readouterr().err.splitlines()
    assert said == [
        r"error: target is 'cortex-m5\x1b'",
        f"hint: choose one of {', '.join(PRESETS)}",
    ]
    assert not (tmp_path / "arm").exists()


def test_help_lists_every_target(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "400")
    assert status("emit-c", "--help") == 0
    shown = capsys.readouterr().out
    assert all(name in shown for name in PRESETS)


def test_adapters_need_shared_libraries(tmp_path: Path) -> None:
    found = bundled_model("two_link_full")
    with pytest.raises(InputError, match="target cortex-m7 has no shared libraries, which casadi loads"):
        psdmc.emit_c(found, tmp_path / "arm", adapters=["casadi"], target="cortex-m7")


@pytest.mark.parametrize(("name", "in_c"), [("panda-tcp", "panda_tcp"), ("int", "robot_int"), ("arm", None)])
def test_another_name_in_c_is_told(
    name: str, in_c: str | None, model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert emit(model, tmp_path / "arm", "--name", name) in (0, None)

    said = capsys.readouterr().out
    assert (f"note: the C name of '{name}' is {in_c}\n" in said) if in_c else ("note:" not in said)
    assert (tmp_path / "arm" / "include" / (in_c or name) / f"{in_c or name}.h").is_file()
