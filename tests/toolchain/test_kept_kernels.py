"""Lowerings in the compile cache: made once, made anew where anything changed, never in the way."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import psdmc
from psdmc.errors import InputError
from psdmc.functions import SIGNATURES
from psdmc.program.kernel import Kernel
from psdmc.program.text import parse
from psdmc.toolchain import compile
from psdmc.toolchain.compile import KERNELS, lowered_once


class Counted:
    """A lowering that counts its calls."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self) -> dict[str, Kernel]:
        self.calls += 1
        program = parse("a = load q[0]\ns = sin a\nout g[0] = s")
        return {"gravity": Kernel(SIGNATURES["gravity"], False, program, program, "factored")}


def calls(parts: tuple[str, ...], then: Callable[[], None] = lambda: None) -> int:
    """How often a lowering runs when asked for twice, with something done between."""
    lower = Counted()
    first = lowered_once(("hash", "auto"), lower)
    then()
    assert lowered_once(parts, lower) == first
    return lower.calls


def test_an_equal_call_is_lowered_once(own_cache: Path) -> None:
    assert calls(("hash", "auto")) == 1


@pytest.mark.parametrize("parts", [("other", "auto"), ("hash", "factored"), ("hash", "auto", "some")])
def test_another_model_or_option_is_lowered_anew(own_cache: Path, parts: tuple[str, ...]) -> None:
    assert calls(parts) == 2


def test_edited_sources_lower_anew(own_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def edit() -> None:
        monkeypatch.setattr(compile, "sources_digests", lambda: ("edited",))

    assert calls(("hash", "auto"), edit) == 2


def test_a_damaged_entry_is_lowered_anew(own_cache: Path) -> None:
    def damage() -> None:
        (kept,) = own_cache.glob(f"*/{KERNELS}")
        kept.write_text(kept.read_text()[:-9])

    assert calls(("hash", "auto"), damage) == 2


def test_a_cache_that_cannot_be_used_costs_only_time(own_cache: Path) -> None:
    own_cache.write_text("a file, not a folder")

    assert calls(("hash", "auto")) == 2


def test_an_error_of_the_lowering_is_the_callers(own_cache: Path) -> None:
    def fail() -> dict[str, Kernel]:
        raise InputError("no such function")

    with pytest.raises(InputError):
        lowered_once(("hash",), fail)
    assert not list(own_cache.glob(f"*/{KERNELS}"))


def test_emission_from_kept_kernels_writes_the_same_bytes(own_cache: Path, tmp_path: Path) -> None:
    model = psdmc.derive(Path(__file__).parents[2] / "examples" / "robots" / "two_link.toml")
    for folder in ("first", "second"):
        psdmc.emit_c(model, tmp_path / folder)

    assert list(own_cache.glob(f"*/{KERNELS}"))
    texts = [
        {path.name: path.read_bytes() for path in sorted((tmp_path / folder).rglob("*.?"))}
        for folder in ("first", "second")
    ]
    assert texts[0] == texts[1]
