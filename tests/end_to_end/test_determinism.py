"""Same input, same bytes: model file and C package, under three PYTHONHASHSEEDs and in processes of their own."""

from __future__ import annotations

from pathlib import Path

import pytest
from bundled import robot_path
from command_line import files_in, typed

SEEDS = ("0", "1", "4242")


@pytest.mark.parametrize("name", ["two_link", "denso_wall"])
def test_same_model_and_same_c(name: str, tmp_path: Path):
    made = []
    for seed in SEEDS:
        folder = tmp_path / seed
        folder.mkdir()
        for words in (("derive", robot_path(name), "-o", "m.npz"), ("emit-c", "m.npz", "-o", "c")):
            done = typed(*words, cwd=folder, PYTHONHASHSEED=seed)
            assert done.returncode == 0, done.stderr
        made.append(files_in(folder))

    assert "m.npz" in made[0]
    assert len(made[0]) > 5
    for other in made[1:]:
        assert list(other) == list(made[0])
        assert [path for path, content in other.items() if content != made[0][path]] == []
