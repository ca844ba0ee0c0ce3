"""Packages of each target: what its machine has is in them, nothing else; a changed field changes its files."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from small import pendulum, pendulum_references

from psdmc.backends.c.back_end import package_files
from psdmc.backends.info import EmitOptions
from psdmc.target.presets import CORTEX_M4F, NATIVE, PRESETS, SCALAR, X86_64_V3, preset
from psdmc.target.target import AVX, Target

NAMES = tuple(PRESETS)


def files(target: Target) -> dict[str, str]:
    """The pendulum's package for a target, in its own precision and sines."""
    options = EmitOptions(target.real, target.trig, target)
    return package_files(pendulum(options=options, references=pendulum_references()))


def changed(target: Target) -> set[str]:
    """Files of the default package that another target writes otherwise; the manifest lists digests of them."""
    before, after = files(NATIVE), files(target)
    return {path for path in before if before[path] != after.get(path)} - {"manifest.json"}


@pytest.mark.parametrize("name", NAMES)
def test_lanes_are_the_same_for_every_target(name: str) -> None:
    lanes = {"float64": 8, "float32": 16}[preset(name).real]
    assert f"#define pendulum_LANES {lanes}\n" in files(preset(name))["include/pendulum/pendulum.h"]


@pytest.mark.parametrize("name", NAMES)
def test_header_and_manifest_say_which_target(name: str) -> None:
    target, made = preset(name), files(preset(name))
    header, manifest = made["include/pendulum/pendulum.h"], json.loads(made["manifest.json"])

    assert (f"target={name}" in header) == (target != NATIVE)
    assert manifest["options"].get("target", "native") == name
    assert manifest.get("target", {}).get("flags", []) == list(target.flags)
    assert all(" ".join(target.flags) in made[path] for path in ("Makefile", "CMakeLists.txt", "README.md"))


def test_each_width_is_in_the_package_of_its_machine_alone() -> None:
    widths = {
        name: {
            text for text in (2, 4, 8) if f"#define WIDTH {text}\n" in files(preset(name))["src/vectors.h"]
        }
        for name in NAMES
    }
    assert widths["native"] == {8, 4, 2}
    assert widths["x86-64-v2"] == widths["neon"] == {2}
    assert (widths["x86-64-v3"], widths["x86-64-v4"]) == ({4}, {8})
    assert widths["scalar"] == widths["cortex-m4f"] == widths["cortex-m7"] == set()


@pytest.mark.parametrize(("name", "narrower"), [("native", True), ("x86-64-v4", True), ("x86-64-v3", False)])
def test_one_states_angles_may_have_narrower_vectors_than_lanes(name: str, narrower: bool) -> None:
    made = files(preset(name))
    assert ("#define ANGLE_WIDTH 4\n" in made["src/vectors.h"]) == narrower
    assert "#define ANGLE_WIDTH WIDTH\n" in made["src/vectors.h"]
    assert "pendulum_sincos_near_f64x4(" in made["src/sincos.h"]


@pytest.mark.parametrize("name", ["scalar", "cortex-m4f", "cortex-m7"])
def test_without_vectors_no_vector_code_is_left(name: str) -> None:
    sources = "".join(text for path, text in files(preset(name)).items() if path.startswith("src/"))
    for word in ("vector_size", "SHUFFLE", "transpose", "__builtin_ia32", "UNROLL", "fetch_ahead"):
        assert word not in sources


def test_a_microcontroller_has_no_batches_no_texts_and_no_shared_library() -> None:
    made = files(CORTEX_M4F)
    whole = "".join(text for path, text in made.items() if path != "manifest.json")

    assert "_batch" not in whole
    assert "joint_names" not in whole
    assert ".so" not in made["Makefile"]
    assert "-fPIC" not in made["Makefile"]
    assert not {"src/rows.h", "src/lane_states.h", "src/groups.h"} & set(made)
    assert (
        "double" not in made["src/inverse_dynamics.inc"] + made["include/pendulum/pendulum.h"].split("*/")[1]
    )
    assert "math.h" not in made["src/sincos.h"]


def test_scalar_keeps_every_function() -> None:
    def prototypes(target: Target) -> list[str]:
        functions = json.loads(files(target)["manifest.json"])["functions"]
        return [
            text for function in functions for kernel in function["kernels"] for text in kernel["prototypes"]
        ]

    assert prototypes(SCALAR) == prototypes(NATIVE)
    assert len(prototypes(CORTEX_M4F)) < len(prototypes(NATIVE))


SAID = {"include/pendulum/pendulum.h", "README.md"}
"""Files that name the target."""


@pytest.mark.parametrize(
    ("change", "touched"),
    [
        ({"cache_line": 128}, {"src/internal.h"}),
        ({"blocks_ahead": 5}, {"src/internal.h"}),
        ({"host_flags": ("-mcpu=native",)}, {"Makefile", "CMakeLists.txt"}),
        ({"vectors": (AVX,)}, {"src/vectors.h", "src/sincos.h"}),
        ({"texts": False}, {"include/pendulum/pendulum.hpp", "src/tables.c"}),
    ],
)
def test_a_changed_field_changes_the_files_that_it_is_about(
    change: dict[str, object], touched: set[str]
) -> None:
    assert changed(replace(NATIVE, **change)) - SAID == touched  # type: ignore[arg-type]


def test_flags_of_a_target_are_in_its_builds() -> None:
    made = files(replace(X86_64_V3, flags=("-march=znver3", "-mtune=znver3")))
    assert "TARGET_FLAGS ?= -march=znver3 -mtune=znver3\n" in made["Makefile"]
    assert 'TARGET_FLAGS "-march=znver3 -mtune=znver3"' in made["CMakeLists.txt"]
