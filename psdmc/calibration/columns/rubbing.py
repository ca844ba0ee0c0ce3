"""Friction terms of single joints."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from psdmc.calibration.columns.effect import Motion, Unknown
from psdmc.calibration.logs.log import Array

Term = Callable[[Array, Array, Array], Array]
"""Torque per unit of a value, of one joint's smooth sign, speed and load, (N,) each."""


@dataclass(frozen=True, slots=True, eq=False)
class Rubbing:
    """Values of joints, each with its joint and its term.

    joints   one for each unknown
    by_load  whether a term depends on the rigid bodies' torque
    """

    unknowns: tuple[Unknown, ...]
    joints: tuple[int, ...]
    terms: tuple[Term, ...]
    by_load: bool = False

    def columns(self, motion: Motion) -> Array:
        found = np.zeros((*motion.speed.shape, len(self.unknowns)))
        load = np.zeros_like(motion.speed) if motion.load is None else motion.load
        for k, (joint, term) in enumerate(zip(self.joints, self.terms, strict=True)):
            speed = motion.speed[:, joint]
            found[:, joint, k] = term(np.tanh(speed / motion.sign_speed), speed, load[:, joint])
        return found if motion.onto is None else np.einsum("tmk,mj->tjk", found, motion.onto)
