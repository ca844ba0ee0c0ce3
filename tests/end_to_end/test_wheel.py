"""What is published: sdist and wheel hold all that psdmc needs, and the installed wheel does README's first commands."""

from __future__ import annotations

import os
import re
import site
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest
from installed import need
from unoptimised import wrapper

from psdmc.version import VERSION

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with both, built from the files that git knows, without a network."""
    pytest.importorskip("build")
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("dist")
    need("git")
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


def test_the_sdist_is_whole(built: Path):
    (sdist,) = built.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}

    assert {"pyproject.toml", "README.md", "LICENSE", "psdmc/version.py", "templates/header.h.jinja"} <= names
    assert "CHANGELOG.md" in names


def environment_with(wheel: Path, folder: Path) -> Path:
    """An environment of its own in `folder` with that wheel; it shares nothing but the dependencies."""
    environment = folder / "environment"
    venv.create(environment, symlinks=True)
    python = environment / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", str(python), "install", "-q"]
    subprocess.run([*pip, "--no-deps", "--no-index", str(wheel)], check=True)
    packages = next((environment / "lib").glob("python*/site-packages"))
    beside = "".join(f"import site; site.addsitedir({path!r})\n" for path in site.getsitepackages())
    (packages / "dependencies.pth").write_text(beside, encoding="utf-8")
    return environment


def test_the_installed_wheel_does_what_readme_shows_first(built: Path, tmp_path: Path):
    """In an environment of its own, far from the checkout."""
    (wheel,) = built.glob("*.whl")
    environment = environment_with(wheel, tmp_path)
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


def in_a_bare_shell(command: str, environment: Path, folder: Path) -> str:
    """Standard output of a command in `folder`, with no variables but HOME and PATH."""
    done = subprocess.run(
        ["sh", "-c", command],
        cwd=folder,
        env={"HOME": str(folder), "PATH": f"{environment / 'bin'}:/usr/local/bin:/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{command}\n{done.stderr}"
    return done.stdout


def works_in_a_bare_shell(wheel: Path, folder: Path) -> None:
    environment = environment_with(wheel, folder)
    robot = ROOT / "examples/robots/two_link.toml"

    assert in_a_bare_shell("psdmc --version", environment, folder) == f"psdmc {VERSION}\n"
    where = in_a_bare_shell("python -c 'import psdmc; print(psdmc.__file__)'", environment, folder)
    assert where.startswith(str(environment))
    in_a_bare_shell(f"psdmc derive '{robot}' -o arm.npz && psdmc emit-c arm.npz -o arm", environment, folder)
    assert (folder / "arm/include/two_link/two_link.h").is_file()


def test_the_wheel_works_in_a_bare_shell(built: Path, tmp_path: Path):
    (wheel,) = built.glob("*.whl")

    works_in_a_bare_shell(wheel, tmp_path)


@pytest.mark.slow
def test_the_sdist_s_wheel_is_the_same_and_works_in_a_bare_shell(built: Path, tmp_path: Path):
    """What pip makes of the sdist, as it would for `pip install psdmc-VERSION.tar.gz`."""
    (sdist,), (shipped,) = built.glob("*.tar.gz"), built.glob("*.whl")
    command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-index", "--no-build-isolation"]
    subprocess.run([*command, "--wheel-dir", str(tmp_path / "made"), str(sdist)], check=True)
    (made,) = (tmp_path / "made").glob("*.whl")

    assert contents(made) == contents(shipped)
    works_in_a_bare_shell(made, tmp_path)


def contents(wheel: Path) -> dict[str, bytes]:
    """The files of a wheel."""
    with zipfile.ZipFile(wheel) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


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
