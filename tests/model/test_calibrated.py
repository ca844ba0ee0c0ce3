"""Calibrated in files: of this psdmc, of 0.1 and 0.2, and damaged."""

from __future__ import annotations

import copy
import json
import math
import random
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import status

from psdmc.model.calibrated import Calibrated, Remark, Verdict, parameters_of
from psdmc.model.calibrated_json import as_json, document, from_json, packed
from psdmc.model.grounds import WORDS, Delay, Ground
from psdmc.model.linear_friction import linear_friction
from psdmc.model.load import load
from psdmc.model.store import save

SAMPLES = Path(__file__).resolve().parents[1] / "golden" / "calibrated"
"""Model files that psdmc 0.1.0 and 0.2.0 wrote, and what these said of them in a report's JSON."""
OLD = ("linear_0_1", "linear_0_2", "campaign_0_2")


def kept(name: str) -> Calibrated:
    found = load(SAMPLES / f"{name}.npz").calibrated
    assert found is not None
    return found


def judged() -> Calibrated:
    """A sample with codes and a covariance, as today's calibrations have."""
    found = kept("linear_0_2")
    l = len(found.parameters)
    factor = np.random.default_rng(0).normal(size=(l, l))
    grounds = (
        Ground("late", {"log": "a.csv", "seconds": 0.25, "std": math.inf}),
        Ground(
            "low_r2", {"items": [{"joint": "J1", "r2": math.nan, "rmse": 2.0, "unit": "N m"}], "limit": 0.5}
        ),
    )
    columns = {"order": (1, 0), "signs": (1, 1), "effort_order": (0, 1), "effort_signs": (-1, 1)}
    suspect = Ground(
        "columns", {"joints": ("a", "b"), "readings": [columns], "explained": 0.9, "logged": 0.1}
    )
    assert found.verdict is not None
    delays = (Delay("a.csv", 0.5, math.inf, True),)
    verdict = replace(
        found.verdict, delays=delays, against=grounds, doubted=(Ground("unchecked"),), suspected=(suspect,)
    )
    warnings = (*found.warnings, Remark("J1 stands still", "standing"))
    return replace(found, covariance=factor @ factor.T, verdict=verdict, warnings=warnings)


def differences(old: Any, new: Any, where: str = "") -> Iterator[str]:
    """Where a document lacks or changes what an older one says."""
    if isinstance(old, dict):
        for key, value in old.items():
            yield from (
                differences(value, new.get(key), f"{where}/{key}") if isinstance(new, dict) else [where]
            )
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for k, pair in enumerate(zip(old, new, strict=True)):
            yield from differences(*pair, f"{where}/{k}")
    elif old != new:
        yield f"{where}: {old!r} is {new!r}"


@pytest.mark.parametrize("name", ["linear_0_1", "linear_0_2"])
def test_users_are_told_what_the_older_psdmc_told_them(name: str) -> None:
    """psdmc 0.1 called the first viscous term viscous, whatever its exponent, and numbered base parameters from 1."""
    old = json.loads((SAMPLES / f"{name}.json").read_text(encoding="utf-8"))
    new = json.loads(json.dumps(document(kept(name)), allow_nan=False))
    found = list(differences(old, new))
    assert [text for text in found if not (name == "linear_0_1" and text.startswith("/friction/"))] == []


def test_viscous_terms_of_0_1_have_todays_names() -> None:
    old = json.loads((SAMPLES / "linear_0_1.json").read_text(encoding="utf-8"))
    assert [row["name"] for row in old["friction"]][:4] == ["coulomb", "viscous", "viscous^1", "offset"]
    found = {(row.joint, row.name): row for row in kept("linear_0_1").friction}
    for row in old["friction"]:
        name = {"viscous": "viscous^0.5", "viscous^1": "viscous"}.get(row["name"], row["name"])
        assert found[row["joint"], name].value == row["value"]
    assert found["elbow", "viscous^0.5"].parameters == {"exponent": 0.5}
    assert found["elbow", "viscous^0.5"].unit == "Nm (s/rad)^0.5"


def test_a_campaign_of_0_2_has_its_parts() -> None:
    found = kept("campaign_0_2")
    assert found.method.startswith("four steps")
    assert found.prediction is not None
    assert found.prediction.law == "lugre"
    assert set(found.prediction.runs) == {"shoulder", "elbow"}
    assert [step.step for step in found.steps] == ["Motor", "Gravity", "Friction", "Inertial", "All"]
    assert len(found.friction) == 14
    assert found.covariance is None
    assert {log.use for log in found.logs} == {"fit"}
    assert isinstance(found.verdict, Verdict)


def test_friction_of_0_2_is_the_sum_of_its_rows() -> None:
    """By the published formula, from the rows that 0.2 itself reported."""
    old = json.loads((SAMPLES / "linear_0_2.json").read_text(encoding="utf-8"))
    rows = {(row["joint"], row["name"]): row["value"] for row in old["friction"]}
    v = np.array([0.7, -0.05])
    s = np.tanh(v / old["prediction"]["sign_speed"])
    expected = [
        s[k]
        * (
            rows[joint, "coulomb"]
            + rows[joint, "viscous"] * abs(v[k])
            + rows[joint, "viscous^0.5"] * abs(v[k]) ** 0.5
            + rows.get((joint, "stribeck_0.1"), 0.0) * math.exp(-((v[k] / 0.1) ** 2))
        )
        + rows[joint, "offset"]
        for k, joint in enumerate(("shoulder", "elbow"))
    ]
    assert ("elbow", "stribeck_0.1") in rows
    assert np.allclose(linear_friction(load(SAMPLES / "linear_0_2.npz")).torque(v), expected, rtol=1e-14)


