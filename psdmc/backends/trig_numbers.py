"""The numbers of the sine and cosine code for all languages. tests/trig/minimax.py derives the numbers, and a test
compares both."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Real = Literal["double", "float"]


@dataclass(frozen=True, slots=True)
class Numbers:
    """The numbers of the sine and cosine code for float or double. For angles up to `limit` (rad), k (the number of
    quarter revolutions) times each part of pi/2 except the last is exact."""

    two_over_pi: float
    half_pi: tuple[float, ...]
    sin_terms: tuple[float, ...]
    cos_terms: tuple[float, ...]
    limit: float
    digits: int
    bits: int


NUMBERS: dict[Real, Numbers] = {
    "double": Numbers(
        two_over_pi=float.fromhex("0x1.45f306dc9c883p-1"),
        half_pi=(
            float.fromhex("0x1.921fb5444p+0"),
            float.fromhex("0x1.68c234c4cp-39"),
            float.fromhex("0x1.98a2e03707345p-77"),
        ),
        sin_terms=(
            float.fromhex("0x1.5555555555548p-3"),
            float.fromhex("-0x1.111111110f750p-7"),
            float.fromhex("0x1.a01a019bef683p-13"),
            float.fromhex("-0x1.71de355bf0914p-19"),
            float.fromhex("0x1.ae5e5196ad133p-26"),
            float.fromhex("-0x1.5d8d45baae607p-33"),
        ),
        cos_terms=(
            float.fromhex("0x1.555555555554bp-5"),
            float.fromhex("-0x1.6c16c16c15005p-10"),
            float.fromhex("0x1.a01a019c8c7ebp-16"),
            float.fromhex("-0x1.27e4f7ef0fb2cp-22"),
            float.fromhex("0x1.1ee9d9c92ad75p-29"),
            float.fromhex("-0x1.8fa5556f03cf5p-37"),
        ),
        limit=1e5,
        digits=53,
        bits=64,
    ),
    "float": Numbers(
        two_over_pi=float.fromhex("0x1.45f306p-1"),
        half_pi=(
            float.fromhex("0x1.9218p+0"),
            float.fromhex("0x1.ed5p-14"),
            float.fromhex("0x1.10bp-30"),
            float.fromhex("0x1.184698p-44"),
        ),
        sin_terms=(
            float.fromhex("0x1.555546p-3"),
            float.fromhex("-0x1.110774p-7"),
            float.fromhex("0x1.9951fep-13"),
        ),
        cos_terms=(
            float.fromhex("0x1.55554ap-5"),
            float.fromhex("-0x1.6c0c28p-10"),
            float.fromhex("0x1.99e81ap-16"),
        ),
        limit=1e3,
        digits=24,
        bits=32,
    ),
}
