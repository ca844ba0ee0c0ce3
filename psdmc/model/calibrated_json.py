"""The result of a calibration as plain JSON values, for model files of this and older versions, and for users."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, fields
from typing import Any, TypeVar, cast

import numpy as np

from psdmc.friction.law import Law
from psdmc.friction.laws import LAWS
from psdmc.friction.terms import WITH_STATE, named
from psdmc.model import json_values as json
from psdmc.model.calibrated import (
    LINEAR,
    Array,
    Calibrated,
    FrictionRunConstants,
    JointFigures,
    JointQuality,
    LoadUsed,
    LogUsed,
    NumberRow,
    ParameterRow,
    Prediction,
    Quality,
    Remark,
    StepQuality,
    StepUsed,
    Verdict,
    code_of,
    parameters_of,
)
from psdmc.model.calibrated_before import KINDS, MOST, list_of, texts_of, upgraded
from psdmc.model.grounds import Delay, Ground

Row = TypeVar("Row")

SCHEMA = 1
"""Of what as_json gives. What psdmc 0.1 and 0.2 wrote has none."""
LARGEST_COVARIANCE = 4_000
"""Base parameters of which a file may hold a covariance: 64 MB."""
LARGEST_COUNT = 2**53
"""Rows of a log: what a double counts."""
LEANING = 1e-9
"""Share by which a covariance may exceed the product of the standard deviations: rounding."""
FIGURES = ("r2", "rmse", "gain", "gain_std", "friction_power", "friction_power_std", "noise_ratio", "speed")


# Written


def as_json(found: Calibrated) -> dict[str, Any]:
    """Return a calibration result as plain JSON values for a model file, from which `from_json` reads it. Numbers that
    are not finite become null."""
    content = {
        "schema": SCHEMA,
        "robot": found.robot,
        "method": found.method,
        "joints": list(found.joint_names),
        "verdict": None if found.verdict is None else _verdict(found.verdict),
        "base_parameters": [
            asdict(row) | {"visibility": _remark(row.visibility)} for row in found.parameters
        ],
        "covariance": None if found.covariance is None else packed(found.covariance),
        **{name: [_row(row) for row in getattr(found, name)] for name in ("motors", "friction", "springs")},
        "quality": {
            step.step: {name: asdict(both) for name, both in step.joints.items()} for step in found.steps
        },
        "warnings": [_remark(text) for text in found.warnings],
        "notes": list(found.notes),
        "prediction": None if found.prediction is None else _prediction(found.prediction),
        "logs": [asdict(log) for log in found.logs],
        "load": None if found.load is None else asdict(found.load),
        "versions": found.versions,
        "facts": found.facts,
        **({"elasticity": [_row(row) for row in found.elasticity]} if found.elasticity else {}),
    }
    return {name: plain(value) for name, value in content.items()}


def packed(matrix: Array) -> list[float]:
    """Return the lower triangle of a symmetric (l, l) matrix, row by row."""
    return [float(value) for value in matrix[np.tril_indices(len(matrix))]]


def plain(value: Any) -> Any:
    """Return a value converted to JSON's types: tuples and arrays become lists, and NaN and infinity become null."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.generic | np.ndarray):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return str(value) if isinstance(value, Remark) else value


def _remark(text: str) -> dict[str, str]:
    return {"code": code_of(text), "text": str(text)}


def _row(row: NumberRow) -> dict[str, Any]:
    return asdict(row) | {"visibility": _remark(row.visibility)}


def _prediction(found: Prediction) -> dict[str, Any]:
    steps = {
        name: {
            "filter": {"cutoff": step.cutoff, "order": step.order, "settle": step.settle},
            "split": {"held_out": step.held_out, "blocks": step.blocks},
        }
        for name, step in found.steps.items()
    }
    return asdict(found) | {"steps": steps}


def _verdict(found: Verdict) -> dict[str, Any]:
    return {
        **{
            key: [{"code": one.code, **one.values} for one in getattr(found, name)]
            for key, name in KINDS.items()
        },
        "samples_per_unknown": found.samples_per_unknown,
        "delays": [
            {"log": delay.log, "seconds": delay.value, "std": delay.std, "shown": delay.shown}
            for delay in found.delays
        ],
        "joints": {each.joint: {n: getattr(each, n) for n in (*FIGURES, "visible")} for each in found.joints},
    }


