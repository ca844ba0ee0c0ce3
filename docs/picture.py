"""Draws the pictures of the documentation into docs/images: python docs/picture.py [NAME ...]

Each module of docs/pictures draws one. tests/docs/test_pictures.py compares the files with what is drawn."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

IMAGES = Path(__file__).parent / "images"
MODULES = (
    "pipeline",
    "link_frames",
    "batch_layout",
    "limb_lanes",
    "log_to_model",
    "smooth_friction",
    "sparsity",
    "speed",
)


def pictures() -> dict[str, Callable[[], str]]:
    """What draws each file."""
    found = (import_module(f"pictures.{name}") for name in MODULES)
    return {module.NAME: module.draw for module in found}


def main() -> None:
    for name, draw in pictures().items():
        if len(sys.argv) < 2 or name in sys.argv[1:]:
            (IMAGES / name).write_text(draw(), encoding="utf-8")


if __name__ == "__main__":
    main()
