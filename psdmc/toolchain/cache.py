"""Compiled libraries by content: what was compiled once is found again, whoever compiled it.

The key holds everything that decides the binary: sources, flags, compiler, CPU features, psdmc's version and
the platform. Two processes may race: each builds in a folder of its own and renames it into place, and the
loser takes the winner's.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
import sysconfig
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from psdmc.errors import ToolchainError

VARIABLE = "PSDMC_CACHE_DIR"


def cache_directory() -> Path:
    """PSDMC_CACHE_DIR, else the platform's place for caches."""
    chosen = os.environ.get(VARIABLE)
    if chosen:
        return Path(chosen)
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "psdmc"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", str(Path.home()))) / "psdmc" / "cache"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "psdmc"


def cache_key(files: Mapping[str, str], parts: Sequence[str]) -> str:
    """Hex digest of file names, texts and everything else that decides the binary."""
    platform = (sys.platform, sysconfig.get_platform(), str(sysconfig.get_config_var("SOABI")))
    digest = hashlib.sha256()
    for part in (*platform, *parts, *(item for path in sorted(files) for item in (path, files[path]))):
        data = part.encode("utf-8")
        digest.update(len(data).to_bytes(8, "little"))
        digest.update(data)
    return digest.hexdigest()


def cached(key: str, build: Callable[[Path], None]) -> Path:
    """The folder that `build` filled for this key, now or earlier; ToolchainError where no folder can be
    made."""
    final = cache_directory() / key
    if final.is_dir():
        return final
    try:
        final.parent.mkdir(parents=True, exist_ok=True)
        own = Path(tempfile.mkdtemp(prefix=f".{key[:16]}-", dir=final.parent))
    except OSError as error:
        raise ToolchainError(
            f"{final.parent}: cannot write to the compile cache: {error.strerror}",
            f"set {VARIABLE} to a folder of yours",
        ) from error
    try:
        build(own)
        _rename(own, final)
    finally:
        shutil.rmtree(own, ignore_errors=True)
    return final


def _rename(own: Path, final: Path) -> None:
    try:
        own.rename(final)
    except OSError as error:
        if not final.is_dir():
            raise ToolchainError(f"{final}: cannot write to the compile cache: {error.strerror}") from error
