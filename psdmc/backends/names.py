"""Untrusted names on their way into any language: they become identifiers, or are refused as words of the language."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable

LONGEST = 63
"""Characters of an identifier: what C99 lets a compiler limit internal names to."""

DEVICE = re.compile(r"con|prn|aux|nul|conin|conout|com\d|lpt\d", re.IGNORECASE)
"""Windows takes these for devices in any case of letters."""


def identifier_of(name: str, is_reserved: Callable[[str], bool]) -> str:
    """An identifier for `name`: ASCII letters, digits and single underscores, never a reserved word.

    Names that are free identifiers already stay as they are; a reserved one gets robot_ before it; one that loses all
    its characters, or is too long, ends with a digest of the original, so that different names stay apart.
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
