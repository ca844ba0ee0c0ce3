"""Model files: one .npz that numpy.load(..., allow_pickle=False) reads, the same bytes for the same model.

Arrays: E (5n, p); theta_b (l,), all NaN while unknown; P as P_joint, P_row, P_col, P_value, one entry each,
joint by joint and row by row; B (l, 11n); manifest, JSON text: format, schema, what the arrays hold, chain,
certificate, provenance, psdmc version, and the SHA-256 of all of that.
"""

from __future__ import annotations

import hashlib
import io
import json
import reprlib
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from psdmc.atomic import write_whole
from psdmc.errors import InputError
from psdmc.model.archive import LARGEST, BrokenArchiveError, opened, read_arrays
from psdmc.model.chain_json import MOST_JOINTS, chain_to_json
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.from_parts import model_from
from psdmc.version import psdmc_version

SCHEMA = 1
FORMAT = "psdmc model"
ARRAYS = ("E", "theta_b", "P_joint", "P_row", "P_col", "P_value", "B")

_MIGRATIONS: dict[int, Callable[[dict[str, Any]], dict[str, Any]]] = {}
"""By schema: what makes its manifest one of the next schema. Empty while there is only one."""

_NO_DATE = (1980, 1, 1, 0, 0, 0)
"""Zip's earliest date: a file's bytes must not tell when it was written."""

LARGEST_MANIFEST = 64 << 20
"""Bytes of the manifest's text, at four a letter; a nine-joint arm's has 0.1 MB beside its source."""

Arrays = Mapping[str, NDArray[Any]]


def save(model: DynamicsModel, path: str | Path) -> None:
    """Write a model file, whole or not at all; InputError where the place does not admit it, ToolchainError
    where the disk does not."""
    if model.n > MOST_JOINTS:
        raise InputError(
            f"{path}: {model.n} joints, model files hold up to {MOST_JOINTS}",
            "cut the chain with --base and --tip",
        )
    write_whole(path, file_bytes(model))


def file_bytes(model: DynamicsModel) -> bytes:
    """The model file's content."""
    arrays = _arrays(model)
    manifest = _manifest(model)
    manifest["content_hash"] = _hash(arrays, manifest)
    text = np.array(json.dumps(manifest, indent=1, allow_nan=False))
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, array in (arrays | {"manifest": text}).items():
            member = zipfile.ZipInfo(f"{name}.npy", date_time=_NO_DATE)
            member.external_attr = 0o644 << 16
            content = io.BytesIO()
            np.lib.format.write_array(content, array, allow_pickle=False)
            archive.writestr(member, content.getvalue(), zipfile.ZIP_DEFLATED)
    return stream.getvalue()


def content_hash(model: DynamicsModel) -> str:
    """SHA-256 of everything that a model file holds, as hexadecimal digits."""
    return _hash(_arrays(model), _manifest(model))


def _arrays(model: DynamicsModel) -> dict[str, NDArray[Any]]:
    blocks = [] if model.P is None else [sparse.coo_array(matrix) for matrix in model.P]
    joints = [np.full(block.nnz, i) for i, block in enumerate(blocks)]
    return {
        "E": np.zeros((5 * model.n, 0), np.uint8) if model.E is None else np.ascontiguousarray(model.E),
        "theta_b": np.full(model.l, np.nan) if model.theta_b is None else np.asarray(model.theta_b),
        "P_joint": _stacked(joints, np.int32),
        "P_row": _stacked([block.coords[0] for block in blocks], np.int32),
        "P_col": _stacked([block.coords[1] for block in blocks], np.int32),
        "P_value": _stacked([block.data for block in blocks], np.float64),
        "B": np.ascontiguousarray(model.B),
    }


def _stacked(parts: list[NDArray[Any]], dtype: type) -> NDArray[Any]:
    return np.concatenate([np.zeros(0), *parts]).astype(dtype)


