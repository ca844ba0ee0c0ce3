"""The facts about a model that `psdmc show` prints, as plain data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.equations import BaseParameter
from psdmc.model.expansion import BLOCKS, RowBlocks
from psdmc.robot.mechanism import Joint


class Sizes(NamedTuple):
    """Number of monomials by kind of acceleration."""

    gravity: int
    acceleration: int
    centrifugal: int
    coriolis: int


@dataclass(frozen=True, slots=True)
class Summary:
    """The facts about a model that `psdmc show` prints.

    ends         name of the tip of a serial chain; for a tree, how many end links it has, and the tip
    sizes        number of monomials by kind; None if the model was derived without E and P
    entries      non-zero entries of P; None if the model was derived without E and P
    certificate  for each joint rate, the largest torque error divided by the largest torque
    """

    name: str
    convention: str
    base: str
    tip: str
    ends: str
    is_serial: bool
    gravity: tuple[float, float, float]
    joints: tuple[Joint, ...]
    p: int | None
    l: int
    sizes: Sizes | None
    entries: int | None
    base_parameters: tuple[BaseParameter, ...]
    certificate: tuple[float, ...]
    notes: tuple[str, ...]
    source_name: str | None
    source_sha256: str | None
    content_hash: str


def summary(model: DynamicsModel) -> Summary:
    """Everything that `psdmc show` prints by default."""
    chain, kept = model.mechanism, model.provenance
    gx, gy, gz = chain.gravity.tolist()
    return Summary(
        name=chain.name,
        convention=chain.convention,
        base=chain.base_name,
        tip=chain.tip_name,
        ends=chain.tip_name if chain.is_serial else f"{len(chain.leaves)} ends, tip {chain.tip_name}",
        is_serial=chain.is_serial,
        gravity=(gx, gy, gz),
        joints=chain.joints,
        p=model.p,
        l=model.l,
        sizes=None if model.expansion is None else sizes_of(model.expansion.E),
        entries=None if model.expansion is None else len(model.expansion.entries.value),
        base_parameters=model.base_parameters,
        certificate=tuple(model.certificate.tolist()),
        notes=chain.notes,
        source_name=kept.get("source_name"),
        source_sha256=kept.get("source_sha256"),
        content_hash=model.content_hash,
    )


def sizes_of(E: NDArray[np.uint8]) -> Sizes:
    """Return the number of monomials in E (5n, p) by kind: gravity, acceleration, centrifugal and Coriolis."""
    rows = RowBlocks.of(E.shape[0] // BLOCKS)
    speeds, accelerations = E[rows.qd], E[rows.qdd]
    accelerating, moving = accelerations.any(axis=0), speeds.any(axis=0)
    squared = (speeds == 2).any(axis=0)
    return Sizes(
        int(np.count_nonzero(~moving & ~accelerating)),
        int(np.count_nonzero(accelerating)),
        int(np.count_nonzero(squared)),
        int(np.count_nonzero(moving & ~squared)),
    )


def term_texts(model: DynamicsModel) -> Iterator[str]:
    """Return every monomial of the torques as text, in the order of E: 'g s2 c3', 'qdd1 c2^2', 'qd1 qd2 s2 c2'.

    s2 is sin q2 and c2 is cos q2; g is the strength of gravity.
    """
    exponents = model.expanded().E
    n, rows = model.nv, RowBlocks.of(model.nv)
    names = [f"{symbol}{j + 1}" for symbol in ("q", "s", "c", "qd", "qdd") for j in range(n)]
    order = np.concatenate([np.arange(len(names))[each] for each in (rows.qdd, rows.qd, rows.position)])
    for column in exponents.T:
        factors = [names[r] + ("^2" if column[r] == 2 else "") for r in order if column[r]]
        is_gravity = not column[rows.rates].any()
        yield " ".join(["g", *factors] if is_gravity else factors)
