"""npz files: arrays, headers, the manifest of a model (its hash made right again), and the archive's bytes."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from random import Random
from typing import Any

import numpy as np
from mutate_bytes import mutate_bytes
from mutate_tree import mutate_tree
from nasty import text

Members = dict[str, bytes]

TYPES = ("f8", "f4", "i4", "i8", "u1", "?", "c16", "U5", "S3", "M8[s]", ">f8", "V3")
VALUES = (np.nan, np.inf, -np.inf, 0.0, -1.0, 1e300, 1e155, 1e-300, 255.0, 2.0**31, 0.5)
SHAPES = (
    "(0,)",
    "()",
    "(1000000000,)",
    "(10000000000000000000,)",
    "(-1,)",
    "(2, 3)",
    "(1,)",
    "(3, 0)",
    "(0, 1000000000)",
    "(True,)",
    "(1.5,)",
    "None",
)
HASHED = ("E", "theta_b", "P_joint", "P_row", "P_col", "P_value", "B")
"""Arrays in the order in which a model file's content hash takes them (psdmc/model/store.py)."""


def mutate_npz(data: bytes, rng: Random) -> bytes:
    if rng.random() < 0.1:
        return mutate_bytes(data, rng)
    members = unpacked(data)
    if not members:
        return mutate_bytes(data, rng)
    rehash = rng.random() < 0.8
    for _ in range(rng.choice((1, 1, 1, 2))):
        if "manifest.npy" in members and rng.random() < 0.6:
            _manifest(members, rng)
        elif members:
            _array(members, rng)
    if rehash:
        set_hash(members)
    return packed(members, zipfile.ZIP_STORED if rng.random() < 0.3 else zipfile.ZIP_DEFLATED)


def unpacked(data: bytes) -> Members:
    """Members by name; none where this is no archive."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return {
                info.filename: archive.read(info) for info in archive.infolist() if info.file_size < 1 << 22
            }
    except Exception:
        return {}


def packed(members: Members, method: int = zipfile.ZIP_DEFLATED) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as archive:
        for name, content in members.items():
            archive.writestr(zipfile.ZipInfo(name), content, method)
    return stream.getvalue()


def _npy(array: Any) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.asarray(array), allow_pickle=False)
    return stream.getvalue()


def _read(content: bytes) -> Any:
    """The array, or None where it cannot be read."""
    try:
        return np.lib.format.read_array(io.BytesIO(content), allow_pickle=False)
    except Exception:
        return None


def manifest_of(members: Members) -> Any:
    try:
        return json.loads(str(_read(members["manifest.npy"])))
    except (KeyError, ValueError, RecursionError):
        return None


def _manifest(members: Members, rng: Random) -> None:
    if rng.random() < 0.1:
        words = mutate_bytes(str(_read(members["manifest.npy"])).encode(), rng)
        members["manifest.npy"] = _npy(np.array(words.decode("utf-8", errors="replace")))
        return
    changed = mutate_tree(manifest_of(members), rng)
    members["manifest.npy"] = _npy(np.array(_json(changed)))


def _json(value: Any) -> str:
    try:
        return json.dumps(value)
    except ValueError:
        return "null"


def set_hash(members: Members) -> None:
    """The content hash that the arrays and the manifest now have; left alone where they have none."""
    manifest = manifest_of(members)
    arrays = {name: _read(members.get(f"{name}.npy", b"")) for name in HASHED}
    if not isinstance(manifest, dict) or any(array is None for array in arrays.values()):
        return
    plain = {key: value for key, value in manifest.items() if key != "content_hash"}
    digest = hashlib.sha256(_json_sorted(plain))
    for name, array in arrays.items():
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    members["manifest.npy"] = _npy(np.array(_json(manifest | {"content_hash": digest.hexdigest()})))


def _json_sorted(value: Any) -> bytes:
    try:
        return json.dumps(value, sort_keys=True).encode()
    except (TypeError, ValueError):
        return b""


def _array(members: Members, rng: Random) -> None:
    name = rng.choice(list(members))
    array = _read(members[name])
    choice = rng.randrange(9)
    if choice == 0:
        del members[name]
    elif choice == 1:
        members[rng.choice((text(rng), name[:-4] + text(rng), "E.npy", "P_row.npy"))] = members[name]
    elif choice == 2:
        members[name] = mutate_bytes(members[name], rng)
    elif choice == 3 or array is None:
        members[name] = _with_header(members[name], rng)
    else:
        members[name] = _changed(array, rng)


def _with_header(content: bytes, rng: Random) -> bytes:
    """Another dtype, order or shape in front of the same numbers."""
    described = {"descr": "<" + rng.choice(("f8", "i4", "u1")), "fortran_order": rng.random() < 0.3}
    words = ", ".join(f"{key!r}: {value!r}" for key, value in described.items())
    header = f"{{{words}, 'shape': {rng.choice(SHAPES)}, }}"
    header = header if rng.random() < 0.9 else header[: rng.randrange(len(header))]
    padded = header.encode("latin-1") + b" " * 8 + b"\n"
    return b"\x93NUMPY\x01\x00" + len(padded).to_bytes(2, "little") + padded + content[128:]


def _changed(array: Any, rng: Random) -> bytes:
    choice = rng.randrange(5)
    try:
        if choice == 0 and array.size:
            array = array.copy()
            with np.errstate(all="ignore"):
                array.reshape(-1)[rng.randrange(array.size)] = rng.choice(VALUES)
        elif choice == 1:
            array = array.astype(rng.choice(TYPES))
        elif choice == 2:
            array = array.reshape(rng.choice((-1, (1, -1), (-1, 1), array.shape[::-1])))
        elif choice == 3:
            array = np.concatenate([array, array], axis=rng.randrange(max(array.ndim, 1)))
        else:
            array = array[: rng.randrange(array.shape[0] + 1)]
        return _npy(array)
    except Exception:
        return _npy(np.zeros(rng.randrange(5)))
