"""A friction law of a user's own: one Python file that log.toml names, from a log to the C that has it."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bundled import bundled_model
from command_line import status
from direct import Direct, shared_library
from friction_logs import friction_log

from psdmc.backends.c.package import package_view
from psdmc.backends.info import EmitOptions, package_info
from psdmc.calibration.columns.columns import read_columns
from psdmc.calibration.logs.log_files import write_log
from psdmc.calibration.verdict.delivered import delivered_quality
from psdmc.errors import InputError
from psdmc.friction.own import laws_of, read_law
from psdmc.lower.kernels import lower
from psdmc.model.calibrated import by_joint
from psdmc.model.calibrated_json import as_json, from_json
from psdmc.model.linear_friction import linear_friction
from psdmc.model.load import load
from psdmc.model.store import save
from psdmc.program.interpret import interpret

EXAMPLE = Path(__file__).parents[3] / "examples" / "friction_laws" / "ripple.py"
COULOMB, VISCOUS, OFFSET = np.array([3.0, 1.5]), np.array([0.8, 0.3]), np.array([-0.4, 0.7])
SINES, COSINES = np.array([0.9, -0.35]), np.array([-0.5, 0.6])
SIGN_SPEED = 0.03


def friction(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Of this log; nothing here calls the laws."""
    plain = np.tanh(v / SIGN_SPEED) * (COULOMB + VISCOUS * np.abs(v)) + OFFSET
    return np.asarray(plain + SINES * np.sin(5.0 * q) + COSINES * np.cos(5.0 * q))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model, the law, and a log of Pinocchio's torques with that friction and noise; calibrated by the command."""
    folder = tmp_path_factory.mktemp("own_law")
    log, _ = friction_log(8, 40.0, friction)
    write_log(log, folder / "arm.csv")
    bundled_model("two_link_full").save(folder / "arm.npz")
    shutil.copy(EXAMPLE, folder)
    (folder / "log.toml").write_text('friction = "ripple.py"\n[[log]]\nfile = "arm.csv"\n', encoding="utf-8")
    found, page = folder / "found.npz", folder / "page.html"
    assert status("calibrate", folder / "arm.npz", folder / "log.toml", "-o", found, "--report", page) == 0
    (folder / "ripple.py").unlink()  # what follows reads the model file alone
    return folder


def test_the_fit_finds_its_values(folder: Path) -> None:
    model = load(folder / "found.npz")
    kept = model.calibrated
    assert kept is not None
    rows = {(row.joint, row.name): row for row in kept.friction}
    truth = {"coulomb": COULOMB, "viscous": VISCOUS, "ripple_sin": SINES, "ripple_cos": COSINES}
    for k, joint in enumerate(model.joint_names):
        for name, value in truth.items():
            row = rows[joint, name]
            assert abs(row.value - value[k]) < 3.0 * row.std, (joint, name)
            assert row.std < 0.05
            assert row.seen
        assert rows[joint, "ripple_sin"].unit == "Nm"
    (quality,) = delivered_quality(model, folder / "arm.csv")
    (told,) = kept.steps
    for joint in model.joint_names:
        r2 = quality.joints[joint].held_out.r2
        assert r2 > 0.999
        assert r2 == pytest.approx(told.joints[joint].held_out.r2, abs=1e-9)


