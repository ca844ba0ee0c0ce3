"""Crates of three robots: cargo builds them without a warning, their self-tests pass, and notice wrong code."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest
from bundled import bundled_model, robot_path
from command_line import typed

import psdmc
from psdmc import backends
from psdmc.backends import BACK_ENDS
from psdmc.backends.protocol import back_end
from psdmc.backends.rust.body import KEYWORDS, comment, identifier, string
from psdmc.compiler import emit
from psdmc.errors import InputError
from psdmc.functions import DEFAULT, DEFAULT_WHERE_WIDE, OF_TREES, RECIPES

EVIL = 'a`"; \u202e*/ //! \n fn main() {} ```'
"""A robot's name."""


def cargo(folder: Path, *words: str, flags: str = "-D warnings") -> subprocess.CompletedProcess[str]:
    """A command of cargo in a crate, which reaches no network."""
    command = ["cargo", *words, "--offline", "--quiet"]
    environment = os.environ | {"RUSTFLAGS": flags, "CARGO_NET_OFFLINE": "true"}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


def passed(done: subprocess.CompletedProcess[str]) -> int:
    """How many tests passed; all did, and there were some."""
    assert done.returncode == 0, done.stdout + done.stderr
    return sum(map(int, re.findall(r"(\d+) passed; 0 failed; 0 ignored", done.stdout)))


def forms(names: tuple[str, ...]) -> int:
    """Functions of these names, baked and with theta_b, each with one output."""
    return sum(1 + RECIPES[name].signature.theta for name in names)


@pytest.mark.needs("cargo")
@pytest.mark.parametrize("name", ["kr6", "scara"])
def test_of_arms(name: str, tmp_path: Path) -> None:
    emit(bundled_model(name), tmp_path, "rust")

    assert passed(cargo(tmp_path, "test")) == forms(DEFAULT)


@pytest.mark.needs("cargo")
def test_every_function_of_a_small_robot(tmp_path: Path) -> None:
    emit(bundled_model("two_link"), tmp_path, "rust", functions=OF_TREES)

    assert passed(cargo(tmp_path, "test")) > len(OF_TREES)


@pytest.mark.slow
@pytest.mark.needs("cargo")
def test_of_a_floating_base(tmp_path: Path) -> None:
    try:
        files = metadata.distribution("example-robot-data").files or ()
    except metadata.PackageNotFoundError:
        pytest.skip("example-robot-data is not installed")
    (urdf,) = (str(each.locate()) for each in files if each.name == "hyq_no_sensors.urdf")
    emit(psdmc.derive(urdf, floating=True), tmp_path, "rust")

    assert passed(cargo(tmp_path, "test")) == forms(DEFAULT_WHERE_WIDE)


@pytest.mark.needs("cargo")
def test_wrong_code_is_noticed(tmp_path: Path) -> None:
    emit(bundled_model("two_link"), tmp_path, "rust", functions=["gravity"])
    file = tmp_path / "src" / "gravity.rs"
    file.write_text(re.sub(r"([1-9]\.\d+)", r"1.0001 * \1", file.read_text(), count=1))

    assert "tolerance" in cargo(tmp_path, "test").stdout


@pytest.mark.needs("cargo")
def test_a_name_that_is_code_and_a_machine_with_fused_products(tmp_path: Path) -> None:
    emit(bundled_model("two_link"), tmp_path, "rust", functions=["inverse_dynamics"], name=EVIL)

    assert passed(cargo(tmp_path, "test", flags="-D warnings -C target-cpu=native")) == 2
    assert cargo(tmp_path, "doc").returncode == 0


@pytest.mark.needs("cargo")
def test_without_the_standard_library(tmp_path: Path) -> None:
    emit(bundled_model("two_link"), tmp_path, "rust", functions=["gravity"])

    done = cargo(tmp_path, "test", "--no-default-features")

    assert passed(done) == 2


SINES = """
#[path = "../src/math.rs"]
mod math;

#[test]
fn sines_and_roots() {
    for k in -400_000..400_000 {
        let x = 0.37 * k as f64 + 1e-7;
        let ([s, _], [c, _]) = math::sin_cos([x, 0.5]);
        let far = !cfg!(feature = "std") && x.abs() > 1e5;
        assert!(far && s.is_nan() || (s - x.sin()).abs() < 2.3e-16 && (c - x.cos()).abs() < 2.3e-16, "{x}");
        let z = x.abs() * 10_f64.powi(k % 300);
        assert!((math::sqrt(z) / z.sqrt() - 1.0).abs() < 4.5e-16, "{z}");
    }
    assert!(math::sin_cos([f64::NAN]).0[0].is_nan() && math::sqrt(-1.0).is_nan() && math::sqrt(0.0) == 0.0);
}
"""


@pytest.mark.needs("cargo")
@pytest.mark.parametrize("words", [(), ("--no-default-features",)])
def test_sines_and_roots(words: tuple[str, ...], tmp_path: Path) -> None:
    """Against the standard library's."""
    emit(bundled_model("two_link"), tmp_path, "rust", functions=["gravity"])
    (tmp_path / "tests" / "self_test.rs").write_text(SINES)

    assert passed(cargo(tmp_path, "test", "--test", "self_test", *words, flags="")) == 1