def document(found: Calibrated) -> dict[str, Any]:
    """Return the calibration result as `psdmc show --json` and reports print it: as `as_json` does, but with sentences
    in place of codes. Values that follow from other values are added."""
    kept = as_json(found)
    kept.pop("schema")
    verdict, grounds = found.verdict, kept.pop("verdict")
    of_logs = {
        key: [_log(log) for log in found.logs if (log.use == "with_load") is (key == "with_load")]
        for key in ("data", "with_load")
    }
    load = (
        {}
        if found.load is None
        else {
            "load": {
                "mass_kg": found.load.mass,
                "com_m": list(found.load.com),
                "inertia_kg_m2": list(found.load.inertia),
                "frame": found.load.frame,
            }
        }
    )
    for row, given in zip(kept["base_parameters"], found.parameters, strict=True):
        row |= {"visibility": str(given.visibility), "relative": plain(given.relative)}
    for name in ("motors", "friction", "springs", "elasticity"):
        for row in kept.get(name, ()):
            row["visibility"] = row["visibility"]["text"]
            if not row["parameters"]:
                row.pop("parameters")
    springs = [{"spring": row.pop("joint"), **row} for row in kept.pop("springs")]
    first = {}
    if verdict is not None:
        words = {key: list(getattr(verdict, key)) for key in KINDS}
        codes = {"codes": {key: [each["code"] for each in grounds[key]] for key in KINDS}}
        first = {"verdict": {"verdict": verdict.word, "usable": verdict.usable, **grounds, **words, **codes}}
    facts = kept.pop("facts") | {key: rows for key, rows in of_logs.items() if rows} | load
    versions = kept.pop("versions")
    for name in ("logs", "load"):
        kept.pop(name)
    return {
        **first,
        **({"springs": springs} if springs else {}),
        **kept,
        "warnings": [str(text) for text in found.warnings],
        "facts": facts | {"versions": versions},
    }


def _log(log: LogUsed) -> dict[str, Any]:
    """A log as a row of a document; `use` if it is not for fitting."""
    row = {"log": log.log, "rows": log.rows, "seconds": log.seconds, "date": log.date}
    return row | ({"use": log.use} if log.use == "validate" else {})


# Read


def from_json(value: object) -> Calibrated:
    """Return the calibration result from JSON values that `as_json` returned, or that psdmc 0.1 or 0.2 wrote. Raises
    ValueError that says what is wrong."""
    content = json.record(value, "the calibration")
    if "schema" in content:
        json.whole(content["schema"], "the calibration's schema", 1, SCHEMA)
    else:
        content = upgraded(content)
    parameters = _rows(
        content,
        "base_parameters",
        lambda row: _of(ParameterRow, row, visibility=_remark_of(_part(row, "visibility"))),
    )
    friction = _rows(content, "friction", _number)
    prediction = _maybe(content, "prediction", _prediction_of)
    _require_laws(friction, LAWS if prediction is None else prediction.laws)
    return Calibrated(
        robot=_text(content, "robot"),
        method=_text(content, "method"),
        joint_names=tuple(texts_of(content, "joints")),
        parameters=parameters,
        motors=_rows(content, "motors", _number),
        friction=friction,
        springs=_rows(content, "springs", _number),
        elasticity=_rows(content, "elasticity", _number) if "elasticity" in content else (),
        steps=tuple(_step(name, rows) for name, rows in _record(content, "quality").items()),
        warnings=tuple(_remark_of(each) for each in list_of(content, "warnings")),
        notes=tuple(texts_of(content, "notes")),
        facts=plain(_record(content, "facts")),
        prediction=prediction,
        verdict=_maybe(content, "verdict", _verdict_of),
        covariance=_maybe(content, "covariance", lambda kept: _covariance(kept, len(parameters))),
        logs=_rows(content, "logs", lambda row: _of(LogUsed, row)),
        load=_maybe(content, "load", _load_of),
        versions={name: json.text(each, "a version") for name, each in _record(content, "versions").items()},
    )


def _part(of: object, name: str) -> Any:
    return json.part(of, name, "the calibration")


def _text(of: object, name: str) -> str:
    return json.text(_part(of, name), f"the calibration's {name}")


def _finite(of: object, name: str) -> float:
    return json.number(_part(of, name), f"the calibration's {name}")


def _record(of: object, name: str) -> dict[str, Any]:
    return json.record(_part(of, name), f"the calibration's {name}")


def _rows(of: object, name: str, row: Callable[[object], Row]) -> tuple[Row, ...]:
    return tuple(row(each) for each in list_of(of, name))


def _maybe(of: object, name: str, part: Callable[[Any], Row]) -> Row | None:
    value = _part(of, name)
    return None if value is None else part(value)


def _remark_of(value: object) -> Remark:
    return Remark(_text(value, "text"), _text(value, "code"))


READ: Mapping[str, Callable[[object, str], Any]] = {
    "str": json.text,
    "bool": json.flag,
    "int": lambda value, what: json.whole(value, what, 0, LARGEST_COUNT),
    "float": json.number,
    "float | None": lambda value, what: None if value is None else json.number(value, what),
    "OrNaN": lambda value, what: math.nan if value is None else json.number(value, what),
    "OrInf": lambda value, what: math.inf if value is None else json.number(value, what),
}
"""What reads a field, by the field's type as its class states it."""


def _of(kind: Callable[..., Row], value: object, **given: Any) -> Row:
    """A row of that dataclass: the given fields as they are, the others read by their types."""
    names = [each for each in fields(cast("Any", kind)) if each.name not in given]
    read = {
        each.name: READ[str(each.type)](_part(value, each.name), f"the calibration's {each.name}")
        for each in names
    }
    return kind(**read, **given)


