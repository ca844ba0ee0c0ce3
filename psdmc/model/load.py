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
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.errors import InputError
from psdmc.files import read_file
from psdmc.model.calibrated import Calibrated
from psdmc.model.calibrated_json import from_json
from psdmc.model.chain_json import chain_from_json
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.expansion import BLOCKS, Entries, Expansion
from psdmc.model.json_values import entries, flag, number, numbers, part, record, text
from psdmc.model.store import ARRAYS, FORMAT, SCHEMA, hash_of
from psdmc.robot.inertia import leading_rows
from psdmc.robot.load_options import LoadOptions
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, Mechanism


def _with_calibration(manifest: dict[str, Any]) -> dict[str, Any]:
    """The manifest with the calibration beside the provenance, which psdmc 0.2 kept it in."""
    provenance = record(manifest.get("provenance", {}), "the provenance")
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
            f"an object of the type {type(given).__name__} was given where a model is expected",
            "psdmc.derive(robot_file) or psdmc.load(model_file) gives one",
        )
    if Path(given).suffix.lower() in ROBOT_FILES and Path(given).exists():
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
    """Return the model from the bytes of a model file. Raises InputError, with the file's name, as `load` does."""
    try:
        arrays, manifest = _read(data, source)
        if manifest.get("content_hash") != hash_of(arrays, manifest):
            raise BrokenArchiveError("its content does not match its hash")
        while manifest["schema"] < SCHEMA:
            manifest = _MIGRATIONS[manifest["schema"]](manifest)
        return model_from(arrays, manifest)
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
    """Shape, whether stored by columns, type, and place of the data; NumPy's parser evaluates literals only."""
    stream = io.BytesIO(content)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        if np.lib.format.read_magic(stream) != (1, 0):
            raise ValueError("another version than psdmc's")
        shape, is_fortran, dtype = np.lib.format.read_array_header_1_0(stream)
    return shape, is_fortran, dtype, stream.tell()


# A model from the arrays of its file
#
# All values are checked, because the file may be forged.
#
# The checks cover everything that other parts of psdmc assume: types, shapes, ranges and finite numbers.
# Base parameters must also have pivots within the standard parameters that the robot's assumptions allow.


Arrays = Mapping[str, NDArray[Any]]

KINDS = {
    "E": (np.uint8, 2),
    "theta_b": (np.float64, 1),
    "P_joint": (np.int32, 1),
    "P_row": (np.int32, 1),
    "P_col": (np.int32, 1),
    "P_value": (np.float64, 1),
    "B": (np.float64, 2),
}
"""Type and axes of each array."""

MOST_ROWS = 1_000_000
"""Largest number of rows of a table in the provenance."""


HIGHEST_POWER = 2
"""Of a factor of a monomial: torques are quadratic in rates, and in each joint's sine and cosine."""


def model_from(arrays: Arrays, manifest: Mapping[str, Any]) -> DynamicsModel:
    """Return the model from the arrays and the manifest (a JSON text) of a file. Raises ValueError that says which part
    is wrong, what was found and what was expected."""
    _check_kinds(arrays)
    chain = chain_from_json(part(manifest, "chain", "the manifest"))
    l = arrays["B"].shape[0]
    is_expanded = flag(part(manifest, "expanded", "the manifest"), "'expanded'")
    is_known = flag(part(manifest, "theta_b_known", "the manifest"), "'theta_b_known'")
    certificate = part(manifest, "certificate", "the manifest")
    _check_base_parameters(arrays, chain, l, is_known)
    if is_expanded and not all(kind.about_z for kind in chain.types):
        raise ValueError("E and P are of joints of one coordinate, and a joint has several")
    return DynamicsModel(
        expansion=_expansion(arrays, chain.nv, l) if is_expanded else None,
        theta_b=arrays["theta_b"] if is_known else None,
        B=arrays["B"],
        mechanism=chain,
        certificate=numbers(certificate, "the certificate", chain.nv),
        provenance=_provenance(part(manifest, "provenance", "the manifest"), chain),
        calibrated=_calibrated(manifest, chain),
    )


def _calibrated(manifest: Mapping[str, Any], chain: Mechanism) -> Calibrated | None:
    """Read what a calibration found. Raises ValueError unless its joints are the chain's."""
    if "calibration" not in manifest:
        return None
    found = from_json(manifest["calibration"])
    joints = {joint.name for joint in chain.joints}
    foreign = [row.joint for row in (*found.motors, *found.friction) if row.joint not in joints]
    if foreign:
        raise ValueError(f"the calibration has joint {foreign[0]!r}, which the chain has not")
    return found


def _check_kinds(arrays: Arrays) -> None:
    for name, (dtype, axes) in KINDS.items():
        found = arrays[name]
        if found.dtype != dtype or found.ndim != axes:
            raise ValueError(
                f"{name} has type {found.dtype} and {found.ndim} axes, expected {np.dtype(dtype)} and {axes}"
            )


