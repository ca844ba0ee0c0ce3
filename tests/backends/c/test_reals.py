"""Numbers that float32 has no room for: written without a warning, or refused."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from installed import need
from small import INVERSE, kernel, pendulum, pendulum_info

from psdmc.backends.c.back_end import package_files
from psdmc.backends.c.expressions import rounded_out
from psdmc.backends.c.package import package_view
from psdmc.backends.info import EmitOptions, JointInfo
from psdmc.errors import InputError

FLOAT32 = EmitOptions(real="float32")
ODD = JointInfo("hinge", "revolute", -1e39, 3.4028235e38, 3.40282357e38, 1e-40, 1e-60)
"""Limits beyond float32, its largest, one that rounds to it, a subnormal one and one below all."""


@given(st.floats(allow_nan=False))
def test_rounding_is_numpys(value: float) -> None:
    found = rounded_out(value, "float")
    with np.errstate(over="ignore"):
        assert np.float32(found) == np.float32(value)
        assert np.isinf(found) == np.isinf(np.float32(value))
    assert rounded_out(value, "double") == value


@pytest.mark.parametrize("real", ["float32", "float64"])
@pytest.mark.parametrize(
    ("compiler", "kind"), [("gcc", "h"), ("clang", "h"), ("g++", "hpp"), ("clang++", "hpp")]
)
def test_limits_beyond_single_precision_do_not_warn(
    compiler: str, kind: str, real: str, tmp_path: Path
) -> None:
    need(compiler)
    info = replace(pendulum_info(), joints=(ODD,))
    files = package_files(pendulum(info, EmitOptions(real=real)))  # type: ignore[arg-type]
    for path, text in files.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    source = tmp_path / "src" / "tables.c"
    if kind == "hpp":
        source = tmp_path / "main.cpp"
        largest = "std::numeric_limits<double>::infinity()" if real == "float32" else "1e39"
        check = f"static_assert(pendulum::Robot::position_lower[0] == -{largest});\n"
        source.write_text('#include "pendulum/pendulum.hpp"\n' + check)
    words = [compiler, "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only", f"-I{tmp_path}/include"]
    standard = "-std=c99" if kind == "h" else "-std=c++17"
    done = subprocess.run([*words, standard, str(source)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:2000]


def test_constants_below_single_precision_do_not_warn() -> None:
    text = INVERSE.replace("const 0.25", "const 1e-60")
    files = package_files(
        package_view(pendulum_info(), {"inverse_dynamics": kernel("inverse_dynamics", text)}, FLOAT32)
    )
    assert "0.0f * qdd_0" in files["src/inverse_dynamics.inc"]


def test_a_parameter_beyond_single_precision_is_refused_by_name() -> None:
    info = pendulum_info()
    large = (replace(info.parameters[0], value=1e39), info.parameters[1])
    with pytest.raises(
        InputError, match=r"base parameter 'Izz1 \+ m1 0.5\^2' is 1e\+39, more than float32's 3.40282e\+38"
    ) as caught:
        pendulum(replace(info, parameters=large), FLOAT32)
    assert "--real float64" in str(caught.value.hint)
    pendulum(replace(info, parameters=large))


def test_a_constant_beyond_single_precision_is_refused() -> None:
    text = INVERSE.replace("const 0.25", "const 1e39")
    with pytest.raises(InputError, match="a constant of inverse_dynamics is 1e"):
        package_view(pendulum_info(), {"inverse_dynamics": kernel("inverse_dynamics", text)}, FLOAT32)
