"""Warnings under which emitted C is compiled: those of docs/shipping.md, and more that it is free of as well."""

from __future__ import annotations

STRICT = [
    "-std=c99",
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Wconversion",
    "-Wshadow",
    "-Wdouble-promotion",
    "-Werror",
]
EXTRA = ["-Wcast-align", "-Wstrict-prototypes", "-Wmissing-prototypes", "-Wundef", "-Wvla"]