def test_report_show_and_export_name_it(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "ripple sin [Nm]" in (folder / "page.html").read_text(encoding="utf-8")
    assert status("show", folder / "found.npz") == 0
    assert "ripple cos [Nm]" in capsys.readouterr().out
    assert status("export-urdf", folder / "found.npz", "-o", folder / "back.urdf") == 0
    said = capsys.readouterr().out
    assert (
        "Torque ripple of a gear: five waves per turn of the joint (ripple): joint 'shoulder', 'elbow'"
        in said
    )


@pytest.mark.parametrize(("real", "limit"), [("float64", 1e-12), ("float32", 1e-4)])
def test_c_is_its_program_and_its_formula(folder: Path, tmp_path: Path, real: str, limit: float) -> None:
    model = load(folder / "found.npz")
    view = package_view(
        package_info(model, "arm", friction=True),
        lower(model, "factored", ["kinetic_energy"]),
        EmitOptions(real=real),  # type: ignore[arg-type]
    )
    library = Direct(view, shared_library(view, tmp_path, ["-O0"]))
    found = linear_friction(model)
    assert model.calibrated is not None
    rows = by_joint(model.calibrated.friction)

    def of(name: str) -> np.ndarray:
        return np.array([rows[joint, name] for joint in model.joint_names])

    for state in np.random.default_rng(0).normal(size=(20, 2, 2)):
        q, qd, tau = state[0].astype(real), state[1].astype(real), np.empty(2, real)
        library("friction", q, qd, tau)
        by_program = [
            interpret(found.program(), {"p": p, "q": [a], "v": [v]}, {"tau": 1})["tau"][0]  # type: ignore[dict-item]
            for p, a, v in zip(found.values, q.astype(float), qd.astype(float), strict=True)
        ]
        assert np.abs(tau - by_program).max() < limit
        at, v = q.astype(float), qd.astype(float)
        waves = of("ripple_sin") * np.sin(5 * at) + of("ripple_cos") * np.cos(5 * at)
        plain = np.tanh(v / SIGN_SPEED) * (of("coulomb") + of("viscous") * np.abs(v)) + of("offset")
        assert np.abs(tau - (plain + waves)).max() < limit
        assert np.allclose(found.torque(v, at), plain + waves, rtol=1e-14, atol=1e-14)


def test_the_package_builds_and_tests_itself(folder: Path, tmp_path: Path) -> None:
    words = ("--functions", "gravity", "--friction")
    assert status("emit-c", folder / "found.npz", "-o", tmp_path / "c", *words) == 0
    assert status("build", tmp_path / "c") == 0
    header = next((tmp_path / "c" / "include").rglob("two_link_full.h")).read_text(encoding="utf-8")
    assert "_friction(const double *q, const double *qd, double *tau_f);" in header
    assert "ripple_sin sin(5 q) + ripple_cos cos(5 q)" in header


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"program": "import os"}, "cannot read"),
        ({"program": "t0 = load tau[0]\nout torque[0] = t0"}, "reads or gives something else"),
        ({"name": "*/ x"}, "expected a word of small letters"),
        ({"values": []}, "values: expected"),
    ],
)
def test_a_forged_law_in_a_calibration_is_refused(folder: Path, change: dict[str, Any], said: str) -> None:
    found = load(folder / "found.npz").calibrated
    assert found is not None
    kept = json.loads(json.dumps(as_json(found)))
    assert as_json(from_json(kept)) == kept
    kept["prediction"]["columns"]["friction"]["laws"][0] |= change
    with pytest.raises(ValueError, match=re.escape(said)):
        from_json(kept)


def test_values_of_a_law_that_the_calibration_lacks_are_refused(folder: Path) -> None:
    found = load(folder / "found.npz").calibrated
    assert found is not None
    kept = as_json(found)
    kept["prediction"]["columns"]["friction"] = {}
    with pytest.raises(ValueError, match="'ripple_cos' is a value of no friction law"):
        from_json(kept)


START = "from psdmc.friction import *\n"


