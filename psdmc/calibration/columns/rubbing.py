"""Friction of single joints as effects of a fit. The friction torque is a sum of terms of friction laws, such as
Coulomb and viscous friction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from psdmc.calibration.columns.effect import Motion, Unknown
from psdmc.calibration.logs.log import Array
from psdmc.friction.law import At, Term
from psdmc.robot.mechanism import Mechanism


@dataclass(frozen=True, slots=True, eq=False)
class Rubbing:
    """The friction of some joints as an effect of a fit.

    terms     terms of friction laws, each with the index of its joint
    unknowns  the unknown values of all terms, term after term
    """

    terms: tuple[tuple[int, Term], ...]
    unknowns: tuple[Unknown, ...]

    @property
    def by_load(self) -> bool:
        return any("load" in term.reads for _, term in self.terms)

    def columns(self, motion: Motion) -> Array:
        load = np.zeros_like(motion.speed) if motion.load is None else motion.load
        sign = np.tanh(motion.speed / motion.sign_speed)
        each = []
        for joint, term in self.terms:
            at = At(*(part[:, joint] for part in (motion.place, motion.speed, sign, load)))
            each += [(joint, column) for column in term.columns(at)]
        found = np.zeros((*motion.speed.shape, len(each)))
        for k, (joint, column) in enumerate(each):
            found[:, joint, k] = column
        return found if motion.onto is None else np.einsum("tmk,mj->tjk", found, motion.onto)


def rubbing(terms: Sequence[tuple[int, Term]], chain: Mechanism) -> Rubbing:
    """Return the friction of some joints as an effect of a fit. `terms` are terms of friction laws, each with the index
    of its joint."""
    unknowns = [
        Unknown(chain.joint_names[joint], name, unit, value.low >= 0.0, value.within, value.start)
        for joint, term in terms
        for name, unit, value in zip(
            term.names, term.units(chain.joints[joint].type.effort_unit), term.law.values, strict=True
        )
    ]
    return Rubbing(tuple(terms), tuple(unknowns))
