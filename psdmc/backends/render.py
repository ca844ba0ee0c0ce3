"""Fills templates, and converts untrusted names to identifiers that are valid in a target language and not reserved.

In the Jinja environment, undefined names are errors, and all templates are read from the installed package.
"""

from __future__ import annotations

import contextlib
import hashlib
import marshal
import os
import re
import sys
from collections.abc import Callable
from functools import cache
from importlib import resources
from importlib.util import MAGIC_NUMBER, cache_from_source
from pathlib import Path

import jinja2.compiler
from jinja2 import Environment, FunctionLoader, StrictUndefined
from jinja2.bccache import Bucket, BytecodeCache

LONGEST = 63
"""Characters of an identifier: what C99 lets a compiler limit internal names to."""

DEVICE = re.compile(r"con|prn|aux|nul|conin|conout|com\d|lpt\d", re.IGNORECASE)
"""Windows takes these for devices in any case of letters."""


def identifier_of(name: str, is_reserved: Callable[[str], bool]) -> str:
    """Return an identifier for `name`: ASCII letters, digits and single underscores, never a reserved word.

    A name that is already a valid identifier does not change. A reserved word gets the prefix robot_. A name that would
    lose all its characters, or is too long, ends with a digest of the original, so that different names stay different.
    """
    cleaned = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")
    if not cleaned:
        return f"robot_{_digest(name)}"
    if cleaned[0].isdigit() or is_reserved(cleaned):
        cleaned = f"robot_{cleaned}"
    if len(cleaned) > LONGEST:
        digest = _digest(name)
        cleaned = f"{cleaned[: LONGEST - len(digest) - 1].rstrip('_')}_{digest}"
    return cleaned


def utf8(text: str) -> bytes:
    """The text's bytes, whatever it holds."""
    return text.encode("utf-8", errors="surrogatepass")


def _digest(name: str) -> str:
    return hashlib.sha256(utf8(name)).hexdigest()[:8]


def _source(name: str) -> str | None:
    file = resources.files("psdmc.templates").joinpath(name)
    return file.read_text(encoding="utf-8") if file.is_file() else None


def _kept() -> CodeBesideTemplates | None:
    """None where templates are no files, as in a zipped installation."""
    folder = resources.files("psdmc.templates")
    return CodeBesideTemplates(folder) if isinstance(folder, Path) else None


def environment_with(**filters: Callable[..., str]) -> Environment:
    """Return a Jinja environment (settings for filling templates) with the filters of one language. The filters make
    untrusted text safe in this language."""
    made = Environment(
        loader=FunctionLoader(_source),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
        bytecode_cache=_kept(),
    )
    made.filters.update(filters)
    return made


# A cache of compiled templates
#
# The cache is the folder `__pycache__` next to the templates. Jinja translates a template to Python, and
# Python compiles this to bytecode. Both steps take longer than filling the template. So the bytecode is
# stored once per installation if the folder is writable. A stored file is valid for one template text, one
# version of Python and one version of Jinja.


SEAL = hashlib.sha256().digest_size
"""Bytes before the code: a digest of the code and of all that it was made from. Code that was altered or cut short is
made again."""


class CodeBesideTemplates(BytecodeCache):
    """Jinja's cache of compiled templates in `__pycache__`. Jinja looks for the bytecode of a template there before it
    compiles the template, and stores the bytecode there afterwards."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def get_cache_key(self, name: str, filename: str | None = None) -> str:
        """Return the path of the file in which a template's compiled code is cached."""
        return cache_from_source(str(self.folder / name))

    def load_bytecode(self, bucket: Bucket) -> None:
        """Load the template's cached code, if there is any that belongs to the template."""
        with contextlib.suppress(OSError):
            kept = Path(bucket.key).read_bytes()
            seal, code = kept[:SEAL], kept[SEAL:]
            if seal == _seal(bucket, code):
                bucket.code = marshal.loads(code)

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Write the compiled code of a template to the cache, unless the folder is not writable."""
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