def _number(row: object) -> NumberRow:
    name, parameters = _text(row, "name"), _record(row, "parameters")
    if parameters != parameters_of(name):
        raise ValueError(f"the calibration's parameters of {name!r} are not those of its name")
    seen = _remark_of(_part(row, "visibility"))
    return _of(NumberRow, row, visibility=seen, parameters=parameters)


def _require_laws(friction: Iterable[NumberRow], laws: Mapping[str, Law]) -> None:
    """ValueError where a row is a value of no friction law."""
    with_state = {name for law in WITH_STATE.values() for name in law.parameters}
    for name in sorted({row.name for row in friction} - with_state):
        if named(name, laws) is None:
            raise ValueError(f"the calibration's {name!r:.60} is a value of no friction law")


def _covariance(value: object, l: int) -> Array:
    """(l, l) from its lower triangle: no variance is negative, no correlation above one."""
    json.whole(l, "the number of base parameters with a covariance", 0, LARGEST_COVARIANCE)
    rows, columns = np.tril_indices(l)
    matrix = np.zeros((l, l))
    matrix[rows, columns] = json.numbers(value, "the calibration's covariance", len(rows))
    matrix[columns, rows] = matrix[rows, columns]
    variance = np.diag(matrix)
    std = np.sqrt(np.maximum(variance, 0.0))
    if (variance < 0.0).any() or (np.abs(matrix) > (1.0 + LEANING) * std * std[:, None]).any():
        raise ValueError("the calibration's covariance is that of no numbers")
    return matrix


def _step(name: str, rows: object) -> StepQuality:
    joints = json.record(rows, f"the calibration's quality of {name}")
    return StepQuality(
        name,
        {
            joint: JointQuality(*(_of(Quality, _part(both, part)) for part in ("fit", "held_out")))
            for joint, both in joints.items()
        },
    )


def _prediction_of(value: object) -> Prediction:
    law = _text(value, "law")
    if law not in (LINEAR, *WITH_STATE):
        expected = " or ".join(map(repr, (LINEAR, *WITH_STATE)))
        raise ValueError(f"the calibration's law of friction is {law!r}, expected {expected}")
    coupling = list_of(value, "coupling")
    size = len(coupling)
    matrix = json.numbers(coupling, "the calibration's coupling", *([size, size] if size else [0]))
    exponents = list_of(value, "exponents")
    columns = plain(_record(value, "columns"))
    json.record(columns.get("friction", {}), "the calibration's table of friction")
    found = Prediction(
        law=law,
        steps={name: _used(step) for name, step in _record(value, "steps").items()},
        sign_speed=_finite(value, "sign_speed"),
        exponents=tuple(json.number(each, "an exponent") for each in exponents),
        offset=json.flag(_part(value, "offset"), "the calibration's offset"),
        runs={joint: _of(FrictionRunConstants, each) for joint, each in _record(value, "runs").items()},
        coupling=tuple(tuple(row) for row in matrix.tolist()),
        columns=columns,
    )
    _ = found.terms, found.laws  # neither can be damaged from here on
    return found


def _used(step: object) -> StepUsed:
    low_pass, split = _record(step, "filter"), _record(step, "split")
    order = json.whole(_part(low_pass, "order"), "the order of a filter", 1, 100)
    blocks = json.whole(_part(split, "blocks"), "the blocks of a split", 0, MOST)
    return StepUsed(
        _finite(low_pass, "cutoff"), order, _finite(low_pass, "settle"), _finite(split, "held_out"), blocks
    )


def _verdict_of(value: object) -> Verdict:
    delays = [
        _of(Delay, {**json.record(each, "a delay"), "value": _part(each, "seconds")})
        for each in list_of(value, "delays")
    ]
    return Verdict(
        **{name: tuple(_ground(each) for each in list_of(value, key)) for key, name in KINDS.items()},
        joints=tuple(
            _of(JointFigures, figures, joint=joint) for joint, figures in _record(value, "joints").items()
        ),
        samples_per_unknown=READ["OrInf"](_part(value, "samples_per_unknown"), "samples_per_unknown"),
        delays=tuple(delays),
    )


def _ground(value: object) -> Ground:
    """A ground whose sentence can be made of its values."""
    values = {name: _number_for_null(each) for name, each in json.record(value, "a ground").items()}
    found = Ground(json.text(values.pop("code", None), "the code of a ground"), values)
    try:
        _ = found.words
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise ValueError(f"the verdict's ground {found.code!r} is damaged: {error}") from error
    return found


def _number_for_null(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _number_for_null(each) for name, each in value.items()}
    if isinstance(value, list):
        return [_number_for_null(each) for each in value]
    return math.nan if value is None else value


def _load_of(value: object) -> LoadUsed:
    com, inertia = (
        json.numbers(_part(value, name), f"the load's {name}", count)
        for name, count in (("com", 3), ("inertia", 6))
    )
    return _of(LoadUsed, value, com=tuple(com.tolist()), inertia=tuple(inertia.tolist()))
