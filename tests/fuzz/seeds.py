"""What mutations start from: the bundled and example files, other people's URDFs, and a small file of every kind."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import shlex
import shutil
import sqlite3
import sysconfig
from pathlib import Path
from typing import Any

import fixtures
import numpy as np
from fixtures import (
    FILES,
    FIT_TO_READ,
    FIT_TO_USE,
    SHORT,
    SIMULATED,
    log,
    text,
    trajectory,
    write_bag,
    write_files,
)
from target_descriptions import write_described
from target_packages import manifest_seed

from psdmc.calibration.logs.log_files import columns_of, write_log
from psdmc.calibration.motions.trajectory import write_trajectory
from psdmc.compiler import derive
from psdmc.model.store import file_bytes

ROOT = Path(__file__).parents[2]
LARGEST_URDF = 20_000
"""bytes; larger ones repeat what smaller ones have and take their time"""


OPTIONS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("hand.urdf", {}),
    ("hand.urdf", {"lock": {"close": 0.01}}),
    ("hand.urdf", {"lock": {"wrist": -0.5}, "floating": True, "gravity": [0.0, 1.0, -9.0]}),
    (
        "hand.urdf",
        {"base": "palm", "tip": "thumb", "frames": ["thumb"], "tool": [0.1, 0.0, 0.0, 0.0, 0.5, 0.0]},
    ),
    ("hand.urdf", {"drive_inertia": [0.1, 0.2, 0.3, 0.4], "assume_zero": ["palm:mx"], "snap": 0.0}),
    ("legs.urdf", {"floating": True, "lock": {"hip_l": 0.3}}),
    ("legs.urdf", {"floating": True, "frames": ["left", "right"], "drive_inertia": True}),
    ("legs.urdf", {"tip": "left"}),
    ("arm.urdf", {"lock": {"second": 0.5}, "base": "upper", "tip": "tip"}),
    (
        "branches.toml",
        {"gravity": [0.0, 0.0, -1.6], "frames": ["left"], "tool": [0.0, 0.0, 0.1, 0.0, 0.0, 0.0]},
    ),
)
"""Files, and options that they are read with."""


def write_seeds(below: Path) -> Path:
    """The folder, made where it is missing, with seeds of every format in a folder each, and what stands around mutated
    files. Its name tells what it was made by; whole or not at all, as several processes may want it.
    """
    made_by = b"".join(
        path.read_bytes()
        for path in (Path(__file__), Path(fixtures.__file__), *sorted(fixtures.FILES.iterdir()))
    )
    folder = below / f"around-{hashlib.sha256(made_by).hexdigest()[:8]}"
    if folder.exists():
        return folder
    own = folder.with_name(f".{folder.name}.{os.getpid()}")
    shutil.rmtree(own, ignore_errors=True)
    own.mkdir(parents=True)
    write_files(own / "files")
    write_bag(own / "bag", FIT_TO_READ, mcap=False)
    for size in (SHORT, FIT_TO_READ):
        write_bag(own / "bags" / str(size[0]), size, mcap=False)
        write_bag(own / "mcap" / str(size[0]), size, mcap=True)
    write_described(own / "described")
    for name in ("two_link.toml", "plant.toml", "campaign"):
        source = own / "files" / name
        shutil.copytree(source, own / name) if source.is_dir() else shutil.copy(source, own / name)
    shutil.copytree(ROOT / "generated" / "two_link", own / "files" / "package")
    shutil.copy(ROOT / "examples" / "robots" / "denso_wall.toml", own / "denso_wall.toml")
    for format, seeds in _seeds(own).items():
        target = own / "seeds" / format
        target.mkdir(parents=True)
        for number, data in enumerate(seeds):
            (target / f"{number:02d}").write_bytes(data)
    try:
        own.rename(folder)
    except OSError:
        shutil.rmtree(own)
    return folder


def read_seeds(folder: Path, format: str) -> list[bytes]:
    return [path.read_bytes() for path in sorted((folder / "seeds" / format).iterdir())]


def _seeds(own: Path) -> dict[str, list[bytes]]:
    robots = sorted((ROOT / "examples" / "robots").iterdir())
    tables = [path.read_bytes() for path in robots if path.suffix == ".toml"]
    dh = [text(name).encode() for name in ("sliding.toml", "two_link.toml", "branches.toml", "unknown.toml")]
    plants = sorted((ROOT / "examples" / "plants").iterdir())
    sizes = (SHORT, FIT_TO_READ, FIT_TO_USE)
    return {
        "urdf": [
            *(text(f"{name}.urdf").encode() for name in ("arm", "pendulum", "hand", "legs")),
            *_urdfs(robots),
        ],
        "mjcf": [text(f"{name}_mjcf.xml").encode() for name in ("arm", "flying", "gripper")],
        "dh": [*dh, *tables],
        "options": [_with_options(*words) for words in OPTIONS],
        "model": [*_models(robots), (own / "files" / "arm.npz").read_bytes()],
        **{
            f"log-{kind}": [_log(own, f".{kind}", *size) for size in sizes]
            for kind in ("csv", "npz", "parquet")
        },
        "log-db3": [_repacked(path) for path in sorted((own / "bags").rglob("*.db3"))],
        "log-mcap": [path.read_bytes() for path in sorted((own / "mcap").rglob("*.mcap"))],
        "bag": [(own / "bag" / "metadata.yaml").read_bytes()],
        "trajectory": [_trajectory(own)],
        "campaign": [text("campaign.toml").encode()],
        "description": [
            text(f"described{kind}.toml").encode() for kind in ("", "_tables", "_bag", "_columns")
        ],
        "described-csv": [(own / "described" / "run.csv").read_bytes().replace(b"a1,a2", b"q1,q2")],
        "simulated": [json.dumps(SIMULATED).encode(), b"{}"],
        "plant": [
            text("plant.toml").encode(),
            *(path.read_bytes().replace(b"../robots/", b"") for path in plants),
        ],
        "plant-robot": dh[:2],
        "package": [
            manifest_seed().encode(),
            (ROOT / "generated" / "two_link" / "manifest.json").read_bytes(),
        ],
        "argv": [json.dumps(shlex.split(line)).encode() for line in text("commands.txt").splitlines()],
    }


def _with_options(name: str, options: dict[str, Any]) -> bytes:
    return json.dumps({"robot": text(name), "options": options}).encode()


def _urdfs(bundled: list[Path]) -> list[bytes]:
    """Bundled ones, and those of the example-robot-data wheel where it is installed."""
    wheel = Path(sysconfig.get_path("purelib"), "cmeel.prefix", "share", "example-robot-data", "robots")
    foreign = [path for path in sorted(wheel.rglob("*.urdf")) if path.stat().st_size <= LARGEST_URDF]
    return [path.read_bytes() for path in [*bundled, *foreign] if path.suffix == ".urdf"]


def _models(robots: list[Path]) -> list[bytes]:
    """Small ones: expanded and not, known and unknown parameters, with their sources."""
    named = {path.stem: path for path in robots}
    small = [derive(named["two_link"])]
    small += [derive(named[name], expand=False) for name in ("scara_zeros", "rounded_arm")]
    small += [derive(FILES / "hand.urdf"), derive(FILES / "legs.urdf", floating=True)]
    small += [derive(FILES / "branches.toml", expand=True)]
    return [file_bytes(model) for model in small]


def _log(own: Path, suffix: str, seconds: float, rate: float) -> bytes:
    run = log(seconds, rate)
    if suffix == ".npz":
        stream = io.BytesIO()
        np.savez_compressed(stream, **columns_of(run))  # type: ignore[arg-type]
        return stream.getvalue()
    write_log(run, own / f"log{suffix}")
    return (own / f"log{suffix}").read_bytes()


def _repacked(database: Path) -> bytes:
    """The bag in small pages: 7 KB instead of 40."""
    with contextlib.closing(sqlite3.connect(database)) as connection:
        connection.execute("PRAGMA page_size = 512")
        connection.execute("VACUUM")
    return database.read_bytes()


def _trajectory(own: Path) -> bytes:
    write_trajectory(trajectory(), own / "motion.csv")
    return (own / "motion.csv").read_bytes()
