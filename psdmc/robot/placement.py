"""The class Placement: the position and orientation of one frame in another."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.reproducible import times

Array = NDArray[np.float64]


def frozen_array(values: object, shape: tuple[int, ...], what: str) -> Array:
    """Return a read-only float64 copy of `values`. Raises ValueError if its shape differs from `shape`."""
    array = np.array(values, dtype=np.float64)
    if array.shape != shape:
        raise ValueError(f"{what} has shape {array.shape}, expected {shape}")
    array.setflags(write=False)
    return array


def made_again(value: Any) -> tuple[type[Any], tuple[Any, ...]]:
    """Return the value of `__reduce__` with which pickle and copy call the constructor of a dataclass. The arrays of
    the copy are then read-only, too."""
    return type(value), tuple(getattr(value, field.name) for field in fields(value) if field.init)


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """Position and orientation of a frame in another: x_outer = rotation @ x_inner + translation.

    rotation     (3, 3)  orthonormal
    translation  (3,)    m
    """

    rotation: Array
    translation: Array

    __reduce__ = made_again

    def __post_init__(self) -> None:
        object.__setattr__(self, "rotation", frozen_array(self.rotation, (3, 3), "rotation"))
        object.__setattr__(self, "translation", frozen_array(self.translation, (3,), "translation"))

    @staticmethod
    def identity() -> Placement:
        return Placement(np.eye(3), np.zeros(3))

    def __matmul__(self, inner: Placement) -> Placement:
        translation = times(self.rotation, inner.translation) + self.translation
        return Placement(times(self.rotation, inner.rotation), translation)

    def inverse(self) -> Placement:
        return Placement(self.rotation.T, -times(self.rotation.T, self.translation))
