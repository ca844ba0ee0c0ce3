"""What is published: sdist and wheel hold all that psdmc needs, and the installed wheel does README's first commands."""

from __future__ import annotations

import os
import re
import shutil
import site
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest
from unoptimised import wrapper

from psdmc.version import VERSION

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with both, built from the files that git knows, without a network."""
    pytest.importorskip("build")
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("dist")
    if shutil.which("git") is None:
        pytest.skip("git is not installed")
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if listed.returncode:
        pytest.skip("no git checkout")
    for name in listed.stdout.splitlines():
        if (ROOT / name).is_file() and not name.startswith(("tests/", "benchmarks/")):
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            (source / name).write_bytes((ROOT / name).read_bytes())
    command = [
        sys.executable,
        "-m",
        "build",
        "--no-isolation",
        "--skip-dependency-check",
        "--outdir",
        str(out),
        str(source),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return out


def needed() -> set[str]:
    """Every file of the package that is no test: sources, templates, words and stubs."""
    package = {str(path.relative_to(ROOT)) for path in (ROOT / "psdmc").rglob("*") if path.suffix in SUFFIXES}
    templates = {f"psdmc/{path.relative_to(ROOT)}" for path in (ROOT / "templates").rglob("*.jinja")}
    return package | templates | {"psdmc/py.typed"}


SUFFIXES = {".py", ".pyi", ".txt", ".cpp", ".hpp"}


def test_the_wheel_is_pure_and_whole(built: Path):
    (wheel,) = built.glob("*.whl")
    names = set(zipfile.ZipFile(wheel).namelist())

    assert wheel.name == f"psdmc-{VERSION}-py3-none-any.whl"
    assert needed() - names == set()
    assert not any("__pycache__" in name or name.startswith("tests") for name in names)


def test_the_sdist_builds_the_same(built: Path):
    (sdist,) = built.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}

    assert {"pyproject.toml", "README.md", "LICENSE", "psdmc/version.py", "templates/header.h.jinja"} <= names


def test_the_installed_wheel_does_what_readme_shows_first(built: Path, tmp_path: Path):
    """In an environment of its own that shares nothing but the dependencies, far from the checkout."""
    (wheel,) = built.glob("*.whl")
    environment = tmp_path / "environment"
    venv.create(environment, symlinks=True)
    python = environment / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", str(python), "install", "-q"]
    subprocess.run([*pip, "--no-deps", "--no-index", str(wheel)], check=True)
    folder = next((environment / "lib").glob("python*/site-packages"))
    beside = "".join(f"import site; site.addsitedir({path!r})\n" for path in site.getsitepackages())
    (folder / "dependencies.pth").write_text(beside, encoding="utf-8")
    (tmp_path / "work").mkdir()
    (tmp_path / "work/examples").symlink_to(ROOT / "examples")

    for command in first_commands():
        done = subprocess.run(
            ["sh", "-c", command],
            cwd=tmp_path / "work",
            env=os.environ
            | {
                "PATH": f"{environment / 'bin'}{os.pathsep}{os.environ['PATH']}",
                "CC": str(wrapper(tmp_path)),
            },
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{command}\n{done.stderr}"
    where = subprocess.run(
        [python, "-c", "import psdmc; print(psdmc.__file__)"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert where.stdout.startswith(str(environment))


def first_commands() -> list[str]:
    """The commands of README's first block."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    block = re.search(r"^```console\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert block is not None
    return [line.removeprefix("$ ") for line in block[1].splitlines() if line.startswith("$ ")]


def test_one_version_everywhere():
    cited = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)

    assert cited is not None
    assert cited[1] == VERSION