def test_names() -> None:
    assert identifier("KR6 R900") == "kr6_r900"
    assert {identifier(word) for word in ("fn", "Self", "test", "core", "con")} == {
        *("robot_fn", "robot_self", "robot_test", "robot_core", "robot_con")
    }
    assert re.fullmatch(r"robot_[0-9a-f]{8}", identifier("机械臂"))
    assert len(identifier("x" * 200)) == 63
    assert string('a"\\\n\u202e\ud800') == '"a\\u{22}\\u{5c}\\u{a}\\u{202e}\\u{fffd}"'
    assert comment("a`\nb\u202e") == "a<60><0a>b<e2><80><ae>"


@pytest.mark.needs("rustc")
def test_keywords_are_those_of_the_compiler(tmp_path: Path) -> None:
    """Each is refused as the name of a variable, or means something else in older editions or other places."""
    weak = {"union", "gen", "auto", "default"}
    for word in sorted(KEYWORDS - weak):
        (tmp_path / "one.rs").write_text(f"pub fn f() {{ let {word} = 1; }}")
        command = ["rustc", "--edition=2021", "--crate-type=lib", "--emit=metadata", "one.rs"]
        assert subprocess.run(command, cwd=tmp_path, capture_output=True, check=False).returncode != 0, word


def test_same_bytes_for_every_seed_of_hashes(tmp_path: Path) -> None:
    found = []
    for seed in ("0", "1"):
        folder = tmp_path / seed
        code = f"from psdmc.compiler import *; emit(derive({str(robot_path('scara'))!r}), {str(folder)!r}, 'rust')"
        subprocess.run([sys.executable, "-c", code], env=os.environ | {"PYTHONHASHSEED": seed}, check=True)
        found.append({path.relative_to(folder): path.read_bytes() for path in folder.rglob("*.*")})

    assert len(found[0]) > 10
    assert found[0] == found[1]


def test_emit_for_c_is_emit_c(tmp_path: Path) -> None:
    psdmc.save(bundled_model("two_link"), tmp_path / "m.npz")
    ways = {"emit": ("emit", "m.npz"), "named": ("emit", "m.npz", "--backend", "c"), "c": ("emit-c", "m.npz")}
    for folder, words in ways.items():
        done = typed(*words, "-o", folder, "--functions", "gravity", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert f"next: psdmc build {folder}" in done.stderr

    assert shutil.which("diff")
    for folder in ("emit", "named"):
        subprocess.run(["diff", "-r", folder, "c"], cwd=tmp_path, check=True)


def test_the_command(tmp_path: Path) -> None:
    psdmc.save(bundled_model("two_link"), tmp_path / "m.npz")
    words = ("emit", "m.npz", "--backend", "rust", "--functions", "gravity", "--name", "fn", "-o", "my crate")

    done = typed(*words, cwd=tmp_path)

    assert done.returncode == 0, done.stderr
    assert "my crate/Cargo.toml: the crate, robot_fn = { path = " in done.stdout
    assert "note: the Rust name of 'fn' is robot_fn" in done.stdout
    assert "next: cargo test --manifest-path 'my crate'/Cargo.toml" in done.stderr
    assert "nothing changed" in typed(*words, cwd=tmp_path).stdout


def test_a_package_of_another_language_is_replaced_and_foreign_files_are_not(tmp_path: Path) -> None:
    model = bundled_model("two_link")
    psdmc.emit_c(model, tmp_path / "p", functions="gravity")
    changed = emit(model, tmp_path / "p", "rust", functions="gravity")
    assert "CMakeLists.txt" in changed.removed
    assert "src/lib.rs" in psdmc.emit_c(model, tmp_path / "p", functions="gravity").removed

    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "lib.rs").write_text("mine")
    with pytest.raises(InputError, match=r"lib\.rs"):
        emit(model, tmp_path / "mine", "rust")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--backend", "fortran"), "no back end 'fortran'.*\n.*choose one of c, rust, cuda"),
        (("--backend", "rust", "--payload"), "rust has no --payload.*\n.*emit-c"),
        (("--backend", "rust", "--with", "casadi"), "rust has no --with"),
        (("--backend", "rust", "--target", "cortex-m7"), "rust has no --target"),
        (("--backend", "rust", "--real", "float32"), "float64 alone.*\n.*--real"),
        (("--backend", "rust", "--functions", "x"), "x"),
    ],
)
def test_what_is_refused(words: tuple[str, ...], said: str, tmp_path: Path) -> None:
    psdmc.save(bundled_model("two_link"), tmp_path / "m.npz")

    done = typed("emit", "m.npz", "-o", "out", *words, cwd=tmp_path)

    assert done.returncode == 2
    assert re.search(said, done.stderr)
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()


def test_every_folder_with_a_back_end_is_named_in_the_help_too() -> None:
    folders = {path.parent.name for path in Path(backends.__file__).parent.glob("*/back_end.py")}
    assert folders == set(BACK_ENDS)
    assert f"language of the package: {', '.join(BACK_ENDS)}" in " ".join(typed("emit", "-h").stdout.split())
    assert all(back_end(name).files for name in BACK_ENDS)
