"""The package's files: golden text for a pendulum, metadata, determinism, and the rules for templates."""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
import sys
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from direct import declarations
from installed import need
from small import (
    FORWARD,
    INVERSE,
    kernel,
    pendulum,
    pendulum_info,
    pendulum_kernels,
    pendulum_references,
)

from psdmc.backends.c.back_end import package_files
from psdmc.backends.c.package import package_view
from psdmc.backends.info import EmitOptions
from psdmc.backends.reference_states import ReferenceStates
from psdmc.errors import InputError, InternalError

GOLDEN = Path(__file__).parents[2] / "golden" / "pendulum"
REFERENCES = pendulum_references()
SHOWN = (
    "include/pendulum/pendulum.h",
    "include/pendulum/pendulum.hpp",
    "src/inverse_dynamics.c",
    "src/inverse_dynamics.inc",
    "src/inverse_dynamics_theta.inc",
    "src/forward_dynamics.c",
    "src/forward_dynamics.inc",
    "src/tables.c",
    "test/compare.h",
    "test/layouts.h",
    "test/reference.h",
    "test/self_test.c",
)


@pytest.mark.parametrize("path", SHOWN)
def test_the_text_is_the_golden_one(path: str) -> None:
    text = package_files(pendulum(references=REFERENCES))[path]
    golden = GOLDEN / Path(path).name
    if os.environ.get("PSDMC_REWRITE_GOLDEN"):
        golden.parent.mkdir(parents=True, exist_ok=True)
        golden.write_text(text, encoding="utf-8")
    assert text == golden.read_text(encoding="utf-8"), (
        "run with PSDMC_REWRITE_GOLDEN=1 and review the difference"
    )


def test_text_ends_with_one_newline_and_has_no_trailing_blanks() -> None:
    for path, text in package_files(pendulum(references=REFERENCES)).items():
        assert text.endswith("\n"), path
        assert not text.endswith("\n\n"), path
        assert not re.search(r"[ \t]+$", text, re.MULTILINE), path


def test_every_file_of_c_says_its_licence_and_the_package_holds_it() -> None:
    files, spdx = package_files(pendulum(references=REFERENCES)), "SPDX-License-Identifier"
    for path, text in files.items():
        if path.endswith((".c", ".h", ".hpp", ".inc")):
            assert text.splitlines()[0] == f"/* {spdx}: 0BSD */", path

    assert "It is yours" in files["LICENSE"]
    assert "It is yours, without any obligation" in files["include/pendulum/pendulum.h"]
    assert "<license>0BSD</license>" in files["package.xml"]


def test_the_order_of_kernels_does_not_matter() -> None:
    turned = dict(reversed(pendulum_kernels().items()))
    again = package_view(pendulum_info(), turned, EmitOptions(), REFERENCES)
    assert package_files(again) == package_files(pendulum(references=REFERENCES))


