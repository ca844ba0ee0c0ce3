"""Conversion of untrusted names to identifiers that are valid in a target language and not reserved there."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable

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
