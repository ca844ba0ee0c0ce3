"""A user's knowledge of the links before the fit: the accuracy of the robot file's values, and bounds of masses and
centres of mass. It comes from the tables `prior` and [[bodies]] of a log description."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from psdmc.calibration.identify.estimate import Estimate
from psdmc.calibration.identify.physical import NO_BOUNDS, Bounds, whitening_of
from psdmc.calibration.identify.visibility import EssentialOptions
from psdmc.calibration.logs.foreign_bytes import listed, quoted
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.toml_tables import TomlTable, is_number, require_none, shown
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.inertia import six_of
from psdmc.robot.mechanism import BODY_PARAMETERS, DRIVE, PARAMETERS_PER_LINK

SHARES = (1e-4, 100.0)
"""Of a mass or inertia: standard deviations that can be stated."""
COM_STDS = (1e-5, 10.0)
"""m, of a centre of mass."""
HEAVIEST = 1e5
"""kg, of a link."""
FARTHEST = 100.0
"""m, of a centre of mass from its link's frame."""
AXES = ("x", "y", "z")
HINT = "docs/how-to/priors.md describes these tables"


@dataclass(frozen=True, slots=True, eq=False)
class Knowledge:
    """A user's knowledge of the links before the fit.

    confidence  accuracy of the file's values for a link, by the index of the link; empty: none is stated
    bounds      bounds of masses and centres of mass
    essential   how parameters that the data do not need are dropped; None: all are kept
    """

    confidence: Mapping[int, Confidence] = field(default_factory=dict)
    bounds: Bounds = NO_BOUNDS
    essential: EssentialOptions | None = None


def knowledge_of(
    model: DynamicsModel,
    tables: Mapping[str, Any],
    where: str,
    share: float | None = None,
    essential: EssentialOptions | None = None,
) -> Knowledge:
    """Return what the user knows of the links before the fit, from the tables of a log description and from options.
    Raises InputError if the tables are wrong. Also raises InputError if they state an accuracy for values that the
    robot file does not give.

    where  name of the log description, for messages
    share  relative standard deviation of every link's mass and inertia, and standard deviation of its centre of mass
           divided by its radius of gyration; None: the value in the table `prior`
    """
    faults: list[str] = []
    if share is not None and not SHARES[0] <= share <= SHARES[1]:
        raise InputError(
            f"prior confidence (--prior-confidence) is {share:g}, expected {SHARES[0]:g} to {SHARES[1]:g}",
            "0.1 says that masses and inertias of the file are right to 10 %",
        )
    stated, prior = share, tables.get("prior")
    if share is None and prior is not None:
        table = TomlTable(prior, "prior", ("confidence",), faults)
        stated = table.number("confidence", *SHARES) if isinstance(prior, dict) else None
    wanted = essential
    if essential is None and "essential" in tables:
        table = TomlTable(tables["essential"], "essential", ("relative", "significance"), faults)
        usual = EssentialOptions()
        wanted = EssentialOptions(
            table.number("relative", 0.01, 100.0, usual.relative),
            table.number("significance", 1e-6, 0.5, usual.significance),
        )
    bodies = _Bodies(model, faults)
    bodies.read(tables.get("bodies", []))
    require_none(faults, where, HINT)
    found = dict(bodies.confidence)
    if stated is not None:
        unknown = model.mechanism.has_unknown_body
        for k, link in enumerate(model.mechanism.parameters):
            if not unknown[k]:
                found.setdefault(k, body_confidence(link, stated))
    if found or stated is not None:
        _require_values(model, found)
    return Knowledge(found, bodies.bounds(), wanted)


def _require_values(model: DynamicsModel, confidence: Mapping[int, Confidence]) -> None:
    """InputError where confidence in a link's values is stated and the file does not give them."""
    unknown = model.mechanism.has_unknown_body
    names = [model.mechanism.joints[k].link_name for k in confidence if unknown[k]]
    if model.file_theta_b is None or (names and model.theta_b is None):
        lacks = f"the inertia of {listed(names)}" if names else "all inertias"
        raise InputError(
            f"{model.mechanism.name}: a confidence in the file's values is stated, but it lacks {lacks}",
            "leave the confidence out, or give masses and inertias in the robot's file",
        )