def test_the_text_is_the_same_under_every_hash_seed() -> None:
    script = (
        "import hashlib, json; from small import pendulum; from psdmc.backends.c.back_end import package_files;"
        "print(hashlib.sha256(json.dumps(package_files(pendulum())).encode()).hexdigest())"
    )
    here = str(Path(__file__).parent)
    found = set()
    for seed in ("0", "1", "4242"):
        environment = {**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": here}
        done = subprocess.run(
            [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True
        )
        found.add(done.stdout)
    assert len(found) == 1
    own = hashlib.sha256(json.dumps(package_files(pendulum())).encode()).hexdigest()
    assert found == {own + "\n"}


def test_no_path_date_or_host_is_in_the_text() -> None:
    text = "".join(package_files(pendulum(references=REFERENCES)).values())
    for foreign in (os.getcwd(), str(Path.home()) + "/", os.uname().nodename + " ", "202"):
        assert foreign not in text.replace("0.202", "")


def test_the_manifest_says_what_is_in_the_package() -> None:
    files = package_files(pendulum(references=REFERENCES))
    content = json.loads(files["manifest.json"])
    assert content["schema"] == 1
    assert content["robot"] == "pendulum"
    assert content["model_hash"] == "00ff"
    assert content["options"] == {"lowering": "auto", "real": "float64", "trig": "inline"}
    assert content["gravity_m_s2"] == [0.0, -9.81, 0.0]
    limits = {"lower": -3.1, "speed": 4.0, "upper": 3.1}
    (joint,) = content["joints"]
    assert joint == {
        "name": "hinge",
        "kind": "revolute",
        "unit": "rad",
        "effort_unit": "N m",
        "limits": limits,
    }
    first, second = content["base_parameters"]
    assert (first["index"], first["name"], first["unit"]) == (0, f"theta_b[0] {first['equation']}", "kg m^2")
    assert (second["index"], second["name"], second["unit"]) == (
        1,
        f"theta_b[1] {second['equation']}",
        "kg m",
    )
    assert content["files"] == {
        path: hashlib.sha256(text.encode()).hexdigest()
        for path, text in files.items()
        if path != "manifest.json"
    }


def test_the_header_and_cffi_know_the_same_functions() -> None:
    package = pendulum()
    header = package_files(package)["include/pendulum/pendulum.h"]
    known = re.findall(r"\b(pendulum_\w+)\(", header)
    assert known == re.findall(r"\b(pendulum_\w+)\(", declarations(package))
    assert known == [
        "pendulum_inverse_dynamics",
        "pendulum_inverse_dynamics_batch",
        "pendulum_inverse_dynamics_batch_soa",
        "pendulum_inverse_dynamics_theta",
        "pendulum_inverse_dynamics_theta_batch",
        "pendulum_forward_dynamics",
        "pendulum_forward_dynamics_batch",
        "pendulum_forward_dynamics_batch_soa",
    ]


NASTY = [
    'a; system("x")',
    "int",
    "机器人",
    "x" * 300,
    "*/ int evil; /*",
    '"; int evil; "',
    "a\\\nint evil;",
    "{{ 7*7 }}",
]


@pytest.mark.parametrize("name", NASTY)
def test_no_name_reaches_the_c_text_unescaped(name: str, tmp_path: Path) -> None:
    files = package_files(pendulum(pendulum_info(name, joint=name), references=REFERENCES))
    for path, text in files.items():
        assert path.isascii()
        target = tmp_path / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text, encoding="ascii")
    flags = ["-std=c99", "-trigraphs", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only"]
    sources = [str(tmp_path / path) for path in files if path.endswith(".c")]
    done = subprocess.run(
        ["gcc", *flags, f"-I{tmp_path}/include", *sources], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    whole = "".join(text for path, text in files.items() if path.endswith((".c", ".h", ".hpp", ".inc")))
    code = re.sub(r'/\*.*?\*/|"(?:[^"\\]|\\.)*"', "", whole, flags=re.DOTALL)
    assert "evil" not in code.replace(json.loads(files["manifest.json"])["robot"], "")
    assert "system" not in code.replace("a_system_x", "")


@pytest.mark.parametrize("real", ["float64", "float32"])
@pytest.mark.parametrize("name", ["pendulum", *NASTY])
def test_the_cpp_header_takes_any_name_and_precision(name: str, real: str, tmp_path: Path) -> None:
    need("g++")
    package = pendulum(pendulum_info(name, joint=name), EmitOptions(real=real))  # type: ignore[arg-type]
    files = package_files(package)
    for kind in ("h", "hpp"):
        (tmp_path / package.robot).mkdir(exist_ok=True)
        (tmp_path / package.robot / f"{package.robot}.{kind}").write_text(
            files[f"include/{package.robot}/{package.robot}.{kind}"], encoding="ascii"
        )
    (tmp_path / "main.cpp").write_text(
        f'#include "{package.robot}/{package.robot}.hpp"\n'
        f"static_assert(::{package.robot}::Robot::speed_limit[0] == 4);\n"
        f"static_assert(::{package.robot}::Robot::effort_limit[0] > 1e30f);\n"
    )
    flags = ["-std=c++17", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror", "-fsyntax-only"]
    words = ["g++", *flags, f"-I{tmp_path}", str(tmp_path / "main.cpp")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_single_and_batch_orders_that_differ_get_a_file_each() -> None:
    other = INVERSE.replace("add Ja ws", "add ws Ja")
    kernels = {"inverse_dynamics": kernel("inverse_dynamics", INVERSE, batch=other)}
    files = package_files(package_view(pendulum_info(), kernels, EmitOptions()))
    assert "inverse_dynamics_lanes.inc" in files["src/inverse_dynamics.c"]
    assert files["src/inverse_dynamics_lanes.inc"] != files["src/inverse_dynamics.inc"]


def test_single_precision_constants_and_types() -> None:
    files = package_files(pendulum(options=EmitOptions(real="float32")))
    assert "0.25f * qdd_0 + 4.905f * sin_0" in files["src/inverse_dynamics.inc"]
    assert "double" not in files["include/pendulum/pendulum.h"]
    assert "#define pendulum_LANES 16" in files["include/pendulum/pendulum.h"]


def test_unknown_parameters_are_nan_in_the_tables_and_null_in_the_manifest() -> None:
    info = pendulum_info()
    blank = type(info.parameters[0])("mx1", "kg m", None)
    unknown = type(info)(
        **{**{f: getattr(info, f) for f in info.__dataclass_fields__}, "parameters": (blank,) * 2}
    )
    files = package_files(pendulum(unknown, references=REFERENCES))
    assert files["src/tables.c"].count("(double)NAN") == 2
    assert json.loads(files["manifest.json"])["base_parameters"][0]["value"] is None


def test_nothing_to_emit_is_said() -> None:
    with pytest.raises(InputError, match="no functions to emit"):
        package_view(pendulum_info(), {}, EmitOptions())


def test_a_kernel_under_another_name_is_an_internal_error() -> None:
    with pytest.raises(InternalError, match="not its own"):
        package_view(pendulum_info(), {"gravity": kernel("inverse_dynamics", INVERSE)}, EmitOptions())


def test_a_kernel_may_only_name_its_functions_vectors() -> None:
    with pytest.raises(ValueError, match=r"pivot\[0\]"):
        kernel("inverse_dynamics", FORWARD.replace("tau[0]", "q[0]").replace("qdd[0]", "tau[0]"))


def test_references_of_another_robot_are_refused() -> None:
    two = {name: np.zeros((3, 2)) for name in REFERENCES.given}
    with pytest.raises(ValueError, match="2 entries of q, expected 1"):
        pendulum(references=ReferenceStates(two, {}, np.zeros(2)))
    with pytest.raises(ValueError, match=r"qd have shape \(3, 2\), expected \(2, k\)"):
        ReferenceStates({**two, "q": np.zeros((2, 1))}, {}, np.zeros(2))
    with pytest.raises(ValueError, match=r"gravity have shape \(2, 2\), expected \(3, k\)"):
        ReferenceStates(two, {"gravity": np.zeros((2, 2))}, np.zeros(2))


def _templates() -> list[str]:
    root = resources.files("psdmc.templates")
    return sorted(entry.name for entry in root.iterdir() if entry.name.endswith(".jinja"))


@pytest.mark.parametrize("name", _templates())
def test_templates_are_short_and_name_their_view_first(name: str) -> None:
    lines = resources.files("psdmc.templates").joinpath(name).read_text(encoding="utf-8").splitlines()
    assert len(lines) < 80
    assert lines[0].startswith("{#-")
    assert lines[0].endswith("-#}")
