"""emit-c --check: whether a committed package is what this model and this psdmc write."""

from __future__ import annotations

import json
import os
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model
from command_line import files_in, typed

from psdmc import compiler
from psdmc.backends.manifest import MANIFEST
from psdmc.errors import InputError
from psdmc.model.calibrated_json import from_json
from psdmc.model.dynamics_model import DynamicsModel


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A package that is up to date, and its model beside it."""
    bundled_model("two_link").save(tmp_path / "arm.npz")
    done = typed("emit-c", "arm.npz", "--functions", "gravity,jacobian", "--trig", "libm", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    return tmp_path / "arm"


def checked(package: Path, *more: str):
    before = files_in(package) if package.is_dir() else {}
    done = typed("emit-c", "arm.npz", "--check", *more, cwd=package.parent)
    assert (files_in(package) if package.is_dir() else {}) == before, "it wrote"
    return done


def test_a_package_as_psdmc_writes_it_is_up_to_date(package: Path) -> None:
    (package / "build").mkdir()
    (package / "build" / "libtwo_link.a").write_bytes(b"of the user's compiler")

    done = checked(package)

    assert (done.returncode, done.stdout, done.stderr) == (0, "arm: up to date\n", "")


def test_the_hook_of_pre_commit_is_this_command(package: Path) -> None:
    text = (Path(__file__).parents[2] / ".pre-commit-hooks.yaml").read_text()
    (entry,) = (line.partition("entry: ")[2] for line in text.splitlines() if "entry:" in line)

    assert typed(*entry.split()[1:], "arm.npz", "-o", "arm", cwd=package.parent).stdout == "arm: up to date\n"


def test_it_lists_each_file_that_differs(package: Path) -> None:
    with (package / "src" / "gravity.c").open("a") as stream:
        stream.write("/* mine */\n")
    (package / "LICENSE").unlink()
    (package / "README.md").unlink()
    (package / "README.md").symlink_to(package / "Makefile")
    content = json.loads((package / MANIFEST).read_text())
    (package / "src" / "old.c").write_text("")
    content["files"]["src/old.c"] = "of a release that still had it"
    (package / MANIFEST).write_text(json.dumps(content))

    done = checked(package)

    assert done.returncode == 5
    assert done.stdout.splitlines() == [
        "arm: differs from what psdmc writes for arm.npz",
        "  changed  src/gravity.c",
        "  changed  README.md",
        "  changed  manifest.json",
        "  missing  LICENSE",
        "  added    src/old.c",
    ]


def test_it_says_if_the_model_or_psdmc_is_another(package: Path) -> None:
    model = bundled_model("two_link")
    replace(model, theta_b=2 * np.asarray(model.theta_b)).save(package.parent / "arm.npz")
    text = (package / MANIFEST).read_text()
    version = json.loads(text)["psdmc_version"]
    (package / MANIFEST).write_text(
        text.replace(f'"psdmc_version": "{version}"', '"psdmc_version": "0.0\\u001b[2J"')
    )

    done = checked(package)

    assert done.returncode == 5
    assert "  changed  src/gravity.inc\n" in done.stdout
    assert done.stdout.endswith(
        f"note: psdmc 0.0\\x1b[2J wrote the package, and this is {version}\n"
        "note: the package was emitted from another model\n"
    )

    (package / MANIFEST).write_text(text.replace('"psdmc_version"', '"psdmc_versiom"'))
    assert "note: manifest.json is damaged: it does not say which psdmc wrote" in checked(package).stdout


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("--functions jacobian,gravity --trig libm --lowering auto --name two_link", "up to date"),
        ("--real float32", "--real contradicts manifest.json: psdmc emitted the package with float64"),
        ("--trig inline", "--trig contradicts manifest.json: psdmc emitted the package with libm"),
        (
            "--functions gravity",
            "--functions contradicts manifest.json: psdmc emitted the package with others",
        ),
        ("--with casadi", "--with contradicts manifest.json: psdmc emitted the package without it"),
        ("--payload", "--payload contradicts manifest.json: psdmc emitted the package without it"),
        ("--force", "--check writes nothing"),
        ("-o gone", "gone: not a package: manifest.json is missing or is not psdmc's"),
    ],
)
def test_options_must_be_the_recorded_ones(package: Path, words: str, expected: str) -> None:
    done = checked(package, *shlex.split(words))

    assert expected in done.stdout + done.stderr
    assert done.returncode == (0 if expected == "up to date" else 2)
    assert len(done.stderr.splitlines()) == (0 if expected == "up to date" else 2)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"options": {}}, "does not say with which lowering"),
        ({"functions": [{"name": 3}]}, "does not say with which functions"),
        ({"functions": [{"name": "gravitas"}]}, "function 'gravitas' is not known"),
        ({"name": None}, "does not say with which name"),
        ({"backend": "../c"}, "does not say with which back end"),
        ({"generator": "another"}, "not a package"),
    ],
)
def test_a_forged_manifest_is_refused_in_one_line(
    package: Path, change: dict[str, object], expected: str
) -> None:
    content = json.loads((package / MANIFEST).read_text())
    (package / MANIFEST).write_text(json.dumps(content | change))

    done = checked(package)

    assert done.returncode == 2
    assert expected in done.stderr.splitlines()[0]


def test_rust_packages_are_checked_by_emit(tmp_path: Path) -> None:
    bundled_model("two_link").save(tmp_path / "arm.npz")
    typed("emit", "arm.npz", "--backend", "rust", "--functions", "gravity", cwd=tmp_path)

    assert typed("emit", "arm.npz", "--check", cwd=tmp_path).stdout == "arm: up to date\n"
    assert "type psdmc emit --backend rust --check" in checked(tmp_path / "arm").stderr


def calibrated(model: DynamicsModel) -> DynamicsModel:
    terms = ("coulomb", "viscous", "offset")
    rows = [{"joint": joint, "name": name, "value": 1.0} for name in terms for joint in model.joint_names]
    prediction = {"law": "linear", "exponents": [1.0], "sign_speed": 0.03}
    return replace(model, calibrated=from_json({"friction": rows, "prediction": prediction}))


@pytest.mark.parametrize(
    "options",
    [
        {"payload": True, "name": "an arm"},
        {"bodies": True, "lowering": "factored"},
        {"friction": True, "adapters": "casadi"},
        {"target": "cortex-m4f"},
        {"real": "float32", "functions": ["gravity", "inverse_dynamics", "forward_dynamics_vjp"]},
        {},
    ],
    ids=str,
)
def test_every_option_is_recorded(tmp_path: Path, options: dict[str, object]) -> None:
    model = calibrated(bundled_model("scara"))
    compiler.emit_c(model, tmp_path / "arm", **{"functions": "gravity", **options})  # type: ignore[arg-type]

    assert not compiler.compare_emitted(model, tmp_path / "arm")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_a_package_that_cannot_be_read_is_an_error(package: Path) -> None:
    (package / MANIFEST).chmod(0)

    with pytest.raises(InputError, match="cannot be read"):
        compiler.compare_emitted(package.parent / "arm.npz", package)
