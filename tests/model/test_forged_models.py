"""Model files that somebody forged, hash and all: each is one line that says what is wrong, and takes little memory."""

from __future__ import annotations

import io
import json
import math
import tracemalloc
import zipfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bundled import bundled_model
from command_line import status

from psdmc.errors import InputError
from psdmc.model import store
from psdmc.model.chain_json import MOST_JOINTS
from psdmc.model.load import load
from psdmc.verification.check import check_model

MEMORY = 100 << 20
"""Bytes that reading a small file may take."""

Manifest = dict[str, Any]
Arrays = dict[str, Any]


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("original") / "model.npz"
    bundled_model("two_link").save(path)
    return path


def forged(original: Path, path: Path, change: Callable[[Manifest, Arrays], None]) -> Path:
    """The file with something changed, under a hash that agrees."""
    with np.load(original) as file:
        arrays = {name: file[name] for name in file.files}
    manifest = json.loads(str(arrays.pop("manifest")))
    change(manifest, arrays)
    plain = {name: np.zeros(1) if array.dtype == object else array for name, array in arrays.items()}
    try:
        manifest["content_hash"] = store.hash_of(plain, manifest)
    except (KeyError, ValueError):
        manifest["content_hash"] = "0" * 64
    np.savez_compressed(path, manifest=np.array(json.dumps(manifest)), **arrays)
    return path


def at(*keys: object) -> Callable[[object], Callable[[Manifest, Arrays], None]]:
    """at(keys...)(value): a change of the manifest's entry there."""

    def put(value: object) -> Callable[[Manifest, Arrays], None]:
        def change(manifest: Manifest, arrays: Arrays) -> None:
            inside: Any = manifest
            for key in keys[:-1]:
                inside = inside[key]
            inside[keys[-1]] = value

        return change

    return put


def without(*keys: object) -> Callable[[Manifest, Arrays], None]:
    def change(manifest: Manifest, arrays: Arrays) -> None:
        inside: Any = manifest
        for key in keys[:-1]:
            inside = inside[key]
        del inside[keys[-1]]

    return change


def array(name: str, make: Callable[[Any], Any]) -> Callable[[Manifest, Arrays], None]:
    def change(manifest: Manifest, arrays: Arrays) -> None:
        arrays[name] = make(arrays[name])

    return change


def entry(value: float, index: int = 0) -> Callable[[Any], Any]:
    def make(values: Any) -> Any:
        changed = values.copy()
        changed.flat[index] = value
        return changed

    return make


SPAN, JOINT = ("chain", "parameter_span"), ("chain", "joints", 0)

