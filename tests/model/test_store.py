"""Model files: exact, deterministic, atomic, and clear about what is wrong with them."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model, bundled_robot
from random_chains import random_chain

import psdmc
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.load import load
from psdmc.model.store import file_bytes, save


def assert_same(a: DynamicsModel, b: DynamicsModel) -> None:
    assert file_bytes(a) == file_bytes(b)
    assert a.content_hash == b.content_hash
    assert np.array_equal(a.B, b.B)
    assert (a.theta_b is None) == (b.theta_b is None)
    assert a.theta_b is None or np.array_equal(a.theta_b, b.theta_b)
    assert (a.E is None) == (b.E is None)
    if a.E is not None:
        assert np.array_equal(a.E, b.E)
        for left, right in zip(a.P, b.P, strict=True):
            assert np.array_equal(left.toarray(), right.toarray())
    assert a.provenance == b.provenance
    for left, right in zip(a.chain.joints, b.chain.joints, strict=True):
        assert (left.name, left.link_name, left.kind) == (right.name, right.link_name, right.kind)
        assert left.limits == right.limits
        assert np.array_equal(left.placement.rotation, right.placement.rotation)
        assert np.array_equal(left.link_frame.translation, right.link_frame.translation)
    assert np.array_equal(a.chain.parameters, b.chain.parameters, equal_nan=True)
    assert np.array_equal(a.chain.parameter_span, b.chain.parameter_span)
    assert a.chain.notes == b.chain.notes


@pytest.mark.parametrize("name", ["scara", "denso_wall", "rounded_arm"])
def test_a_model_comes_back_exactly(name: str, tmp_path: Path) -> None:
    model = bundled_model(name)
    model.save(tmp_path / "model.npz")
    assert_same(load(tmp_path / "model.npz"), model)


def test_the_packages_save_mirrors_its_load(tmp_path: Path) -> None:
    model = bundled_model("scara")
    psdmc.save(model, tmp_path / "model.npz")
    assert_same(psdmc.load(tmp_path / "model.npz"), model)


def test_unknown_and_unexpanded_models_come_back(tmp_path: Path) -> None:
    chain = random_chain(0, "RP")
    unknown = type(chain)(
        chain.name,
        chain.convention,
        chain.base_name,
        chain.tip_name,
        chain.joints,
        np.full((2, 11), np.nan),
        chain.parameter_span,
        chain.gravity,
        chain.tip,
        ("a note",),
    )
    for number, model in enumerate((derive_model(unknown), derive_model(chain, expand=False))):
        path = tmp_path / f"{number}.npz"
        save(model, path)
        assert_same(load(path), model)


def test_numpy_reads_the_file_alone(tmp_path: Path) -> None:
    model = bundled_model("scara")
    model.save(tmp_path / "model.npz")
    with np.load(tmp_path / "model.npz", allow_pickle=False) as file:
        manifest = json.loads(str(file["manifest"]))
        assert manifest["schema"] == 1
        assert manifest["content_hash"] == model.content_hash
        dense = np.zeros((model.n, model.p, model.l))
        dense[file["P_joint"], file["P_row"], file["P_col"]] = file["P_value"]
        assert np.array_equal(dense, np.stack([matrix.toarray() for matrix in model.P]))
        assert np.array_equal(file["E"], model.E)


def test_a_file_does_not_tell_when_it_was_written() -> None:
    with zipfile.ZipFile(io.BytesIO(file_bytes(bundled_model("two_link")))) as archive:
        assert {member.date_time for member in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}


def test_the_hash_covers_values_and_names() -> None:
    model = derive_model(random_chain(0, "RR"))
    other = derive_model(random_chain(0, "RR"), provenance={"source_name": "x"})
    heavier = model.with_payload(0.1, [0.0, 0.0, 0.1])
    assert len({model.content_hash, other.content_hash, heavier.content_hash}) == 3


def rewritten(path: Path, **changes: object) -> None:
    """The file with manifest entries replaced; None removes one."""
    with np.load(path, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    manifest = json.loads(str(arrays["manifest"])) | changes
    arrays["manifest"] = np.array(json.dumps({k: v for k, v in manifest.items() if v is not None}))
    np.savez(path, **arrays)


def saved(tmp_path: Path) -> Path:
    path = tmp_path / "model.npz"
    bundled_model("two_link").save(path)
    return path


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"absent\.npz: no such file"):
        load(tmp_path / "absent.npz")


@pytest.mark.parametrize("kept", [0, 1, 100, -200, -1])
def test_a_truncated_file(tmp_path: Path, kept: int) -> None:
    path = saved(tmp_path)
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(InputError, match=r"model\.npz: (damaged|not a psdmc) model") as caught:
        load(path)
    assert "\n" not in caught.value.message
    assert caught.value.hint


def test_every_flipped_byte_is_noticed_or_harmless(tmp_path: Path) -> None:
    path = saved(tmp_path)
    whole = path.read_bytes()
    expected = load(path).content_hash
    for place in range(0, len(whole), 97):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0x55]) + whole[place + 1 :])
        try:
            assert load(path).content_hash == expected
        except InputError:
            continue


def test_a_changed_value_does_not_match_the_hash(tmp_path: Path) -> None:
    path = saved(tmp_path)
    rewritten(path, expanded=False)
    with pytest.raises(InputError, match="damaged model file: its content does not match its hash"):
        load(path)


def test_a_newer_schema(tmp_path: Path) -> None:
    path = saved(tmp_path)
    rewritten(path, schema=5, psdmc="9.9")
    with pytest.raises(InputError, match="model schema 5, this psdmc reads up to 4") as caught:
        load(path)
    assert "9.9" in caught.value.hint


@pytest.mark.parametrize("format", [None, "something else"])
def test_a_foreign_manifest(tmp_path: Path, format: str | None) -> None:
    path = saved(tmp_path)
    rewritten(path, format=format)
    with pytest.raises(InputError, match="not a psdmc model file"):
        load(path)


def foreign_zip() -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("readme.txt", "hello")
    return stream.getvalue()


def foreign_npz() -> bytes:
    stream = io.BytesIO()
    np.savez(stream, a=np.zeros(3))
    return stream.getvalue()


def pickled_npy() -> bytes:
    stream = io.BytesIO()
    np.save(stream, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    return stream.getvalue()


def plain_npy() -> bytes:
    stream = io.BytesIO()
    np.save(stream, np.zeros(3))
    return stream.getvalue()


@pytest.mark.parametrize(
    "content", [b"<robot/>", b"\x00" * 300, foreign_zip(), foreign_npz(), pickled_npy(), plain_npy()]
)
def test_foreign_files(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "other.npz"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"other\.npz: not a psdmc model file"):
        load(path)


def test_a_folder_is_no_model(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        load(tmp_path)


def test_an_unwritable_place_leaves_nothing_behind(tmp_path: Path) -> None:
    model = bundled_model("two_link")
    with pytest.raises(InputError, match="cannot be written"):
        model.save(tmp_path / "absent" / "model.npz")
    (tmp_path / "taken.npz").mkdir()
    with pytest.raises(InputError, match="cannot be written"):
        model.save(tmp_path / "taken.npz")
    assert [path.name for path in tmp_path.iterdir()] == ["taken.npz"]


def test_the_mechanism_is_found_by_its_old_name() -> None:
    loaded, model = bundled_robot("two_link"), bundled_model("two_link")
    assert loaded.chain is loaded.mechanism
    assert model.chain is model.mechanism
