"""Reading of model files. The reader expects that a file can be damaged, forged, or no model file. It checks sizes before
it allocates memory, and unpickles nothing."""

from __future__ import annotations

import io
import json
import math
import reprlib
import shlex
import tokenize
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.errors import InputError
from psdmc.model import json_values
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.from_parts import model_from
from psdmc.model.store import ARRAYS, FORMAT, SCHEMA, hash_of
from psdmc.reading import read_file


def _with_calibration(manifest: dict[str, Any]) -> dict[str, Any]:
    """The manifest with the calibration beside the provenance, which psdmc 0.2 kept it in."""
    provenance = json_values.record(manifest.get("provenance", {}), "the provenance")
    rest = {name: value for name, value in provenance.items() if name != "calibration"}
    found = {"calibration": provenance["calibration"]} if "calibration" in provenance else {}
    return {**manifest, "provenance": rest, **found, "schema": 3}


_MIGRATIONS: dict[int, Callable[[dict[str, Any]], dict[str, Any]]] = {
    1: lambda manifest: manifest | {"schema": 2},
    2: _with_calibration,
    3: lambda manifest: manifest | {"schema": 4},
}
"""By schema: what makes its manifest one of the next schema. A chain of schema 1 is read as it is."""

LARGEST_MANIFEST = 64 << 20
"""Largest size in bytes of the manifest's text, at four bytes a letter; a nine-joint arm's has 0.1 MB besides its
source."""


ROBOT_FILES = (".urdf", ".toml", ".xml", ".xacro", ".mjcf", ".sdf")
"""Endings of files that hold robots, not models."""


def model_of(given: DynamicsModel | str | Path) -> DynamicsModel:
    """Return the given model, or read the model file at the given path. Raises InputError if the argument is the path
    of a robot file, or of any other file without a model."""
    if isinstance(given, DynamicsModel):
        return given
    if not isinstance(given, str | Path):
        raise InputError(
            f"a {type(given).__name__} was given where a model is expected",
            "psdmc.derive(robot_file) or psdmc.load(model_file) gives one",
        )
    if Path(given).suffix.lower() in ROBOT_FILES:
        raise InputError(
            f"{given}: a robot's file was given where a model is expected",
            f"derive it first: psdmc.derive({str(given)!r})",
        )
    return load(given)


def load(path: str | Path) -> DynamicsModel:
    """Read a model from a file that `save` or `psdmc derive` wrote.

    Raises InputError if the file is missing, damaged or edited, or if a newer version of psdmc wrote it.
    """
    source = Path(path)
    return load_bytes(_bytes_of(source), source)


def load_bytes(data: bytes, source: Path) -> DynamicsModel:
    """Return the model from the bytes of a model file. Raises InputError with the file's name, in the cases in which
    `load` does."""
    try:
        arrays, manifest = _read(data, source)
        if manifest.get("content_hash") != hash_of(arrays, manifest):
            raise BrokenArchiveError("its content does not match its hash")
        return model_from(arrays, _migrated(manifest))
    except BrokenArchiveError as error:
        raise _damaged(source, str(error)) from error
    except (ValueError, RecursionError) as error:
        raise _damaged(source, f"its parts do not fit together ({error})") from error


def _read(data: bytes, source: Path) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Arrays and manifest; the manifest is psdmc's and not of a newer schema."""
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
        return read_file(source, LARGEST, "give a file that psdmc derive wrote", BEGINS)
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
    robot, model = "ROBOT", "MODEL.npz"
    if source.suffix.lower() in ROBOT_FILES:
        robot, model = (shlex.quote(str(path)) for path in (source, source.with_suffix(".npz")))
    hint = f"psdmc derive {robot} -o {model} makes one"
    return InputError(f"{source}: not a psdmc model file", hint)


# Arrays of an untrusted archive


BEGINS = b"PK"
"""First bytes of an archive."""
ALWAYS_ALLOWED = 64 << 20
"""Bytes that every file may unpack to."""
LARGEST = 2 << 30
"""Bytes that no file may have, or unpack to."""
LARGEST_RATIO = 200
"""Bytes unpacked per byte of the file, beyond ALWAYS_ALLOWED; models have 10 to 40, zip's own limit is 1032."""

_BROKEN = (
    zipfile.BadZipFile,
    zlib.error,
    EOFError,
    KeyError,
    NotImplementedError,
    RuntimeError,
    OverflowError,
    SyntaxError,
    tokenize.TokenError,
    UnicodeDecodeError,
    Warning,
)
"""Exceptions of zipfile and NumPy's header parser on altered bytes, found by altering every byte of a file."""


class BrokenArchiveError(ValueError):
    """The file begins like a zip archive, but is damaged."""


def opened(data: bytes) -> zipfile.ZipFile:
    """Return the archive in the bytes of a file, ready for reading. Raises ValueError if the bytes are no archive, and
    BrokenArchiveError if the archive is damaged."""
    if not data.startswith(BEGINS):
        raise ValueError("no zip archive")
    try:
        return zipfile.ZipFile(io.BytesIO(data))
    except (*_BROKEN, ValueError, OSError) as error:
        raise BrokenArchiveError(str(error)) from error


def read_arrays(archive: zipfile.ZipFile, names: Iterable[str], size: int) -> dict[str, NDArray[Any]]:
    """Return the named arrays of an archive in a file of `size` bytes.

    Raises ValueError if an array is missing, is larger than a file of that size can hold, or contains Python objects.
    Raises BrokenArchiveError if an array cannot be unpacked.
    """
    members = {info.filename: info for info in archive.infolist()}
    wanted = {name: members.get(f"{name}.npy") for name in names}
    missing = [name for name, info in wanted.items() if info is None]
    if missing:
        raise ValueError(f"no {', '.join(missing)}")
    total = sum(info.file_size for info in wanted.values() if info is not None)
    if total > min(LARGEST, max(ALWAYS_ALLOWED, LARGEST_RATIO * size)):
        raise ValueError(f"{size} bytes that would unpack to {total}")
    return {name: _array(archive, info) for name, info in wanted.items() if info is not None}


def _array(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> NDArray[Any]:
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError(f"{info.filename}: compressed in another way than NumPy's")
    try:
        content = archive.read(info)
        shape, is_fortran, dtype, start = _header(content)
    except (*_BROKEN, ValueError, TypeError, OSError) as error:
        raise BrokenArchiveError(f"{info.filename}: {error}") from error
    if dtype.hasobject or is_fortran or min(shape, default=0) < 0:
        raise ValueError(f"{info.filename}: no plain array")
    if math.prod(shape) * dtype.itemsize != len(content) - start:
        raise ValueError(f"{info.filename}: {len(content) - start} bytes for shape {shape} of {dtype}")
    return np.ndarray(shape, dtype, content, start)


def _header(content: bytes) -> tuple[tuple[int, ...], bool, np.dtype[Any], int]:
    """Shape, whether it is stored column by column, type, and the position of the data; NumPy's parser evaluates
    literals only."""
    stream = io.BytesIO(content)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        if np.lib.format.read_magic(stream) != (1, 0):
            raise ValueError("another version than psdmc's")
        shape, is_fortran, dtype = np.lib.format.read_array_header_1_0(stream)
    return shape, is_fortran, dtype, stream.tell()
