"""The notebooks of examples/ run from top to bottom, hold no outputs, and their claims, asserted in them, hold."""

from __future__ import annotations

from pathlib import Path

import pytest
from slow_cases import slow_but_for
from unoptimised import wrapper

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
SECONDS = 300
"""Of one cell at most: compilers run in some."""


def test_there_are_four() -> None:
    assert len(NOTEBOOKS) == 4


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_outputs(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    assert all(
        not cell.outputs and cell.execution_count is None for cell in notebook.cells if "outputs" in cell
    )


@pytest.mark.parametrize("path", slow_but_for(NOTEBOOKS[:1], NOTEBOOKS), ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What it compiles is not optimised: no assertion of theirs is about speed."""
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.setenv("CC", str(wrapper(tmp_path)))
    notebook = nbformat.read(path, as_version=4)
    client = nbclient.NotebookClient(notebook, timeout=SECONDS, resources={"metadata": {"path": str(FOLDER)}})
    client.execute()
    wrong = [out for cell in notebook.cells for out in cell.get("outputs", ()) if out.get("name") == "stderr"]
    assert not wrong
    assert any(cell.get("outputs") for cell in notebook.cells)
