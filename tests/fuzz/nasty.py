"""Values that readers trip over: numbers, texts and anything that a structured file can hold."""

from __future__ import annotations

from random import Random
from typing import Any

NUMBERS = (
    "0", "-0", "-0.0", "1", "-1", "2", "0.5", "1e-9", "1e-5", "1e-4", "1e-3", "1.5708", "3.1416", "1e6", "1e16",
    "1e20", "1e77", "1e100", "1e154", "1e155", "1e200", "1e300", "1.7e308", "1e309", "-1e300", "1e-77", "1e-155",
    "1e-160", "1e-300", "5e-324", "-5e-324", "1e-400", "nan", "NaN", "inf", "-inf", "infinity", "+1", "1.", ".5",
    "1e", "1e+", "--1", "1-", "0x10", "0b1", "1_000", "1,5", "1;2", "1/3", "pi", "", " ", " 1 ", "1 ", "\t1", "\n1",
    "1 2", "1 2 3", "1 2 3 4", "true", "None", "\u0663", "\uff11", "\u00a01", "1\u00a0", "\u22121", "2147483648",
    "-2147483649", "9223372036854775808", "18446744073709551616", "9" * 400, "9" * 5000, "0." + "3" * 5000,
    "90 deg", "1 rad", "deg", "90deg", "1e400 deg", "unknown",
)  # fmt: skip

TEXTS = (
    "", " ", "a", "A", "base", "base_link", "tool0", "link", "link1", "joint1", "world", "universe", "root_joint",
    "J1", "shoulder", "elbow", "time", "sin", "int", "M_PI", "a" * 300, "a" * 5000, "a b", "a.b", "a/b", "../a",
    "../../a", "/a", "a\\b", "C:a", "-a", "--help", "a\nb", "a\tb", "a\rb", "a\x1b[31mb", "a\u202eb", "a\u2028b", "é",
    "日本", "\U0001f916", "\u0301", "a\u0000b", "'", '"', "`", "*/", "/*", "//", "#define", "??/", "\\", "%s%n", "{}",
    "{{a}}", "{% a %}", "$(a)", "${a}", "; a", "| a", "&a;", "<a>", "[a]", "[red]a", "nan", "null", "1", "true", "@com",
    "m", "mx", "link1:mx", "revolute", "prismatic", "continuous", "fixed", "floating", "planar", "spherical",
    "standard", "modified",
)  # fmt: skip

ANY: tuple[Any, ...] = (
    None, True, False, 0, 1, -1, 2, 3, 7, 255, 256, 10**6, 10**9, 2**31, 2**63, 2**64, 10**30, -(10**30), 10**400,
    0.0, -0.0, 0.5, -1.5, 1e-9, 1e-155, 1e-300, 5e-324, 1e16, 1e77, 1e155, 1e300, float("nan"), float("inf"), -float("inf"),
    [], [0], [0.0, 0.0, 0.0], [0, 0, -9.81], [1e300] * 3, [[]], [[1.0]], [None], ["a"], [[1, 2], [3]], [float("nan")] * 3,
    {}, {"a": 1}, {"": ""}, {"a": {"b": [1]}},
)  # fmt: skip


def number(rng: Random) -> str:
    """A text that is, resembles, or stands for a number."""
    if rng.random() < 0.25:
        return repr(rng.uniform(-1.0, 1.0) * 10.0 ** rng.randint(-20, 20))
    return rng.choice(NUMBERS)


def text(rng: Random) -> str:
    if rng.random() < 0.1:
        return "".join(
            chr(rng.choice((rng.randrange(1, 0x250), rng.randrange(1, 0xD800))))
            for _ in range(rng.randint(1, 8))
        )
    return rng.choice(TEXTS)


def anything(rng: Random) -> Any:
    """A plain value: none, a truth, a number, a text, a list or a table."""
    kind = rng.random()
    if kind < 0.6:
        return rng.choice(ANY)
    if kind < 0.8:
        return text(rng)
    return number(rng) if kind < 0.9 else rng.uniform(-1, 1) * 10.0 ** rng.randint(-12, 12)


def near(word: str, rng: Random) -> str:
    """A number's neighbour: another sign, scale, digit or spelling."""
    try:
        value = float(word)
    except ValueError:
        return number(rng)
    choice = rng.randrange(8)
    if choice == 0:
        return repr(-value)
    if choice == 1:
        return repr(value * 10.0 ** rng.randint(-30, 30))
    if choice == 2:
        return repr(value + rng.choice((1e-12, 1e-9, 1e-6, 1e-4, 1e-2, 1.0)))
    if choice == 3:
        return word + rng.choice((" ", "\t", "e", "f", "\u00a0", "_0", "e3", "e200", ".", "0" * 40))
    if choice == 4:
        return rng.choice((" ", "+", "-", "\u2212", "0", "\n")) + word
    return number(rng)
