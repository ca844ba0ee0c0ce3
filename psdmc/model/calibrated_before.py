"""Conversion of calibration results that psdmc 0.1 and 0.2 wrote, to the first numbered format of Calibrated.

Results of these versions have no format number. They contain sentences in place of codes, and logs, load and versions
among the facts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from psdmc.friction.terms import with_present_names
from psdmc.model import json_values as json
from psdmc.model.calibrated import IDENTIFIED, parameters_of

MOST = 1_000_000
"""Largest number of rows of a table; a campaign's friction has a few per joint."""
KINDS = {"reasons": "against", "suspects": "suspected", "doubts": "doubted"}
"""Keys of a verdict's grounds, and its fields."""

CODES = {
    "identified": "identified",
    "weakly visible": "weak",
    "by the stated prior": "stated",
    "not essential": "dropped",
    "only in combination": "together",
    "mostly invisible": "mostly",
    "not visible": "invisible",
}
"""First words of what older psdmc wrote of a number's visibility, and the code that it has now."""


def upgraded(old: Mapping[str, Any]) -> dict[str, Any]:
    """Convert a result that psdmc 0.1 or 0.2 wrote to the first numbered format. Raises ValueError if it is no such
    result."""
    facts = dict(json.record(old.get("facts", {}), "the calibration's facts"))
    logs = [
        {"date": "", "use": use, **json.record(row, "a log"), **({"use": use} if use != "fit" else {})}
        for name, use in (("data", "fit"), ("with_load", "with_load"))
        for row in list_of({name: facts.pop(name, [])}, name)
    ]
    load, verdict, prediction = facts.pop("load", None), old.get("verdict"), old.get("prediction")
    return {
        "robot": "",
        "method": "unknown",
        "joints": [],
        "quality": {},
        "notes": [],
        **old,
        "base_parameters": [
            _row({"group": "all", "file": None, **row}) for row in _rows(old, "base_parameters")
        ],
        "covariance": None,
        "motors": [_row(row) for row in _rows(old, "motors")],
        "friction": [_row(row) for row in _named_by_exponents(old)],
        "springs": [_row({"joint": row.pop("spring", None), **row}) for row in _rows(old, "springs")],
        "warnings": [{"code": "", "text": text} for text in texts_of({"warnings": [], **old}, "warnings")],
        "prediction": None if prediction is None else _prediction(prediction),
        "verdict": None if verdict is None else _verdict(verdict),
        "logs": logs,
        "load": None if load is None else _load(load),
        "versions": facts.pop("versions", {}),
        "facts": facts,
    }


def list_of(of: object, name: str) -> list[Any]:
    """Return a list of the calibration by its name."""
    return json.entries(json.part(of, name, "the calibration"), f"the calibration's {name}", MOST)


def texts_of(of: object, name: str) -> list[str]:
    """Return a list of texts of the calibration by its name."""
    return [json.text(each, f"an entry of the calibration's {name}") for each in list_of(of, name)]


def _rows(old: Mapping[str, Any], name: str) -> list[dict[str, Any]]:
    return [
        dict(json.record(row, f"a row of the calibration's {name}"))
        for row in list_of({name: [], **old}, name)
    ]


def _row(row: dict[str, Any]) -> dict[str, Any]:
    text = row.get("visibility", IDENTIFIED if row.get("identifiable") else "")
    said = json.text(text, "a visibility")
    code = next((code for words, code in CODES.items() if said.startswith(words)), "")
    kept = {"std": None, "unit": "", "seen": True, **row}
    name = json.text(row.get("name"), "a name of the calibration")
    return kept | {"visibility": {"code": code, "text": said}, "parameters": parameters_of(name)}


def _named_by_exponents(old: Mapping[str, Any]) -> Sequence[dict[str, Any]]:
    """Rows of friction with the present names of terms."""
    rows = _rows(old, "friction")
    law = json.record(old.get("prediction") or {}, "the calibration's prediction")
    exponents = [json.number(each, "an exponent") for each in list_of({"exponents": [], **law}, "exponents")]
    return with_present_names(rows, exponents)


def _prediction(value: object) -> dict[str, Any]:
    nothing = {
        "steps": {},
        "sign_speed": 0.0,
        "exponents": [],
        "offset": False,
        "runs": {},
        "coupling": [],
        "columns": {},
    }
    return {**nothing, **json.record(value, "the calibration's prediction")}


def _verdict(value: object) -> dict[str, Any]:
    old = json.record(value, "the verdict")
    grounds = {
        key: [{"code": "said", "text": text} for text in texts_of({key: [], **old}, key)] for key in KINDS
    }
    delays = [
        {"shown": False, **json.record(each, "a delay")} for each in list_of({"delays": [], **old}, "delays")
    ]
    return {"samples_per_unknown": None, "joints": {}, **old, **grounds, "delays": delays}


def _load(value: object) -> dict[str, Any]:
    old = json.record(value, "the load")
    names = {"mass_kg": "mass", "com_m": "com", "inertia_kg_m2": "inertia"}
    return {names.get(name, name): each for name, each in old.items()}
