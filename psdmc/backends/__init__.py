"""Writes packages: one folder per language, which psdmc/backends/protocol.py describes."""

BACK_ENDS = ("c", "rust", "cuda")
"""The languages by name, each a folder here with a module `back_end`; the first is the default."""
