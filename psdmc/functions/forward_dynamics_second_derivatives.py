"""Second derivatives of the weighted accelerations of forward dynamics.

With weights c and lambda = M^-1 c, the torques of inverse dynamics at qdd(q, qd, tau) are tau. Differentiated twice and
weighted with lambda, this is

    d2 (c . qdd) / dx dy  =  - H_xy - H_xa (d qdd / dy) - (H_ya (d qdd / dx))^T

for x and y each of q, qd and tau. H are the second derivatives of lambda . tau by q, qd and the accelerations a, at constant
lambda; H_xa is zero unless x is q.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from psdmc.dynamics.coordinates import joints_of_rates, leading
from psdmc.dynamics.frames import Frame, with_carriers
from psdmc.dynamics.scalar import Scalar
from psdmc.functions import forward_dynamics_derivatives as accelerations
from psdmc.functions import inverse_dynamics_second_derivatives as torques
from psdmc.program.regions import (
    Call,
    Column,
    For,
    Reader,
    Region,
    Regions,
    Slice,
    drop_unread,
    run,
    straight,
)
from psdmc.program.signature import QD, TAU, Q, Signature
from psdmc.recipes.directions import COTANGENT, COTANGENT_OF_QDD, hessian_of, weighted
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.reproducible import times
from psdmc.robot.mechanism import Array, NamedFrame

ACCELERATIONS, TORQUES = accelerations.RECIPE, torques.RECIPE


def trace(g: Ingredients) -> Outputs:
    """The regions written out."""
    nq, nv = len(g.inputs["q"]), len(g.still)

    def call(name: str, given: list[list[Scalar]]) -> tuple[list[list[Scalar]], list[Scalar]]:
        q, qd, last = given[0][:nq], given[1][:nv], given[2][:nv]
        if name == TORQUES.name:
            own = {"q": q, "qd": qd, "qdd": last, "cotangent": given[3][:nv]}
            found = torques.trace(replace(g, inputs=own))["hessian"]
            return [[x for row in found for x in row]], []
        found = accelerations.multiplied(replace(g, inputs={"q": q, "qd": qd, "tau": last}))
        blocks = [[x for row in found[name] for x in row] for name in ("dqdd_dq", "dqdd_dqd", "dqdd_dtau")]
        return [list(found["qdd"]), *blocks], list(found["pivot"])

    found, pivots = run(regions(g.frames), g.inputs, {"hessian": 9 * nv * nv}, call)
    return {**found, "pivot": pivots}


def _rates(frames: Sequence[Frame]) -> int:
    return sum(frame.joint.nv for frame in leading(frames))


def regions(frames: Sequence[Frame], named: Sequence[NamedFrame] = ()) -> Regions:
    """The formula above.

    slopes    3 x nv x nv, the derivatives of qdd by q, qd and tau
    weights   lambda
    torques   3 nv x 3 nv, H
    bent      nv x 3 nv, H_qa times the slopes; its first rows are zero, as the mass matrix does not depend on the
              position of the first joint, unless this is a mimic joint or has one
    """
    nv = _rates(frames)
    width, size = 3 * nv, nv * nv
    mimics = [frame.mimic for frame in frames if frame.mimic is not None]
    is_alone = frames[0].mimic is None and not any(0 in mimic.leaders for mimic in mimics)
    still = frames[0].joint.nv if is_alone else 0

    def weighted_row(read: Reader) -> dict[str, Column]:
        return {"weight": Column([_product(read("row", nv), read("cotangent", nv))])}

    def by_q_q(read: Reader) -> dict[str, Column]:
        turned = read("bent_ij", 1)[0] + read("bent_ji", 1)[0]
        return {"entry": Column([-(read("own", 1)[0] + turned)])}

    def by_q_qd(read: Reader) -> dict[str, Column]:
        value = Column([-(read("own", 1)[0] + read("bent_ij", 1)[0])])
        return {"entry": value, "mirror": value}

    def by_q_tau(read: Reader) -> dict[str, Column]:
        value = Column([-read("bent_ij", 1)[0]])
        return {"entry": value, "mirror": value}

    def by_qd_qd(read: Reader) -> dict[str, Column]:
        zeros = {"by_tau": Column([0.0]), "of_tau": Column([0.0]), "twice": Column([0.0])}
        return {"entry": Column([-read("own", 1)[0]]), **zeros}

    def rows(array: str, block: int = 0, row: int = 0) -> Slice:
        return Slice(f"{array}_i", array, row * nv * width + block * nv, width)

    entry, own = Slice("entry", "hessian_i"), Slice("own", "torques_i")
    bent_ij, mirror = Slice("bent_ij", "bent_i"), Slice("mirror", "mirror_i", 0, width)
    body: tuple[Region, ...] = (
        Call(
            ACCELERATIONS.name,
            (("q", 0), ("qd", 0), ("tau", 0)),
            (("qdd", 0), *(("slopes", k * size) for k in range(3))),
            nv,
        ),
        For(
            nv, (Slice("row", "slopes", 2 * size, nv), Slice("weight", "weights")), (straight(weighted_row),)
        ),
        Call(TORQUES.name, (("q", 0), ("qd", 0), ("qdd", 0), ("weights", 0)), (("torques", 0),)),
        For(still * width, (Slice("entry", "bent"),), (straight(lambda read: {"entry": Column([0.0])}),)),
        *_bent_rows(frames, still, nv),
        For(
            nv,
            (rows("hessian"), rows("torques"), rows("bent"), Slice("column", "bent")),
            (For(nv, (entry, own, bent_ij, Slice("bent_ji", "column", 0, width)), (straight(by_q_q),)),),
        ),
        For(
            nv,
            (
                rows("hessian", 1),
                rows("torques", 1),
                rows("bent", 1),
                Slice("mirror_i", "hessian", nv * width),
            ),
            (For(nv, (entry, own, bent_ij, mirror), (straight(by_q_qd),)),),
        ),
        For(
            nv,
            (rows("hessian", 2), rows("bent", 2), Slice("mirror_i", "hessian", 2 * nv * width)),
            (For(nv, (entry, bent_ij, mirror), (straight(by_q_tau),)),),
        ),
        For(
            nv,
            (
                rows("hessian", 1, 1),
                rows("torques", 1, 1),
                Slice("by_tau_i", "hessian", nv * width + 2 * nv, width),
                Slice("of_tau_i", "hessian", 2 * nv * width + nv, width),
                Slice("twice_i", "hessian", 2 * nv * width + 2 * nv, width),
            ),
            (
                For(
                    nv,
                    (entry, own, *(Slice(each, f"{each}_i") for each in ("by_tau", "of_tau", "twice"))),
                    (straight(by_qd_qd),),
                ),
            ),
        ),
    )
    sizes = {"qdd": nv, "slopes": 3 * size, "weights": nv, "torques": 9 * size, "bent": 3 * size}
    return drop_unread(Regions(sizes, body))


def _bent_rows(frames: Sequence[Frame], still: int, nv: int) -> Iterator[For]:
    """The rows of H_qa times the slopes, from row `still` on. A loop takes neighbouring rows with zeros in the same columns,
    such as those of a leg."""
    width, coupled = 3 * nv, _coupled(frames)
    for columns, numbers in groupby(range(still, nv), key=coupled.__getitem__):

        def entry(read: Reader, columns: Sequence[int] = columns) -> dict[str, Column]:
            row, slope = read("row", nv), read("slope", nv, nv)
            return {"entry": Column([_product([row[k] for k in columns], [slope[k] for k in columns])])}

        own = tuple(numbers)
        yield For(
            len(own),
            (
                Slice("row", "torques", own[0] * width + 2 * nv, width),
                Slice("bent_i", "bent", own[0] * width, width),
            ),
            (
                For(
                    3,
                    (Slice("slopes_k", "slopes", 0, nv * nv), Slice("bent_k", "bent_i", 0, nv)),
                    (For(nv, (Slice("slope", "slopes_k"), Slice("entry", "bent_k")), (straight(entry),)),),
                ),
            ),
        )


def _coupled(frames: Sequence[Frame]) -> list[tuple[int, ...]]:
    """For each rate those that move a joint of it, carry one or are carried by one."""
    moved = [
        {i for i, frame in enumerate(frames) if i == owner or (frame.mimic and owner in frame.mimic.leaders)}
        for owner in joints_of_rates(frames)
    ]
    carriers = [set(with_carriers(frames, own)) for own in moved]
    return [
        tuple(k for k in range(len(moved)) if moved[k] & carriers[j] or moved[j] & carriers[k])
        for j in range(len(moved))
    ]


def _product(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalar:
    products = [x * y for x, y in zip(a, b, strict=True)]
    return sum(products[1:], products[0])


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    found = ACCELERATIONS.reference(robot, given)
    slopes = [found[f"dqdd_d{by}"] for by in ("q", "qd", "tau")]
    weights = weighted(given[COTANGENT_OF_QDD.name], slopes[2])
    hessian = robot.torque_hessian(given["q"], given["qd"], given["qdd"], weights)
    return {"hessian": _solved(hessian, slopes)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    """Compute the expected values from Pinocchio's derivatives, and differences of its gradient of inverse dynamics.
    Differences of the gradient of forward dynamics would be less exact if the mass matrix is nearly singular."""
    qdd, *slopes = robot.forward_dynamics_derivatives(given["q"], given["qd"], given["tau"])
    weights = weighted(given[COTANGENT_OF_QDD.name], slopes[2])
    there = {**given, "qdd": qdd, COTANGENT.name: weights}
    return {"hessian": _solved(TORQUES.pinocchio(robot, there)["hessian"], slopes)}


def _solved(torques: Array, slopes: Sequence[Array]) -> Array:
    """The second derivatives by (q, qd, tau) from H, and from the derivatives of qdd by q, qd and tau."""
    nv = torques.shape[-1] // 3
    hessian = -torques
    bent = times(hessian[:, :nv, 2 * nv :], np.concatenate(slopes, axis=-1))
    hessian[:, :nv, 2 * nv :] = hessian[:, 2 * nv :, :nv] = 0.0
    hessian[:, :nv] += bent
    hessian[:, :, :nv] += bent.transpose(0, 2, 1)
    return hessian


RECIPE = Recipe(
    Signature(
        "forward_dynamics_second_derivatives",
        214,
        "symmetric matrix of second derivatives of cotangent . qdd by (q, qd, tau)",
        (Q, QD, TAU, COTANGENT_OF_QDD),
        (hessian_of(TAU, "nxu"),),
        theta=True,
        summary="Compute the second derivatives by q, qd and tau of a weighted sum of the accelerations qdd of "
        "forward dynamics. The weighted sum is the sum of cotangent[i] * qdd[i].",
        factorises=ACCELERATIONS.signature.factorises,
        calls=(TORQUES.name, ACCELERATIONS.name),
    ),
    "second derivatives of forward dynamics",
    trace,
    reference,
    "computeABADerivatives",
    pinocchio,
    shares="inverse_dynamics",
    regions=regions,
    beside="forward_dynamics_derivatives",
)