@pytest.mark.parametrize("name", OLD)
def test_show_prints_an_older_file_and_writes_it_anew(name: str, tmp_path: Path, capsys: Any) -> None:
    model = load(SAMPLES / f"{name}.npz")
    assert "calibration" not in model.provenance
    save(model, tmp_path / "new.npz")
    again = load(tmp_path / "new.npz").calibrated
    assert again is not None
    assert model.calibrated is not None
    assert as_json(again) == as_json(model.calibrated)
    for path in (SAMPLES / f"{name}.npz", tmp_path / "new.npz"):
        assert status("show", path) == 0
    first, second = capsys.readouterr().out.split("verdict:")[1:]
    assert first.partition("model hash")[0] == second.partition("model hash")[0]


def test_what_is_written_is_read_back() -> None:
    found = judged()
    text = json.dumps(as_json(found), allow_nan=False)
    again = from_json(json.loads(text))
    assert json.dumps(as_json(again), allow_nan=False) == text
    assert again.verdict is not None
    assert found.verdict is not None
    assert again.verdict.lines() == found.verdict.lines()
    assert again.verdict.delays == found.verdict.delays
    assert np.array_equal(again.covariance, found.covariance)
    assert [row.parameters for row in again.friction] == [row.parameters for row in found.friction]
    assert again.unsaid == found.unsaid


def test_a_doubt_silences_the_warning_of_its_code() -> None:
    still = Ground("hardly_moving", {"items": [{"joint": "J1"}], "limit": 0.03})
    found = judged()
    assert found.verdict is not None
    assert "J1 stands still" in found.unsaid
    said = replace(found, verdict=replace(found.verdict, doubted=(still,)))
    assert "J1 stands still" not in from_json(json.loads(json.dumps(as_json(said)))).unsaid


def test_a_covariance_is_packed_by_rows() -> None:
    assert packed(np.array([[1.0, 2.0, 4.0], [2.0, 3.0, 5.0], [4.0, 5.0, 6.0]])) == [
        1.0,
        2.0,
        3.0,
        4.0,
        5.0,
        6.0,
    ]


def put(content: dict[str, Any], *keys: Any, value: Any) -> dict[str, Any]:
    content = copy.deepcopy(content)
    inside: Any = content
    for key in keys[:-1]:
        inside = inside[key]
    inside[keys[-1]] = value
    return content


FORGED: list[tuple[tuple[Any, ...], Any, str]] = [
    (("schema",), 2, "schema"),
    (("covariance",), [1.0], "covariance"),
    (("covariance", 0), -1.0, "covariance is that of no numbers"),
    (("covariance", 1), 1e9, "covariance is that of no numbers"),
    (("covariance", 0), None, "number"),
    (("friction", 0, "name"), "stribeck_x", "is a value of no friction law"),
    (("friction", 0, "parameters"), {"exponent": 2.0}, "not those of its name"),
    (("friction", 0, "seen"), "yes", "true or false"),
    (("base_parameters", 0, "value"), None, "number"),
    (("verdict", "reasons", 0, "code"), "unheard", "'unheard' is damaged"),
    (("verdict", "reasons", 0, "seconds"), "soon", "'late' is damaged"),
    (("verdict", "reasons", 1, "items"), [{}], "'low_r2' is damaged"),
    (("verdict", "suspects", 0, "readings", 0, "order"), [7, 0], "'columns' is damaged"),
    (("verdict", "joints"), [], "joints"),
    (("prediction", "law"), "magic", "'magic'"),
    (("prediction", "coupling"), [[1.0, 2.0]], "coupling"),
    (("prediction", "steps", "all", "filter", "order"), 1e9, "order"),
    (("logs", 0, "rows"), -1, "rows"),
    (("quality",), {"All": {"J": 1}}, "calibration"),
    (("notes",), [1], "text"),
]


@pytest.mark.parametrize(("keys", "value", "words"), FORGED)
def test_a_forged_calibration_is_refused_in_one_line(keys: tuple[Any, ...], value: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words) as refused:
        from_json(put(json.loads(json.dumps(as_json(judged()))), *keys, value=value))
    assert "\n" not in str(refused.value)


def leaves(value: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, each in inside:
        yield (*at, key)
        yield from leaves(each, (*at, key))


def test_whatever_stands_in_a_file_is_refused_or_can_be_said() -> None:
    """Every entry replaced by something else, for this schema's files and for 0.2's: a ValueError, or a document."""
    rng = random.Random(5)
    old = json.loads((SAMPLES / "linear_0_2.json").read_text(encoding="utf-8"))
    refused = 0
    for content in (json.loads(json.dumps(as_json(judged()))), old):
        for keys in leaves(content):
            for other in rng.sample([None, "x", -1, 1e300, True, [], [1], {}, {"a": None}], 3):
                try:
                    found = from_json(put(content, *keys, value=other))
                except ValueError:
                    refused += 1
                    continue
                json.dumps(document(found), allow_nan=False)
    assert refused > 1000


def test_every_code_has_one_sentence_and_no_two_share_it() -> None:
    assert len(WORDS) == len({id(words) for words in WORDS.values()})
    with pytest.raises(KeyError):
        _ = Ground("unheard").words


def test_parameters_of_names() -> None:
    assert parameters_of("viscous^1.5") == {"exponent": 1.5}
    assert parameters_of("stribeck_0.02") == {"speed": 0.02}
    for plain in ("coulomb", "viscous", "offset", "stribeck_velocity", "viscous_exponent"):
        assert parameters_of(plain) == {}