class _Bodies:
    """The entries of [[bodies]]: `link`, and any of `mass`, `com` (bounds) and `confidence`."""

    def __init__(self, model: DynamicsModel, faults: list[str]) -> None:
        self.model, self.faults = model, faults
        self.confidence: dict[int, Confidence] = {}
        self._rows: list[tuple[Array, float, str]] = []

    def bounds(self) -> Bounds:
        width = PARAMETERS_PER_LINK * len(self.model.mechanism)
        rows = np.reshape([row for row, _, _ in self._rows], (-1, width))
        return Bounds(
            rows, np.array([side for _, side, _ in self._rows]), tuple(name for *_, name in self._rows)
        )

    def read(self, value: object) -> None:
        if not isinstance(value, list):
            self.faults.append(f"bodies: found {shown(value)}, expected [[bodies]]")
            return
        seen: set[int] = set()
        for k, entry in enumerate(value, start=1):
            table = TomlTable(entry, f"body {k}", ("link", "mass", "com", "confidence"), self.faults)
            link = self._link(table)
            if link in seen:
                self.faults.append(f"{table.where}: link {quoted(table.text('link'))} a second time")
            if link is not None:
                seen.add(link)
                self._entry(table, link)

    def _link(self, table: TomlTable) -> int | None:
        name = table.text("link")
        names = [joint.link_name for joint in self.model.mechanism.joints]
        if name in names:
            return names.index(name)
        if name:
            self.faults.append(
                f"{table.where}: link {quoted(name)} does not move, moving links are {listed(names)}"
            )
        return None

    def _entry(self, table: TomlTable, link: int) -> None:
        name = self.model.mechanism.joints[link].link_name
        if table.has("mass"):
            low, high = self._pair(table, "mass", 0.0, HEAVIEST)
            self._bound(link, 0, low, high, None, f"mass of {name}")
        if table.has("com"):
            com = TomlTable(table.content["com"], f"{table.where}: com", AXES, self.faults)
            for axis, letter in enumerate(AXES):
                if com.has(letter):
                    low, high = self._pair(com, letter, -FARTHEST, FARTHEST)
                    self._bound(link, 1 + axis, low, high, 0, f"centre of mass of {name}, {letter}")
        if table.has("confidence"):
            own = TomlTable(
                table.content["confidence"],
                f"{table.where}: confidence",
                ("mass", "com", "inertia"),
                self.faults,
            )
            self.confidence[link] = Confidence(
                own.number("mass", *SHARES), own.number("com", *COM_STDS), own.number("inertia", *SHARES)
            )

    def _pair(self, table: TomlTable, key: str, low: float, high: float) -> tuple[float, float]:
        value = table.content[key]
        if _is_pair(value) and low <= value[0] < value[1] <= high:
            return float(value[0]), float(value[1])
        self.faults.append(
            f"{table.where}: {key}: found {_pair_shown(value)}, expected [low, high] from {low:g} to {high:g}"
        )
        return low, high

    def _bound(self, link: int, place: int, low: float, high: float, times: int | None, name: str) -> None:
        """x[place] from `low` to `high`, times the mass where x[place] is a moment."""
        for sign, side, word in ((1.0, low, "least"), (-1.0, -high, "most")):
            row = np.zeros(PARAMETERS_PER_LINK * len(self.model.mechanism))
            row[PARAMETERS_PER_LINK * link + place] = sign
            if times is not None:
                row[PARAMETERS_PER_LINK * link + times] = -side
            self._rows.append((row, side if times is None else 0.0, f"{name}: {word} {sign * side:g}"))


def _is_pair(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(is_number, value))


def _pair_shown(value: Any) -> str:
    return str(value) if _is_pair(value) else shown(value)


# Stated knowledge
#
# Masses and inertias of the robot file, whose uncertainty the user states: a normal distribution of
# theta_b.


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
            A base parameter gets the standard deviation VAGUE times `scale` in three cases: all its link parameters
            are zero, one of them is unknown, or it contains a drive inertia that the file leaves at zero
    """
    covariance = np.zeros((PARAMETERS_PER_LINK * len(model.mechanism),) * 2)
    for k, link in enumerate(model.mechanism.known_parameters):
        own = slice(PARAMETERS_PER_LINK * k, PARAMETERS_PER_LINK * (k + 1))
        covariance[own, own] = _covariance(link, stated.get(k, body_confidence(link, VAGUE)))
    found = np.asarray(model.B @ covariance @ model.B.T)
    left_out = model.mechanism.known_parameters[:, DRIVE] == 0.0
    is_open = (np.diag(found) == 0.0) | (model.B[:, DRIVE::PARAMETERS_PER_LINK][:, left_out] != 0.0).any(
        axis=1
    )
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
