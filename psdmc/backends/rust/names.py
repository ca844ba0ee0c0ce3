"""Conversion of untrusted text to Rust, and names that Rust reserves."""

from __future__ import annotations

from psdmc.backends.render import DEVICE, identifier_of, utf8

_WORDS = """
as async await break const continue crate dyn else enum extern false fn for gen if impl in let loop match mod move mut pub
ref return self static struct super trait true type union unsafe use where while abstract become box do final macro
override priv try typeof unsized virtual yield
"""
KEYWORDS = frozenset(_WORDS.split())
"""Of all editions, reserved ones too."""

TAKEN = KEYWORDS | {"core", "std", "alloc", "test", "proc_macro", "build", "deps", "examples", "incremental"}
"""What a crate must not be called: crates that come with the compiler, and folders of cargo."""


def identifier(name: str) -> str:
    """A crate's name for `name`, in lower case."""
    return identifier_of(name, _is_reserved).lower()


def _is_reserved(word: str) -> bool:
    return word.lower() in TAKEN or DEVICE.fullmatch(word) is not None


def variable(name: str) -> str:
    """Return the Rust name of a quantity or function. An underscore is added if the name is a Rust keyword or another
    name that the Rust code uses."""
    return f"{name}_" if name in KEYWORDS or name == "fma" else name


def text(untrusted: str) -> str:
    """Return a Rust string literal: plain ASCII stays readable, and an unpaired surrogate becomes U+FFFD."""
    return f'"{"".join(map(_character, untrusted))}"'


def _character(one: str) -> str:
    if " " <= one <= "~" and one not in '"\\':
        return one
    return f"\\u{{{0xFFFD if 0xD800 <= ord(one) < 0xE000 else ord(one):x}}}"


def comment(untrusted: str) -> str:
    """Return text that is safe in a line of Rust documentation: ASCII without backticks, which end code."""
    return "".join(chr(b) if 32 <= b < 127 and b != 96 else f"<{b:02x}>" for b in utf8(untrusted))
