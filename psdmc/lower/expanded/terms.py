"""The input of the expanded lowering (code from polynomials): a function's outputs as sums of monomials, read from E, P
and theta_b."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.expansion import Entries, Expansion, RowBlocks
from psdmc.reproducible import length
from psdmc.robot.mechanism import Array, Mechanism

Integers = NDArray[np.int64]

COEFFICIENT_NOISE = 1e-13
"""Usual uncertainty of a coefficient, relative to the largest one of its joint (and parameter): rounding of the
derivation, a hundredth of the accuracy that every lowering must keep. Smaller coefficients are left out, and such as are
nearer to each other are made one."""


@dataclass(frozen=True, slots=True, eq=False)
class Terms:
    """Polynomials as t terms: value[output] = sum of coefficient * product over variables of variable ** exponent.

    There are r variables: the 5 n rows of E (q, sin q, cos q, qd and qdd). If base parameters are variables, each has
    one more row.

    output       (t,) int      the polynomial to which the term belongs
    exponents    (r, t) uint8  0..2
    coefficient  (t,) float    not zero
    uncertainty  (t,) float    absolute error; two coefficients that differ by less may be equal
    """

    output: Integers
    exponents: NDArray[np.uint8]
    coefficient: Array
    uncertainty: Array

    def __post_init__(self) -> None:
        t = self.output.shape[0]
        if (
            self.exponents.shape[1:] != (t,)
            or self.coefficient.shape != (t,)
            or self.uncertainty.shape != (t,)
        ):
            raise ValueError("output, exponents, coefficient and uncertainty differ in length")

    def __len__(self) -> int:
        return int(self.output.shape[0])

    def where(self, keep: NDArray[np.bool_]) -> Terms:
        return Terms(
            self.output[keep], self.exponents[:, keep], self.coefficient[keep], self.uncertainty[keep]
        )


def torque_terms(model: DynamicsModel, noise: float = COEFFICIENT_NOISE) -> Terms:
    """Return the torques tau[0..n-1] as sums of terms, with the rows of E and the base parameters as variables. Raises
    InputError if the model has no E and P."""
    expansion = _expanded(model)
    terms, parameter = _stacked(expansion.E, expansion.entries, model.l, noise)
    one_hot = (np.arange(model.l)[:, None] == parameter).astype(np.uint8)
    exponents = np.concatenate([terms.exponents, one_hot])
    return Terms(terms.output, exponents, terms.coefficient, terms.uncertainty)


def baked_torque_terms(model: DynamicsModel, noise: float = COEFFICIENT_NOISE) -> Terms:
    """Return the torques tau[0..n-1] as sums of terms, with the rows of E as variables and theta_b in the coefficients.
    Raises InputError if theta_b is unknown."""
    expansion, theta_b = _expanded(model), known_parameters(model)
    n, p = expansion.n, expansion.p
    joint, row, column, value = expansion.entries
    weights = np.bincount(joint * np.int64(p) + row, value * theta_b[column], n * p).reshape(n, p)
    joints, monomials = np.nonzero(weights)
    entries = Entries(joints, monomials, np.zeros_like(joints), weights[joints, monomials])
    return _stacked(expansion.E, entries, 1, noise)[0]


def regressor_terms(model: DynamicsModel, noise: float = COEFFICIENT_NOISE) -> Terms:
    """Return the regressor's entries Y[i, k] as sums of terms, with the rows of E as variables. Entry Y[i, k] has the
    output number i * l + k."""
    expansion = _expanded(model)
    terms, parameter = _stacked(expansion.E, expansion.entries, model.l, noise)
    output = terms.output * model.l + parameter
    return Terms(output, terms.exponents, terms.coefficient, terms.uncertainty)


def _expanded(model: DynamicsModel) -> Expansion:
    if model.expansion is None:
        raise InputError(
            f"{model.mechanism.name}: the expanded lowering needs E and P, and this model has none",
            "derive it without --no-expand, or choose --lowering factored",
        )
    return model.expansion


def known_parameters(model: DynamicsModel) -> Array:
    """theta_b, (l,); InputError where it is unknown."""
    if model.theta_b is None:
        raise InputError(
            f"{model.mechanism.name}: base parameters are unknown and cannot become constants",
            "calibrate the model first, or emit the functions that take theta_b",
        )
    return model.theta_b


def _stacked(E: NDArray[np.uint8], weights: Entries, width: int, noise: float) -> tuple[Terms, Integers]:
    """One term for each entry of the joints' (p, width) weights, and the column of each. Uncertainties are `noise` times the
    largest entry of a joint's column."""
    place = weights.joint * np.int64(width) + weights.column
    largest = np.zeros((E.shape[0] // 5) * width)
    np.maximum.at(largest, place, np.abs(weights.value))
    doubt = noise * largest[place]
    keep = np.abs(weights.value) > doubt
    terms = Terms(
        weights.joint[keep].astype(np.int64), E[:, weights.row[keep]], weights.value[keep], doubt[keep]
    )
    return terms, weights.column[keep].astype(np.int64)


def mass_matrix_terms(torque: Terms, n: int) -> Terms:
    """Return the mass matrix's entries M[i, j], i <= j, as sums of terms. Entry M[i, j] has the output number i * n +
    j.

    The terms of M[i, j] are those with qdd[j] in tau[i], or those with qdd[i] in tau[j]. The ones with smaller
    uncertainty of the coefficients are taken. A term that is only rounding in the torque of an arm may matter in the
    torque of its finger.
    """
    accelerations = torque.exponents[RowBlocks.of(n).qdd]
    own, other = torque.output, np.argmax(accelerations, axis=0)
    doubt = np.zeros(n)
    np.maximum.at(doubt, own, torque.uncertainty)
    is_better = (doubt[own] < doubt[other]) | ((doubt[own] == doubt[other]) & (own <= other))
    exponents = torque.exponents.copy()
    exponents[RowBlocks.of(n).qdd] = 0
    output = np.minimum(own, other) * n + np.maximum(own, other)
    entries = Terms(output, exponents, torque.coefficient, torque.uncertainty)
    return entries.where(accelerations.any(axis=0) & is_better)


def nonlinear_terms(torque: Terms, n: int) -> Terms:
    """Return the torques without joint accelerations, h[i], as sums of terms: the terms of tau[i] that contain no
    acceleration."""
    return torque.where(np.asarray(~torque.exponents[RowBlocks.of(n).qdd].any(axis=0)))


def gravity_terms(torque: Terms, n: int) -> Terms:
    """Return the gravity torques g[i] as sums of terms: the terms of tau[i] that contain no joint rates and
    accelerations."""
    return torque.where(np.asarray(~torque.exponents[RowBlocks.of(n).rates].any(axis=0)))


def with_gravity(terms: Terms, chain: Mechanism) -> Terms:
    """Return the terms, with each gravity term multiplied by the strength of gravity |g| (m/s^2). The columns of E do
    not contain |g|."""
    n = len(chain)
    at_rest = ~terms.exponents[RowBlocks.of(n).rates].any(axis=0)
    factor = np.where(at_rest, length(np.asarray(chain.gravity)), 1.0)
    return Terms(terms.output, terms.exponents, terms.coefficient * factor, terms.uncertainty * factor)


def joined(first: Terms, second: Terms, offset: int) -> Terms:
    """Return the terms of both arguments. `offset` is added to the output numbers of the second one."""
    return Terms(
        np.concatenate([first.output, second.output + offset]),
        np.concatenate([first.exponents, second.exponents], axis=1),
        np.concatenate([first.coefficient, second.coefficient]),
        np.concatenate([first.uncertainty, second.uncertainty]),
    )