FORGED = {
    "schema zero": (at("schema")(0), "its schema is 0"),
    "schema -5": (at("schema")(-5), "its schema is -5"),
    "schema true": (at("schema")(True), "its schema is True"),
    "NaN in the manifest": (at("certificate")([math.nan, 0.0]), ""),
    "infinity in the manifest": (at("chain", "gravity")([0.0, 0.0, math.inf]), ""),
    "a certificate of another length": (at("certificate")([0.0]), "certificate"),
    "a certificate of texts": (at("certificate")(["a", "b"]), "number"),
    "expanded is no flag": (at("expanded")("yes"), "'expanded'"),
    "theta_b_known is no flag": (at("theta_b_known")(1), "'theta_b_known'"),
    "no chain": (without("chain"), "'chain'"),
    "a chain that is a list": (at("chain")([1]), "the chain"),
    "no joints": (at("chain", "joints")([]), "no joints"),
    "too many joints": (at("chain", "joints")([{}] * (MOST_JOINTS + 1)), "257 entries"),
    "a joint that is a number": (at(*JOINT)(7), "a joint"),
    "a name that is a number": (at("chain", "name")(5), "the chain's name"),
    "a name that is missing": (without("chain", "name"), "'name'"),
    "a joint's name that is a list": (at(*JOINT, "name")(["a"]), "a joint's name"),
    "a joint's kind": (at(*JOINT, "kind")("ball"), "'ball'"),
    "a joint of several coordinates": (at(*JOINT, "kind")("planar"), "E and P are of joints of one"),
    "a joint's kind that is a list": (at(*JOINT, "kind")(["revolute"]), "kind"),
    "a convention": (at("chain", "convention")("mine"), "'mine'"),
    "notes that are a text": (at("chain", "notes")("abc"), "notes"),
    "notes that are numbers": (at("chain", "notes")([1, 2]), "a note"),
    "gravity of two": (at("chain", "gravity")([0.0, 1.0]), "gravity"),
    "gravity of a huge whole number": (at("chain", "gravity")([0, 0, 10**400]), "finite"),
    "limits that are a list": (at(*JOINT, "limits")([]), "limits"),
    "a limit that is a text": (at(*JOINT, "limits", "lower")("1"), "lower"),
    "a limit that is missing": (without(*JOINT, "limits", "speed"), "'speed'"),
    "a rotation that is none": (
        at(*JOINT, "placement", "rotation")([[2, 0, 0], [0, 1, 0], [0, 0, 1]]),
        "rotation",
    ),
    "a rotation of another shape": (at(*JOINT, "placement", "rotation")([[1, 0], [0, 1]]), "rotation"),
    "a translation that is a number": (at("chain", "tip", "translation")(3), "translation"),
    "parameters of one link": (at("chain", "parameters")([[0.0] * 11]), "parameters"),
    "parameters of another width": (at("chain", "parameters")([[0.0] * 3] * 2), "parameters"),
    "parameters that are texts": (at("chain", "parameters")([["a"] * 11] * 2), "parameter"),
    "huge span columns": (at(*SPAN, "columns")(10**12), "columns"),
    "negative span columns": (at(*SPAN, "columns")(-1), "columns"),
    "span columns that are a fraction": (at(*SPAN, "columns")(2.5), "columns"),
    "a span row out of range": (at(*SPAN, "rows", 0)(10**9), "row of the span"),
    "a span place below zero": (at(*SPAN, "in_columns", 0)(-1), "column of the span"),
    "a span of unequal lists": (at(*SPAN, "values")([1.0]), "equally many"),
    "a span that is not reduced": (at(*SPAN, "values", 0)(2.0), "echelon"),
    "a provenance that is a list": (at("provenance")([]), "provenance"),
    "a source that is a number": (at("provenance", "source_text")(3), "source_text"),
    "a source format": (at("provenance", "source_format")("sdf"), "source_format"),
    "options of another program": (at("provenance", "options", "path")("/"), "'path'"),
    "an option of another kind": (at("provenance", "options", "snap")("0"), "snap"),
    "drive inertias of another length": (
        at("provenance", "options", "drive_inertia")([1.0]),
        "drive_inertia",
    ),
    "snapped that is a number": (at("provenance", "snapped")(1), "snapped"),
    "a snapping effect of texts": (at("provenance", "snap_torque_change")(["a", "b"]), "snap_torque_change"),
    "a calibration that is a text": (at("provenance", "calibration")("x"), "calibration"),
    "a row of friction without a name": (
        at("provenance", "calibration")({"friction": [{}]}),
        "a name of the",
    ),
    "a joint that there is none of": (
        at("provenance", "calibration")({"friction": [{"joint": "x", "name": "coulomb", "value": 1.0}]}),
        "joint 'x'",
    ),
    "E of floats": (array("E", lambda E: E.astype(float)), "E has type float64"),
    "E of objects": (array("E", lambda E: E.astype(object)), ""),
    "E with a row too many": (array("E", lambda E: np.vstack([E, E[:1]])), "E has 11 rows"),
    "E of a third power": (
        array("E", lambda E: np.where(E.max() == E, 3, E).astype(E.dtype)),
        "exponents up to 3",
    ),
    "E with one axis": (array("E", np.ravel), "1 axes"),
    "theta_b that is not finite": (array("theta_b", entry(math.inf)), "not finite"),
    "theta_b of another length": (array("theta_b", lambda t: t[:-1]), "theta_b"),
    "B that is not finite": (array("B", entry(math.nan)), "not finite"),
    "B of another width": (array("B", lambda B: B[:, :-1]), "B has shape"),
    "B of zeros": (array("B", np.zeros_like), "of its own"),
    "B outside the span": (array("B", lambda B: np.roll(B, 1, axis=1)), ""),
    "P that is not finite": (array("P_value", entry(math.nan)), "P is not finite"),
    "P_joint out of range": (array("P_joint", entry(2, -1)), "P_joint has entries outside"),
    "P_joint out of order": (array("P_joint", lambda v: v[::-1].copy()), "not in order"),
    "P_row out of range": (array("P_row", entry(10**6)), "P_row has entries outside"),
    "P_row below zero": (array("P_row", entry(-1)), "P_row has entries outside"),
    "P_col out of range": (array("P_col", entry(10**6)), "P_col has entries outside"),
    "P_col of another length": (array("P_col", lambda v: v[:-1]), "P_col has"),
    "P_value of texts": (array("P_value", lambda v: v.astype(str)), "P_value has type"),
    "an array that is missing": (lambda manifest, arrays: arrays.pop("B"), "B"),
    "a manifest that is a list": (lambda manifest, arrays: manifest.clear(), "not a psdmc model file"),
}


