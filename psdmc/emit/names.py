"""Untrusted text on its way into C: names become identifiers, the rest is escaped.

A robot file may name its robot `a; system("x")`. Nothing of such a name may leave the identifier, the string
or the comment that it is put into.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable

LONGEST = 63
"""Characters of an identifier: what C99 lets a compiler limit internal names to."""

_C = """auto break case char const continue default do double else enum extern float for goto if inline
int long register restrict return short signed sizeof static struct switch typedef union unsigned void
volatile while"""
_CPP = """alignas alignof and and_eq asm bitand bitor bool catch char8_t char16_t char32_t class co_await
co_return co_yield compl concept consteval constexpr constinit const_cast decltype delete dynamic_cast
explicit export false friend mutable namespace new noexcept not not_eq nullptr operator or or_eq private
protected public reinterpret_cast requires static_assert static_cast template this thread_local throw true
try typeid typename using virtual wchar_t xor xor_eq"""
_OTHER = "main linux unix errno NULL NAN INFINITY std posix"
RESERVED = frozenset(f"{_C} {_CPP} {_OTHER}".split())


def identifier(name: str) -> str:
    """A C and C++ identifier for `name`: ASCII letters, digits and single underscores, never a keyword.

    Names that are identifiers already stay as they are; one that loses all its characters, or is too long,
    ends with a digest of the original, so that different names stay apart.
    """
    cleaned = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")
    if not cleaned:
        return f"robot_{_digest(name)}"
    if cleaned[0].isdigit() or cleaned in RESERVED:
        cleaned = f"robot_{cleaned}"
    if len(cleaned) > LONGEST:
        digest = _digest(name)
        cleaned = f"{cleaned[: LONGEST - len(digest) - 1].rstrip('_')}_{digest}"
    return cleaned


def identifiers(names: Iterable[str]) -> tuple[str, ...]:
    """One identifier per name, all different: equal ones get _2, _3 ... in order."""
    taken: dict[str, None] = {}
    for name in names:
        first = identifier(name)
        candidate, count = first, 1
        while candidate in taken:
            count += 1
            candidate = f"{first[: LONGEST - 8].rstrip('_')}_{count}"
        taken[candidate] = None
    return tuple(taken)


def c_string(text: str) -> str:
    """A C string literal of `text` as UTF-8: plain ASCII stays readable, everything else is an octal escape.

    Octal escapes end after three digits whatever follows; '?' is escaped too, so that no trigraph can form.
    """
    plain = {ord('"'): '\\"', ord("\\"): "\\\\", ord("?"): "\\?"}
    body = "".join(
        plain.get(byte) or (chr(byte) if 32 <= byte < 127 else f"\\{byte:03o}") for byte in _utf8(text)
    )
    return f'"{body}"'


def c_comment(text: str) -> str:
    """`text` as it may stand inside a C comment: one line of ASCII that neither ends nor nests a comment.

    A '\\' could join lines, '/' beside '*' could open or close, '??' could be a trigraph: each is broken up.
    """
    ascii_text = "".join(chr(byte) if 32 <= byte < 127 else f"<{byte:02x}>" for byte in _utf8(text))
    for dangerous, harmless in (("\\", "<5c>"), ("*/", "* /"), ("/*", "/ *"), ("??", "? ?")):
        while dangerous in ascii_text:
            ascii_text = ascii_text.replace(dangerous, harmless)
    return ascii_text


def _utf8(text: str) -> bytes:
    return text.encode("utf-8", errors="surrogatepass")


def _digest(name: str) -> str:
    return hashlib.sha256(_utf8(name)).hexdigest()[:8]
