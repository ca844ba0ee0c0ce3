"""The settings that stand for other processors: each takes effect, and one that does not is refused."""

from __future__ import annotations

import platform

import pytest
from machines import DISABLE, FOUND, SETTINGS, TUNABLES, chosen_by, faults_of, run_under, settings_of


@pytest.mark.parametrize("name", SETTINGS)
def test_every_setting_takes_effect(name: str) -> None:
    assert faults_of(SETTINGS[name]) == []


@pytest.mark.skipif(platform.machine() != "x86_64", reason="OpenBLAS has these kernels on x86-64 only")
def test_a_setting_without_effect_is_a_fault(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
):
    assert faults_of({DISABLE: "X86_V9"}) == ["NumPy found no feature X86_V9 that could be disabled"]
    assert "OpenBLAS uses kernels for " in faults_of({"OPENBLAS_CORETYPE": "Babbage"})[0]
    assert "OpenBLAS uses " in faults_of({"OPENBLAS_NUM_THREADS": "none"})[0]

    if TUNABLES in SETTINGS["nehalem"]:
        assert faults_of({TUNABLES: "glibc.cpu.hwcaps=-NOTHING"}) == ["the C library's sines are the same"]

    monkeypatch.setitem(SETTINGS, "old", {"OPENBLAS_CORETYPE": "Babbage"})
    assert run_under("old", ["echo", "computed"]) == 1
    out, err = capfd.readouterr()
    assert "computed" not in out
    assert err.startswith("error: setting old has no effect: OpenBLAS uses kernels for ")


@pytest.mark.skipif(platform.machine() != "x86_64", reason="OpenBLAS has these kernels on x86-64 only")
def test_a_command_runs_under_a_setting_with_an_empty_cache(capfd: pytest.CaptureFixture[str]) -> None:
    assert run_under("nehalem", ["sh", "-c", "echo $OPENBLAS_CORETYPE; ls $PSDMC_CACHE_DIR; exit 3"]) == 3
    out, err = capfd.readouterr()
    assert out.splitlines()[1:] == ["Nehalem"]
    assert "psdmc-machine-" in err  # ls: no such folder
    assert run_under("typo", ["true"]) == 2


def test_settings_follow_the_machine() -> None:
    assert list(settings_of("aarch64", (), 1)) == []
    assert list(settings_of("x86_64", (), 1)) == ["nehalem"]
    new, old = ("X86_V3", "X86_V4", "AVX512_ICL"), ("AVX2", "FMA3", "AVX512F")
    assert settings_of("x86_64", new, 2)["numpy-without-avx512"][DISABLE] == "X86_V4 AVX512_ICL"
    assert settings_of("x86_64", old, 2)["numpy-baseline"][DISABLE] == "AVX2 FMA3 AVX512F"
    assert DISABLE not in settings_of("x86_64", FOUND, 2)["two-threads"]


def test_commits_choose_every_setting() -> None:
    assert {chosen_by(f"{number:040x}") for number in range(len(SETTINGS))} == set(SETTINGS)
