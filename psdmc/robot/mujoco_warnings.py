"""Collects MuJoCo's warnings while it compiles a robot. By itself MuJoCo would print them and write MUJOCO_LOG.TXT."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def kept_warnings(mujoco: Any) -> Iterator[list[str]]:
    """Collect MuJoCo's warnings until the end of the block, in order, one line each."""
    said: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: said.append(" ".join(str(text).split())))
    try:
        yield said
    finally:
        mujoco.set_mju_user_warning(before)
