"""Collects MuJoCo's warnings while it compiles a robot. By itself MuJoCo would print them and write MUJOCO_LOG.TXT."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def kept_warnings(mujoco: Any) -> Iterator[list[str]]:
    """Collect MuJoCo's warnings until the end of the block, one line each. MuJoCo gives some of them to a callback, and
    others to Python's warnings; those come last."""
    said: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: said.append(" ".join(str(text).split())))
    try:
        with warnings.catch_warnings(record=True) as raised:
            warnings.simplefilter("always", UserWarning)
            yield said
    finally:
        mujoco.set_mju_user_warning(before)
        for one in raised:
            text = " ".join(str(one.message).split())
            if not issubclass(one.category, UserWarning):
                warnings.warn_explicit(one.message, one.category, one.filename, one.lineno)
            elif text not in said:
                said.append(text)
