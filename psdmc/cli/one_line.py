"""Untrusted text for a terminal."""


def one_line(text: str) -> str:
    """Untrusted text on one line of a terminal: control characters escaped."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
