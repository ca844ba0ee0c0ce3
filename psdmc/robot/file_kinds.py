"""Which endings of a file's name say that it is a robot."""

from __future__ import annotations

ROBOT_SUFFIXES = (".urdf", ".xacro", ".xml", ".mjcf", ".sdf", ".toml")
"""Endings of files that `psdmc show` reads as a robot; all others are models."""