def _check_base_parameters(arrays: Arrays, chain: Mechanism, l: int, is_known: bool) -> None:
    B, span = arrays["B"], chain.parameter_span
    if B.shape[1] != PARAMETERS_PER_LINK * len(chain) or l > B.shape[1]:
        raise ValueError(f"B has shape {B.shape} for {len(chain)} joints")
    if not np.isfinite(B).all() or (is_known and not np.isfinite(arrays["theta_b"]).all()):
        raise ValueError("B or theta_b is not finite")
    alone = (B != 0.0).sum(axis=0) == 1
    first = np.argmax(alone & (B == 1.0), axis=1) if B.shape[1] else np.zeros(0, int)
    if not (alone[first] & (B[np.arange(l), first] == 1.0)).all():
        raise ValueError("a base parameter has no standard parameter of its own")
    leads = leading_rows(span) if span.size else np.zeros(0, int)
    if not np.isin(first, leads).all():
        raise ValueError("a base parameter lies outside the parameters' span")


def _expansion(arrays: Arrays, n: int, l: int) -> Expansion:
    E, values = arrays["E"], arrays["P_value"]
    ranges = {"P_joint": n, "P_row": E.shape[1], "P_col": l}
    for name, count in ranges.items():
        if arrays[name].shape != values.shape:
            raise ValueError(f"{name} has {len(arrays[name])} entries, P_value {len(values)}")
        if values.size and not 0 <= arrays[name].min() <= arrays[name].max() < count:
            raise ValueError(f"{name} has entries outside 0 to {count - 1}")
    if not np.isfinite(values).all():
        raise ValueError("P is not finite")
    if (np.diff(arrays["P_joint"]) < 0).any():
        raise ValueError("P_joint is not in order")
    if E.shape[0] != BLOCKS * n:
        raise ValueError(f"E has {E.shape[0]} rows for {n} joints")
    if E.size and E.max() > HIGHEST_POWER:
        raise ValueError(f"E has exponents up to {E.max()}, expected {HIGHEST_POWER} at most")
    return Expansion(E, Entries(arrays["P_joint"], arrays["P_row"], arrays["P_col"], values), l)


def _provenance(value: object, chain: Mechanism) -> dict[str, Any]:
    """The model's origin, checked as far as psdmc reads it again."""
    found = record(value, "the provenance")
    for name in ("source_text", "source_sha256", "source_name"):
        if found.get(name) is not None:
            text(found[name], f"the provenance's {name}")
    if found.get("source_format", "urdf") not in ("urdf", "dh"):
        raise ValueError("the provenance's source_format is neither urdf nor dh")
    if "options" in found:
        _check_options(record(found["options"], "the provenance's options"), chain)
    for snap in entries(found.get("snapped", []), "the provenance's snapped", MOST_ROWS):
        text(part(snap, "where", "a snapped rotation"), "a snapped rotation's place")
        number(part(snap, "angle_rad", "a snapped rotation"), "a snapped rotation's angle")
    if found.get("snap_torque_change") is not None:
        numbers(found["snap_torque_change"], "the provenance's snap_torque_change", chain.nv)
    return found


def _check_options(options: dict[str, Any], chain: Mechanism) -> None:
    """ValueError unless these are keyword arguments of load_robot, of kinds that it takes or refuses with a message."""
    foreign = [name for name in options if name not in {field.name for field in fields(LoadOptions)}]
    if foreign:
        raise ValueError(f"the provenance has an option '{foreign[0]}'")
    for name in ("base", "tip", "root"):
        if options.get(name) is not None:
            text(options[name], f"the option {name}")
    if options.get("gravity") is not None:
        numbers(options["gravity"], "the option gravity", 3)
    if not isinstance(options.get("drive_inertia", False), bool):
        driven = sum(kind.about_z for kind in chain.types)
        numbers(options["drive_inertia"], "the option drive_inertia", driven)
    for statement in entries(options.get("assume_zero", []), "the option assume_zero", MOST_ROWS):
        text(statement, "an entry of the option assume_zero")
    number(options.get("snap", 0.0), "the option snap")
    for table in entries(options.get("loops", []), "the option loops", MOST_ROWS):
        record(table, "an entry of the option loops")
    for option in ("frames", "contacts"):
        for name in entries(options.get(option, []), f"the option {option}", MOST_ROWS):
            text(name, f"the option {option}")
    for value in record(options.get("lock", {}), "the option lock").values():
        number(value, "an entry of the option lock")
    for value in record(options.get("xacro_args", {}), "the option xacro_args").values():
        text(value, "an entry of the option xacro_args")
    flag(options.get("floating", False), "the option floating")
    if options.get("tool") is not None:
        numbers(options["tool"], "the option tool", 6)
