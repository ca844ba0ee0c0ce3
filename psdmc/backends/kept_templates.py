"""Templates' compiled code, kept where Python keeps that of modules: in `__pycache__` beside them.

Jinja makes Python of a template and Python makes code of that, which takes longer than filling it. As with modules, code is
kept once per installation, where its folder can be written to, and belongs to one source, one Python and one Jinja.
"""

from __future__ import annotations

import contextlib
import hashlib
import marshal
import os
import sys
from functools import cache
from importlib.util import MAGIC_NUMBER, cache_from_source
from pathlib import Path

import jinja2.compiler
from jinja2.bccache import Bucket, BytecodeCache

SEAL = hashlib.sha256().digest_size
"""Bytes before the code: a digest of the code and of all that it was made from. Code that was altered or cut short is
made again."""


class CodeBesideTemplates(BytecodeCache):
    """The store in which Jinja looks for a template's code before it compiles it, and into which it puts the code
    afterwards."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def get_cache_key(self, name: str, filename: str | None = None) -> str:
        """The file that a template's code is kept in."""
        return cache_from_source(str(self.folder / name))

    def load_bytecode(self, bucket: Bucket) -> None:
        """The template's code, if some is kept that belongs to it."""
        with contextlib.suppress(OSError):
            kept = Path(bucket.key).read_bytes()
            seal, code = kept[:SEAL], kept[SEAL:]
            if seal == _seal(bucket, code):
                bucket.code = marshal.loads(code)

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Keep the template's code where Python would keep a module's; do nothing where that cannot be written."""
        if sys.dont_write_bytecode:
            return
        code = marshal.dumps(bucket.code)
        file = Path(bucket.key)
        own = file.with_name(f"{file.name}.{os.getpid()}")
        with contextlib.suppress(OSError):
            file.parent.mkdir(parents=True, exist_ok=True)
            own.write_bytes(_seal(bucket, code) + code)
            own.replace(file)


def _seal(bucket: Bucket, code: bytes) -> bytes:
    made = bucket.environment
    words = (
        bucket.checksum,
        MAGIC_NUMBER,
        _jinja(),
        made.autoescape,
        made.trim_blocks,
        made.lstrip_blocks,
        made.keep_trailing_newline,
    )
    return hashlib.sha256(repr(words).encode() + code).digest()


@cache
def _jinja() -> tuple[int, int]:
    """Size and time of Jinja's compiler file, which distinguish installed versions without reading their metadata."""
    found = os.stat(jinja2.compiler.__file__)
    return found.st_size, found.st_mtime_ns
