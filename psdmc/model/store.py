"""Model files: one .npz that numpy.load(..., allow_pickle=False) reads, with equal bytes for equal models. Arrays are
not compressed, because compressed bytes differ between versions of zlib.

Arrays: E (5n, p); theta_b (l,), all NaN if unknown; P as P_joint, P_row, P_col, P_value, with one entry of P each,
joint by joint and row by row; B (l, 11n).

The manifest is a JSON text. It contains format, schema, what the arrays hold, robot, certificate, provenance and psdmc
version. If the model is calibrated, it also contains the calibration (calibrated_json). At the end is the SHA-256 of
the arrays and of the rest of the manifest.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from psdmc.errors import InputError
from psdmc.files import write_whole
from psdmc.model.calibrated import Calibrated
from psdmc.model.calibrated_json import as_json
from psdmc.model.chain_json import MOST_JOINTS, chain_to_json, is_plain_chain
from psdmc.model.expansion import BLOCKS, Entries, Expansion
from psdmc.robot.mechanism import Mechanism
from psdmc.version import psdmc_version

CHAIN_SCHEMA = 1
"""Of files with serial chains, which every psdmc reads."""
TREE_SCHEMA = 2
"""Of files with trees, or with mimic joints."""
CALIBRATED_SCHEMA = 3
"""Of files with a calibration."""
SCHEMA = 4
"""Of files with closed loops: the newest."""
FORMAT = "psdmc model"
ARRAYS = ("E", "theta_b", "P_joint", "P_row", "P_col", "P_value", "B")

_NO_DATE = (1980, 1, 1, 0, 0, 0)
"""The earliest date of zip: a file's bytes must not depend on when it was written."""

Arrays = Mapping[str, NDArray[Any]]


class Model(Protocol):
    """The attributes of a model that a model file contains. DynamicsModel itself imports this file."""

    @property
    def theta_b(self) -> NDArray[np.float64] | None: ...

    @property
    def mechanism(self) -> Mechanism: ...

    @property
    def certificate(self) -> NDArray[np.float64]: ...

    @property
    def provenance(self) -> Mapping[str, Any]: ...

    @property
    def calibrated(self) -> Calibrated | None: ...

    @property
    def expansion(self) -> Expansion | None: ...

    @property
    def B(self) -> NDArray[np.float64]: ...


def save(model: Model, path: str | Path) -> None:
    """Write a model to a file, which `load` reads. If writing fails, an existing file at the path stays unchanged.

    Raises InputError if psdmc may not write at the path, and ToolchainError if the disk is full or fails.
    """
    n = len(model.mechanism)
    if n > MOST_JOINTS:
        raise InputError(
            f"{path}: {n} joints, model files hold up to {MOST_JOINTS}",
            "cut the chain with --base and --tip",
        )
    write_whole(path, file_bytes(model))


def file_bytes(model: Model) -> bytes:
    """The model file's content."""
    arrays = _arrays(model)
    manifest = _manifest(model)
    manifest["content_hash"] = hash_of(arrays, manifest)
    text = np.array(json.dumps(manifest, indent=1, allow_nan=False))
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, array in (arrays | {"manifest": text}).items():
            member = zipfile.ZipInfo(f"{name}.npy", date_time=_NO_DATE)
            member.external_attr = 0o644 << 16
            content = io.BytesIO()
            np.lib.format.write_array(content, array, allow_pickle=False)
            archive.writestr(member, content.getvalue(), zipfile.ZIP_STORED)
    return stream.getvalue()


def content_hash(model: Model) -> str:
    """Return the SHA-256 of everything that a model file contains, as hexadecimal digits."""
    return hash_of(_arrays(model), _manifest(model))


def _arrays(model: Model) -> dict[str, NDArray[Any]]:
    # Where the model has no E and P, a file holds empty ones.
    no_exponents = np.zeros((BLOCKS * len(model.mechanism), 0), np.uint8)
    expansion = model.expansion or Expansion(no_exponents, Entries(*np.zeros((4, 0))), len(model.B))
    joint, row, column, value = expansion.entries
    return {
        "E": expansion.E,
        "theta_b": np.full(len(model.B), np.nan) if model.theta_b is None else np.asarray(model.theta_b),
        "P_joint": joint,
        "P_row": row,
        "P_col": column,
        "P_value": value,
        "B": np.ascontiguousarray(model.B),
    }


def _manifest(model: Model) -> dict[str, Any]:
    schema = CHAIN_SCHEMA if is_plain_chain(model.mechanism) else TREE_SCHEMA
    calibrated = model.calibrated
    schema = schema if calibrated is None else CALIBRATED_SCHEMA
    return {
        "format": FORMAT,
        "schema": SCHEMA if model.mechanism.loops or model.mechanism.has_sums else schema,
        "psdmc": psdmc_version(),
        "expanded": model.expansion is not None,
        "theta_b_known": model.theta_b is not None,
        "certificate": model.certificate.tolist(),
        "chain": chain_to_json(model.mechanism),
        "provenance": dict(model.provenance),
        **({} if calibrated is None else {"calibration": as_json(calibrated)}),
    }


def hash_of(arrays: Arrays, manifest: Mapping[str, Any]) -> str:
    """Return the SHA-256 of a model file's arrays and manifest, without the manifest's content_hash."""
    digest = hashlib.sha256()
    plain = {key: value for key, value in manifest.items() if key != "content_hash"}
    digest.update(json.dumps(plain, sort_keys=True, allow_nan=False).encode())
    for name in ARRAYS:
        array = arrays[name]
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
