"""What a type checker sees of psdmc: every public name and what a user asks of it, none of it Any."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path

import pytest

import psdmc

ROOT = Path(__file__).parent.parent

CLIENT = """
import numpy as np
import psdmc

model = psdmc.derive("robot.urdf", frames="tool0")
robot = psdmc.compile(model, functions="gravity")
single = psdmc.compile("model.npz", real="float32")
q = np.zeros(6)
"""

PUBLIC = [f"psdmc.{name}" for name in psdmc.__all__]
OF_MODELS = [
    *("model.n", "model.l", "model.p", "model.E", "model.theta_b", "model.joint_names", "model.mechanism"),
    *("model.base_parameters", "model.base_parameters[0].equation", "model.base_parameters.to_latex()"),
    *("model.to_latex()", "model.content_hash", "model.inverse_dynamics(q, q, q)", "model.mass_matrix(q)"),
    *("model.certificate", "model.with_payload(1.0, [0, 0, 0.1])", "psdmc.load('m.npz')"),
    *("model.gravity(q, theta_b=q, out=q)", "model.theta_for(q, q, q)", "model.q_names", "model.link_names"),
    *("model.gravity(q, theta_b=q, out=q)", "model.theta_for(q, q, q)", "model.q_names", "model.link_names"),
]
OF_ROBOTS = [
    *("robot", "robot.n", "robot.nq", "robot.joint_names", "robot.limits.lower", "robot.theta_b"),
    *("robot.gravity_acceleration", "robot.dtype", "robot.functions", "robot.library"),
    *("robot.inverse_dynamics(q, q, q, out=q)", "robot.forward_dynamics(q, q, q)", "robot.gravity(q)"),
    *("robot.inverse_dynamics_derivatives(q, q, q).dtau_dq", "robot.forward_kinematics(q).position"),
    *("single", "single.gravity(q)"),
]
OF_ERRORS = ["psdmc.InputError('a', 'b').hint", "psdmc.InputError('a').message"]


WRONG = {
    "psdmc.deriv('robot.urdf')": "has no attribute",
    "robot.inverse_dynamic(q, q, q)": "has no attribute",
    "robot.gravity(q, q, q)": "Too many",
    "psdmc.compile(model, real='float16')": "No overload",
    "model.n + 'x'": "Unsupported operand",
}
"""Lines that a type checker refuses, and words of what it says."""


def revealed(folder: Path, lines: str) -> subprocess.CompletedProcess[str]:
    client = folder / "client.py"
    client.write_text(CLIENT + lines, encoding="utf-8")
    words = ["-m", "mypy", "--strict", "--config-file=", f"--cache-dir={ROOT / '.mypy_cache' / 'client'}"]
    words += ["--follow-imports=silent", "--ignore-missing-imports", str(client)]
    here = {**os.environ, "MYPYPATH": str(ROOT)}  # an editable installation is found by import hooks alone
    return subprocess.run(
        [sys.executable, *words], cwd=folder, env=here, capture_output=True, text=True, check=False
    )


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    pytest.importorskip("mypy")
    wanted = [*PUBLIC, *OF_MODELS, *OF_ROBOTS, *OF_ERRORS]
    done = revealed(tmp_path_factory.mktemp("client"), "".join(f"reveal_type({name})\n" for name in wanted))
    assert done.returncode == 0, done.stdout
    types = re.findall(r'note: Revealed type is "(.*)"', done.stdout)
    return dict(zip(wanted, types, strict=True))


def without_shapes(text: str) -> str:
    """Without NumPy's own Any: how many axes an array has is no part of its type."""
    return text.replace("tuple[Any, ...]", "shape")


@pytest.mark.slow
@pytest.mark.parametrize("name", [*PUBLIC, *OF_MODELS, *OF_ROBOTS, *OF_ERRORS])
def test_nothing_is_any(seen: dict[str, str], name: str) -> None:
    result = without_shapes(seen[name]).rpartition(" -> ")[2]
    assert not re.search(r"\bAny\b", result), seen[name]


@pytest.mark.slow
def test_precision_is_part_of_the_type(seen: dict[str, str]) -> None:
    assert "float64" in seen["robot.gravity(q)"]
    assert "32" in seen["single.gravity(q)"]


def test_wrong_lines_are_found(tmp_path: Path) -> None:
    pytest.importorskip("mypy")
    done = revealed(tmp_path, "".join(f"{line}\n" for line in WRONG))
    assert done.returncode == 1
    first = len(CLIENT.splitlines()) + 1
    found = dict(re.findall(r"client\.py:(\d+): error: (.*)", done.stdout))
    assert set(found) == {str(first + k) for k in range(len(WRONG))}
    for k, complaint in enumerate(WRONG.values()):
        assert complaint in found[str(first + k)]


def test_the_version_stands_in_one_place() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["project"]["dynamic"] == ["version"]
    assert project["tool"]["setuptools"]["dynamic"]["version"]["attr"] == "psdmc.version.VERSION"
    assert psdmc.__version__ == version("psdmc")
    found = [
        path
        for path in (ROOT / "psdmc").rglob("*.py")
        if f'"{psdmc.__version__}"' in path.read_text(encoding="utf-8")
    ]
    assert found == [ROOT / "psdmc" / "version.py"]


def test_the_marker_of_typed_packages_is_packed() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert "py.typed" in project["tool"]["setuptools"]["package-data"]["psdmc"]
    assert (ROOT / "psdmc" / "py.typed").is_file()