@pytest.mark.parametrize("case", FORGED)
def test_a_forged_file_is_one_line(case: str, original: Path, tmp_path: Path):
    change, named = FORGED[case]
    path = forged(original, tmp_path / "forged.npz", change)

    tracemalloc.start()
    with pytest.raises(InputError) as caught:
        load(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()

    assert "forged.npz" in caught.value.message
    assert "hash" not in caught.value.message, "the test's own hash is wrong"
    assert named in caught.value.message
    assert "\n" not in caught.value.message
    assert len(caught.value.message) < 500
    assert peak < MEMORY


def test_what_is_not_changed_is_read(original: Path, tmp_path: Path):
    path = forged(original, tmp_path / "same.npz", lambda manifest, arrays: None)
    assert load(path).content_hash == load(original).content_hash


def zip_with(members: dict[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return stream.getvalue()


def npy(shape: str, dtype: str = "<f8", data: bytes = b"", order: str = "False") -> bytes:
    header = f"{{'descr': '{dtype}', 'fortran_order': {order}, 'shape': {shape}}}"
    header = header.ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode() + data


@cache
def bomb() -> bytes:
    return npy("(1000000000,)", data=bytes(300 << 20))


ARCHIVES = {
    "a manifest that claims 8 GB": zip_with({"manifest.npy": npy("()", "<U2000000000")}),
    "a manifest that claims 8e18 bytes": zip_with({"manifest.npy": npy("(1000000000, 1000000000)")}),
    "a negative shape": zip_with({"manifest.npy": npy("(-1,)")}),
    "a pickle": zip_with({"manifest.npy": npy("()", "|O", b"cos\nsystem\n(S'true'\ntR.")}),
    "a header that is code": zip_with({"manifest.npy": npy("__import__('os')._exit(1)")}),
    "a header of a version to come": zip_with({"manifest.npy": b"\x93NUMPY\x09\x00" + bytes(100)}),
    "letters that are none": zip_with({"manifest.npy": npy("()", "<U1", b"\xff\xff\xff\x7f")}),
    "bzip2": zip_with({"manifest.npy": npy("()", "<U1", b"x\0\0\0")}, zipfile.ZIP_BZIP2),
    "brackets": zip_with({"manifest.npy": npy("()", "<U200000", ("[" * 200000).encode("utf-32-le"))}),
}


@pytest.mark.parametrize("case", ["a manifest that unpacks to 300 MB", *ARCHIVES])
def test_an_archive_that_is_none_of_ours(case: str, tmp_path: Path):
    path = tmp_path / "model.npz"
    path.write_bytes(ARCHIVES[case] if case in ARCHIVES else zip_with({"manifest.npy": bomb()}))

    tracemalloc.start()
    with pytest.raises(InputError, match=r"model\.npz: (damaged|not a psdmc) model") as caught:
        load(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()

    assert "\n" not in caught.value.message
    assert peak < MEMORY


def test_a_bomb_beside_a_good_manifest(original: Path, tmp_path: Path):
    with zipfile.ZipFile(original) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    path = tmp_path / "model.npz"
    path.write_bytes(zip_with(members | {"P_value.npy": bomb()}))
    assert path.stat().st_size < 1 << 20

    with pytest.raises(InputError, match="would unpack to"):
        load(path)


def test_a_file_of_three_gigabytes_is_not_read(tmp_path: Path):
    with open(tmp_path / "model.npz", "wb") as file:
        file.write(b"PK")
        file.truncate(3 << 30)
    with pytest.raises(InputError, match="more than 2 GiB, which is the most that psdmc reads"):
        load(tmp_path / "model.npz")


def test_options_that_load_robot_refuses_are_the_inputs_fault(original: Path, tmp_path: Path):
    path = forged(original, tmp_path / "model.npz", at("provenance", "options", "assume_zero")(["x"]))
    with pytest.raises(InputError):
        check_model(load(path))


def test_the_command_line_says_it_in_two_lines(
    original: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    path = forged(original, tmp_path / "model.npz", at(*SPAN, "columns")(10**12))
    code = status("show", path)
    said = capsys.readouterr().err.splitlines()
    assert code == 2
    assert [line.split(":")[0] for line in said] == ["error", "hint"]
