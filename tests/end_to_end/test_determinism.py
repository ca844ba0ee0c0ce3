"""Same input, same bytes: model file and C package, under several PYTHONHASHSEEDs, in processes and with caches of their
own, and whatever instructions BLAS takes its sums with."""

from __future__ import annotations

from pathlib import Path

import pytest
from bundled import robot_path
from command_line import files_in, typed
from slow_cases import slow_but_for

SEEDS = {"two_link": ("0", "1", "4242"), "denso_wall": ("0", "4242")}
"""Of each robot: of the larger one, whose emission takes seconds, two."""


@pytest.mark.parametrize("name", slow_but_for(["two_link"], SEEDS))
def test_same_model_and_same_c(name: str, tmp_path: Path):
    made = []
    for seed in SEEDS[name]:
        folder = tmp_path / seed
        folder.mkdir()
        for words in (("derive", robot_path(name), "-o", "m.npz"), ("emit-c", "m.npz", "-o", "c")):
            done = typed(
                *words, cwd=folder, PYTHONHASHSEED=seed, PSDMC_CACHE_DIR=str(tmp_path / f"cache {seed}")
            )
            assert done.returncode == 0, done.stderr
        made.append(files_in(folder))

    assert "m.npz" in made[0]
    assert len(made[0]) > 5
    for other in made[1:]:
        assert list(other) == list(made[0])
        assert [path for path, content in other.items() if content != made[0][path]] == []


@pytest.mark.parametrize("name", slow_but_for(["rounded_arm"], ["kr6", "rounded_arm"]))
def test_another_processors_blas_gives_the_same_bytes(name: str, tmp_path: Path):
    """OpenBLAS gives other last digits there. tests/derivation/test_same_bytes.py has more robots and settings."""
    cpu = Path("/proc/cpuinfo")
    if not cpu.is_file() or " avx2 " not in cpu.read_text():
        pytest.skip("this processor cannot run both of OpenBLAS's kernels")
    made = []
    for kernels in ("Sandybridge", "Haswell"):
        folder = tmp_path / kernels
        folder.mkdir()
        functions = "inverse_dynamics,mass_matrix,forward_dynamics"
        for words in (
            ("derive", robot_path(name), "-o", "m.npz"),
            ("emit-c", "m.npz", "-o", "c", "--functions", functions),
        ):
            own = {"OPENBLAS_CORETYPE": kernels, "PSDMC_CACHE_DIR": str(tmp_path / f"cache {kernels}")}
            done = typed(*words, cwd=folder, **own)
            assert done.returncode == 0, done.stderr
        made.append(files_in(folder))

    assert len(made[0]) > 20
    assert made[0] == made[1]
