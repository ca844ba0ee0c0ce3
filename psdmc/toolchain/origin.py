"""Where a compiled robot came from, so that another process can have the same."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Origin:
    """How a compiled robot is had again.

    again    importable by name; returns the robot
    request  its argument, which can be pickled
    key      the same for equal robots
    """

    again: Callable[[Any], Any]
    request: Any
    key: str