def law(**parts: str) -> str:
    """A law's file, with some parts replaced."""
    own = {
        "name": "'drag'",
        "about": "'x'",
        "formula": "'x'",
        "values": "(Value('drag'),)",
        "torque": "lambda p, at: p[0] * at.v * absolute(at.v)",
    }
    return f"{START}LAW = Law({', '.join(f'{key}={value}' for key, value in (own | parts).items())})\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x = (", "line 1: SyntaxError"),
        (f"{START}\nx = 1 / 0\n", "line 3: ZeroDivisionError: division by zero"),
        (START, "it defines no LAW = Law(...)"),
        (law(torque="lambda p, at: p[0] * p[0] * at.v"), "not linear in the values p"),
        (law(torque="lambda p, at: p[0] / (at.v - at.v)"), "not finite"),
        (law(torque="lambda p, at: p[0] * at.speed"), "AttributeError"),
        (law(name="'stribeck'"), "'stribeck': expected a word of small letters that no friction law of psdmc has"),
        (law(values="(Value('coulomb'),)"), "expected other names than psdmc's"),
        (law(values="()"), "line 2: IndexError"),
        (law(values="(Value('drag', within='knee'),)"), "`within` is no value"),
        (law(name="'*/ x'"), "expected a word of small letters"),
        (law(about="'a' * 301"), "about: expected a text of at most 300 characters"),
    ],
)  # fmt: skip
def test_what_is_wrong_in_a_law_is_one_line(text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "drag.py").write_text(text, encoding="utf-8")
    with np.errstate(all="ignore"), pytest.raises(InputError) as refused:
        read_law(tmp_path / "drag.py")
    assert said in refused.value.message
    assert "drag.py: " in refused.value.message
    assert "\n" not in refused.value.message


def test_plain_values_read_back_the_same(tmp_path: Path) -> None:
    (tmp_path / "drag.py").write_text(law(), encoding="utf-8")
    data = json.loads(json.dumps(read_law(tmp_path / "drag.py")))
    assert data["program"].count("abs") == 1
    assert laws_of([data])["drag"].parameters == ("drag",)
    for odd in (
        {**data, "program": "t0 = load tau[0]\nout torque[0] = t0"},
        {**data, "program": "import os"},
        3,
    ):
        with pytest.raises(ValueError, match=r"program|cannot read|no table"):
            laws_of([odd])


def test_a_model_file_runs_no_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A forged file that names a Python file instead of holding a law's PROGRAM."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "evil.py").write_text("open('ran', 'w')\n", encoding="utf-8")
    model = bundled_model("two_link_full")
    tables = {"friction": {"laws": ["evil.py"]}}
    with pytest.raises(InputError, match="expected a friction law's Python file"):
        read_columns(tables, model.mechanism)
    kept = {
        "friction": [],
        "prediction": {"law": "linear", "exponents": [], "sign_speed": 1.0, "columns": tables},
    }
    with pytest.raises(ValueError, match="a friction law is no table"):
        from_json(kept)
    save(replace(model, provenance={**model.provenance, "calibration": kept}), tmp_path / "forged.npz")
    with pytest.raises(InputError, match="damaged model file"):
        load(tmp_path / "forged.npz")
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("drag", "friction: found 'drag', expected a friction law's Python file"),
        ({"laws": "drag.py"}, "laws: found 'drag.py', expected a list"),
        ({"laws": ["drag.py", "drag.py"]}, "have the same name"),
        ({"laws": ["drag.py"], "drag": ["knee"]}, "drag: joint(s) 'knee' are not the robot's"),
        ({"drag": True}, "unknown key(s) 'drag'"),
    ],
)
def test_what_is_wrong_in_the_table_is_named(table: Any, said: str, tmp_path: Path) -> None:
    (tmp_path / "drag.py").write_text(law(), encoding="utf-8")
    with pytest.raises(InputError) as refused:
        read_columns({"friction": table}, bundled_model("two_link_full").mechanism, folder=tmp_path)
    assert said in refused.value.message


def test_a_law_of_some_joints(tmp_path: Path) -> None:
    (tmp_path / "drag.py").write_text(law(), encoding="utf-8")
    chain = bundled_model("two_link_full").mechanism
    joint = chain.joint_names[1]
    columns = read_columns({"friction": {"laws": ["drag.py"], "drag": [joint]}}, chain, folder=tmp_path)
    assert [(unknown.owner, unknown.name) for unknown in columns.unknowns] == [(joint, "drag")]
