"""Combines a fit with prior knowledge: masses and inertias of the robot file, whose uncertainty the user states.

The prior is a normal distribution of the base parameters theta_b.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from psdmc.calibration.identify.estimate import Estimate
from psdmc.calibration.identify.physical import whitening_of
from psdmc.calibration.logs.log import Array
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.inertia import six_of
from psdmc.robot.mechanism import BODY_PARAMETERS, DRIVE, PARAMETERS_PER_LINK

VAGUE = 10.0
"""Relative standard deviation of what nothing is stated of: ten times its size."""


@dataclass(frozen=True, slots=True)
class Confidence:
    """How well a link's body is known: standard deviations of its values.

    mass     as a share of the file's mass
    com      m
    inertia  as a share of the file's moments about the centre of mass, and of the drive inertia
    """

    mass: float
    com: float
    inertia: float


def body_confidence(link: Array, share: float) -> Confidence:
    """Return the confidence in a link's standard parameters (11,) from one relative standard deviation, `share`.

    The mass and the inertia about the centre of mass each have this relative standard deviation. The centre of mass has
    this share of the radius of gyration.
    """
    mass, inertia = max(float(link[0]), np.finfo(float).tiny), _about_centre(link)
    return Confidence(share, share * float(np.sqrt(max(np.trace(inertia), 0.0) / (2.0 * mass))), share)


def theta_covariance(model: DynamicsModel, stated: dict[int, Confidence], scale: Array) -> Array:
    """Return the prior covariance (l, l) of the l base parameters theta_b. It follows from the accuracy that the user
    states for the masses, centres of mass and inertias of the links in the robot file.

    stated  accuracy by the index of the link; links without an entry get very large standard deviations
    scale   plausible size of each base parameter, in the unit of the parameter; entries after the first l are ignored.
            If all link parameters in a base parameter are zero, or one of them is unknown, the base parameter gets the
            standard deviation VAGUE times `scale`
    """
    covariance = np.zeros((PARAMETERS_PER_LINK * len(model.mechanism),) * 2)
    for k, link in enumerate(model.mechanism.known_parameters):
        own = slice(PARAMETERS_PER_LINK * k, PARAMETERS_PER_LINK * (k + 1))
        covariance[own, own] = _covariance(link, stated.get(k, body_confidence(link, VAGUE)))
    found = np.asarray(model.B @ covariance @ model.B.T)
    is_open = np.diag(found) == 0.0
    is_open[list(model.unknown_base_parameters)] = True
    return found + np.diag(np.where(is_open, VAGUE * scale[: model.l], 0.0) ** 2)


def _covariance(link: Array, own: Confidence) -> Array:
    """(11, 11) of one link's standard parameters, to first order in mass, centre of mass, inertia and drive inertia."""
    mass, inertia = float(link[0]), _about_centre(link)
    com = link[1:4] / mass if mass > 0 else np.zeros(3)
    axes = np.abs(np.diag(inertia))
    std = np.zeros(11)
    std[0] = own.mass * mass
    std[1:4] = own.com
    std[4:10] = own.inertia * six_of(np.sqrt(np.outer(axes, axes)))
    std[DRIVE] = own.inertia * abs(float(link[DRIVE]))
    slopes = np.zeros((PARAMETERS_PER_LINK, 11))
    slopes[0, 0] = 1.0
    slopes[1:4, 0], slopes[1:4, 1:4] = com, mass * np.eye(3)
    slopes[4:10, 0] = six_of(com @ com * np.eye(3) - np.outer(com, com))
    for axis, unit in enumerate(np.eye(3)):
        turned = 2.0 * (com @ unit) * np.eye(3) - np.outer(com, unit) - np.outer(unit, com)
        slopes[4:10, 1 + axis] = mass * six_of(turned)
    slopes[4:10, 4:10], slopes[DRIVE, DRIVE] = np.eye(6), 1.0
    return np.asarray((slopes * std**2) @ slopes.T)


def _about_centre(link: Array) -> Array:
    """(3, 3) inertia about the centre of mass."""
    xx, xy, yy, xz, yz, zz = link[4:BODY_PARAMETERS]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    mass = float(link[0])
    if not mass > 0:
        return inertia
    com = link[1:4] / mass
    return np.asarray(inertia - mass * (com @ com * np.eye(3) - np.outer(com, com)))


def with_prior(solved: Estimate, theta_b: Array, covariance: Array, unknown: Sequence[int] = ()) -> Estimate:
    """Combine a fit with a prior of its base parameters, and return the most likely estimate (maximum a posteriori).

    Both distributions are normal. The l base parameters come first among the fit's values.

    theta_b     (l,) mean of the prior
    covariance  (l, l) covariance of the prior
    unknown     indices of base parameters that the prior does not determine

    The standard deviations of the result are those of data and prior together. For messages, the result keeps the
    directions that the data do not show.
    """
    l, m = len(theta_b), len(solved.values)
    by_data = whitening_of(solved.total_covariance + solved.prior_covariance)
    by_prior = np.zeros((l, m))
    by_prior[:, :l] = whitening_of(covariance)
    both: Array = np.asarray(np.linalg.qr(np.vstack([by_data, by_prior]), mode="r"), dtype=np.float64)
    start = np.concatenate([theta_b, solved.values[l:]])
    pulled = by_prior.T @ (by_prior @ (start - solved.values))
    values = solved.values + np.linalg.solve(both, np.linalg.solve(both.T, pulled))
    inverse = np.linalg.inv(both)
    total = inverse @ inverse.T
    by_file = np.arange(m) < l
    by_file[list(unknown)] = False
    return replace(
        solved,
        values=values,
        covariance=total,
        considered=np.zeros((m, 0)),
        total_covariance=total,
        prior_std=0.0,
        whitening=both,
        identifiable=solved.identifiable | by_file,
    )