def _manifest(model: DynamicsModel) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "schema": SCHEMA,
        "psdmc": psdmc_version(),
        "expanded": model.E is not None,
        "theta_b_known": model.theta_b is not None,
        "certificate": model.certificate.tolist(),
        "chain": chain_to_json(model.chain),
        "provenance": dict(model.provenance),
    }


def _hash(arrays: Arrays, manifest: Mapping[str, Any]) -> str:
    digest = hashlib.sha256()
    plain = {key: value for key, value in manifest.items() if key != "content_hash"}
    digest.update(json.dumps(plain, sort_keys=True, allow_nan=False).encode())
    for name in ARRAYS:
        array = arrays[name]
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def load(path: str | Path) -> DynamicsModel:
    """Read a model file; InputError where it is missing, damaged, forged, foreign or of a newer psdmc."""
    source = Path(path)
    try:
        arrays, manifest = _read(source)
        if manifest.get("content_hash") != _hash(arrays, manifest):
            raise BrokenArchiveError("its content does not match its hash")
        return model_from(arrays, _migrated(manifest))
    except BrokenArchiveError as error:
        raise _damaged(source, str(error)) from error
    except (ValueError, RecursionError) as error:
        raise _damaged(source, f"its parts do not fit together ({error})") from error


def _read(source: Path) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Arrays and manifest, the manifest known to be psdmc's and of no newer schema."""
    data = _bytes_of(source)
    try:
        archive = opened(data)
        manifest = json.loads(_manifest_text(archive, len(data)))
    except BrokenArchiveError as error:
        raise _damaged(source, "it is truncated or altered") from error
    except (ValueError, RecursionError) as error:
        raise _foreign(source) from error
    _check_schema(source, manifest)
    try:
        return read_arrays(archive, ARRAYS, len(data)), manifest
    except BrokenArchiveError as error:
        raise _damaged(source, "it is truncated or altered") from error


def _bytes_of(source: Path) -> bytes:
    try:
        if source.stat().st_size > LARGEST:
            raise InputError(
                f"{source}: larger than any model file ({LARGEST >> 30} GiB)",
                "give a file that psdmc derive wrote",
            )
        return source.read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"{source}: no such file", "psdmc derive ROBOT -o MODEL.npz makes one") from error
    except OSError as error:
        raise InputError(
            f"{source}: cannot be read: {error.strerror or error}", "give a model file (.npz)"
        ) from error


def _manifest_text(archive: zipfile.ZipFile, size: int) -> str:
    array = read_arrays(archive, ["manifest"], size)["manifest"]
    if array.ndim or array.dtype.kind != "U" or array.itemsize > LARGEST_MANIFEST:
        raise ValueError("the manifest is no text")
    try:
        letters = array.astype(array.dtype.newbyteorder("<")).tobytes()
        return letters.decode("utf-32-le").rstrip("\0")
    except UnicodeDecodeError as error:
        raise BrokenArchiveError(str(error)) from error


def _check_schema(source: Path, manifest: Any) -> None:
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise _foreign(source)
    schema = manifest.get("schema")
    if not isinstance(schema, int) or isinstance(schema, bool) or schema < 1:
        raise _damaged(source, f"its schema is {reprlib.repr(schema)}, expected 1 to {SCHEMA}")
    if schema > SCHEMA:
        raise InputError(
            f"{source}: model schema {reprlib.repr(schema)}, this psdmc reads up to {SCHEMA}",
            f"install psdmc {reprlib.repr(manifest.get('psdmc', ''))} or newer, or derive the model again",
        )


def _migrated(manifest: dict[str, Any]) -> dict[str, Any]:
    while manifest["schema"] < SCHEMA:
        manifest = _MIGRATIONS[manifest["schema"]](manifest)
    return manifest


def _damaged(source: Path, why: str) -> InputError:
    return InputError(f"{source}: damaged model file: {why}", "derive the model again")


def _foreign(source: Path) -> InputError:
    return InputError(f"{source}: not a psdmc model file", "psdmc derive ROBOT -o MODEL.npz makes one")
