"""Derivatives of motions and contact forces of robots with contacts: as code, as loops, in NumPy, and with Pinocchio.

The motion x and the contact forces f solve M x - J^T f = r and J x + mu f = w, with the load r and the prescribed motion
w of the active contacts. Derivatives of x and f solve the same equations with the derivatives of the residuals.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from psdmc.dynamics.arrow import Arrow
from psdmc.dynamics.constraints import Constraints, of_active
from psdmc.dynamics.coordinates import first_rates, flat, leading
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import factorize, negative
from psdmc.program.products import Thin
from psdmc.program.regions import Column, Reader, Region, Straight, straight
from psdmc.program.signature import THIN
from psdmc.recipes.contacts import ACTIVE, MU, Held, dense_solution
from psdmc.recipes.loops import Block, Product, copied, nonzero
from psdmc.recipes.on_arrays import matrix
from psdmc.recipes.recipe import Given, Reference, RobotOnArrays
from psdmc.reproducible import inverse, times
from psdmc.robot.mechanism import Array

Rows = Sequence[Sequence[Scalar]]

MINUS = {"minus": (-1.0,)}
"""Constant array of the function bodies."""


class Counts(NamedTuple):
    """Numbers of coordinates, of rates, of contacts, of contacts and loops, and of the rows of either."""

    nq: int
    nv: int
    contacts: int
    constraints: int
    contact_rows: int
    rows: int

    @staticmethod
    def of(of: Constraints) -> Counts:
        counts = [each.rows for each in of.named if each.rows]
        closed = [len(loop.rows) for loop in of.loops]
        nq = sum(frame.joint.nq for frame in leading(of.frames))
        both = [*counts, *closed]
        return Counts(nq, first_rates(of.frames)[-1], len(counts), len(both), sum(counts), sum(both))

    @property
    def arrays(self) -> dict[str, int]:
        """The lengths of the internal arrays that the loops of this file use.

        J           Jacobian of contacts and loops
        seen        J M^-1
        push        the compliance times this
        compliance  the inverse of J M^-1 J^T + mu I in the active rows and columns, zeros in the others
        turn        derivatives of J^T f by q, at constant contact forces f
        """
        nv, rows = self.nv, self.rows
        return dict.fromkeys(("J", "seen", "push"), rows * nv) | {"compliance": rows * rows, "turn": nv * nv}


def geometry(
    of: Constraints,
    read: Reader,
    forces: str,
    kept: dict[str, list[tuple[int, ...]]],
) -> tuple[Rows, dict[str, Column]]:
    """Return the Jacobian of contacts and loops, and what `Counts.arrays` calls J and turn. `kept` gets the entries of each
    row of J, and of each column of turn, that are not zero."""
    counts = Counts.of(of)
    q = read("q", counts.nq)
    jacobian, turn = of.jacobian(q), of.pushes(q, read(forces, counts.rows))
    kept |= {"J": nonzero(jacobian), "turn": nonzero(list(zip(*turn, strict=True)))}
    return jacobian, {"J": Column(flat(jacobian)), "turn": Column(flat(turn))}


def compliant(of: Constraints, kept: Sequence[Sequence[int]]) -> Straight:
    """Compute the compliance from J and J M^-1."""
    counts = Counts.of(of)
    nv, rows = counts.nv, counts.rows

    def inverted(read: Reader) -> dict[str, Column]:
        jacobian, seen = read("J", rows * nv), read("seen", rows * nv)
        mask = Held(of.named, read(ACTIVE.name, counts.contacts), read(MU.name, 1)[0], loops=of.loops)
        products = [[0.0] * rows for _ in range(rows)]
        for i, own in enumerate(kept):
            for j in range(i + 1):
                total: Scalar = 0.0
                for k in own:
                    total = total + jacobian[i * nv + k] * seen[j * nv + k]
                products[i][j] = products[j][i] = total
        factors = factorize(of_active(products, *mask.rows))
        return {"compliance": Column(flat(mask.compliance(factors)))}

    return straight(inverted)


class Changes(NamedTuple):
    """The derivatives by one quantity, as arrays of a function.

    wanted  rows x columns: those of the prescribed motion of the contacts
    motion  nv x columns: those of the motion without contacts, then with contacts
    forces  rows x columns: those of the contact forces
    """

    wanted: str
    motion: str
    forces: str


def responses(
    of: Constraints,
    inverse_matrix: str,
    kept: Mapping[str, list[tuple[int, ...]]],
    changes: Sequence[Changes],
) -> Iterator[Region]:
    """Loops that change derivatives of a motion without contacts to those with contacts, and compute those of the contact
    forces. The array `inverse_matrix` has M^-1."""
    counts = Counts.of(of)
    nv, rows = counts.nv, counts.rows
    jacobian, seen, push = (Block(name, nv) for name in ("J", "seen", "push"))
    compliance, every = Block("compliance", rows), range(rows)
    yield from Product(jacobian, Block(inverse_matrix, nv), seen, rows, nv).by_rows(kept["J"])
    yield compliant(of, kept["J"])
    yield Product(compliance, seen, push, rows, nv).loop(every)
    for own in changes:
        wanted, motion, forces = (Block(name, nv) for name in own)
        yield from Product(jacobian, motion, wanted, rows, nv, True, True).by_rows(kept["J"])
        yield Product(push.turned(), wanted, motion, nv, nv, True).loop(every)
        yield Product(compliance, wanted, forces, rows, nv).loop(every)


def pushed_motion(
    nv: int, inverse_matrix: str, motion: str, kept: Sequence[tuple[int, ...]]
) -> Iterator[Region]:
    """Loops that add M^-1, which is symmetric, times the array turn to the array `motion`, column by column. `kept` has the
    entries of each column of turn that are not zero."""
    turned = Block("turn", nv).turned(), Block(inverse_matrix, nv), Block(motion, nv).turned()
    return Product(*turned, nv, nv, True).by_rows(kept)


def held_inverse(of: Constraints, motion: str, forces: str) -> Iterator[Region]:
    """Yield loops that change the array `motion` from M^-1 to the derivatives of the motion with contacts by the load. They
    store those of the contact forces, too."""
    counts = Counts.of(of)
    nv, rows = counts.nv, counts.rows
    seen, push = Block("seen", nv), Block("push", nv)
    yield Product(push.turned(), seen, Block(motion, nv), nv, nv, True, True).loop(range(rows))
    yield copied(rows, nv, push, Block(forces, nv), "minus")


def thin_outputs(
    arrow: Arrow, nv: int, changes: Mapping[str, Rows], motion: str, forces: str
) -> dict[str, list[list[Scalar]]]:
    """Return the factors of derivatives of the motion and of the contact forces, as outputs of a trace with limbs.

    changes  for each quantity, the result of `Arrow.thin` for its derivatives of minus the residuals, whose last rows
             belong to minus the contact forces
    """
    thin = [row[:nv] for row in arrow.thin_factors()]
    return {
        **{f"d{motion}_d{by}": [list(row) for row in rows[:nv]] for by, rows in changes.items()},
        **{f"d{forces}_d{by}": negative(rows[nv:]) for by, rows in changes.items()},
        THIN: [*thin[:nv], *negative(thin[nv:])],
    }


def thin_blocks(motion: str, forces: str, by: Sequence[str]) -> tuple[Thin, ...]:
    """Return which outputs are products of factors, if contacts are on equal limbs. A translation of a floating base
    changes neither the motion nor the forces."""
    return tuple(Thin(f"d{motion}_d{each}", 3 if each == "q" else 0, f"d{forces}_d{each}") for each in by)


def scaled(factors: Sequence[Scalar], rows: Rows) -> list[list[Scalar]]:
    """Return the rows of a matrix, each times its factor."""
    return [[factor * x for x in row] for factor, row in zip(factors, rows, strict=True)]


def changed_on_arrays(
    robot: RobotOnArrays, given: Given, loads: Sequence[Array], wanted: Sequence[Array]
) -> tuple[list[Array], list[Array], tuple[Array, Array, Array]]:
    """Return the derivatives of the motion and of the contact forces, in NumPy, for k states. Given are those of the load,
    (k, nv, columns) each, and of the prescribed motion, (k, rows, columns) each.

    The last result is the inverse mass matrix on the contacts, the derivatives of the forces by the load, and the
    compliance.
    """
    count = len(given["q"])
    loops = robot.chain.loops
    rows = matrix(constraints_of(robot).jacobian(list(given["q"].T)), count)
    held = Held.on_arrays(robot, given, loops)
    on, shift, unit = (matrix([values], count)[:, 0] for values in held.rows)
    turned = np.swapaxes(rows, -1, -2)
    free = inverse(robot.mass_matrix(given["q"]))
    seen = times(rows, free)
    both = on[:, :, None] * on[:, None]
    diagonal = np.eye(rows.shape[1]) * (on * shift + (1.0 - on) * unit)[:, None]
    compliance = both * inverse(both * times(seen, turned) + diagonal)
    push = times(compliance, seen)
    fixed = free - times(np.swapaxes(push, -1, -2), seen)
    motions = [
        times(fixed, r) + times(np.swapaxes(push, -1, -2), w) for r, w in zip(loads, wanted, strict=True)
    ]
    forces = [times(compliance, w) - times(push, r) for r, w in zip(loads, wanted, strict=True)]
    return motions, forces, (fixed, -push, compliance)


def constraints_of(robot: RobotOnArrays) -> Constraints:
    """Return the contacts and loops of a robot in NumPy."""
    return Constraints(robot.frames, robot.chain.frames, robot.chain.loops)


def slopes_on_arrays(
    robot: RobotOnArrays,
    q: Array,
    qd: Array,
    motion: Array,
    forces: Array,
    of_loops: Array | None = None,
    kp: Array | None = None,
) -> tuple[Array, Array, Array]:
    """Return two kinds of derivatives for k states. They are those of J^T f by q, (k, nv, nv), and those of the
    accelerations J motion + dJ/dt qd of contacts and loops, by q and by qd, (k, rows, nv).

    of_loops  the motion in the loops' rows; left out: `motion`
    kp        what multiplies the loops' errors, which are added to their accelerations, (k,); left out: 0
    """
    of, count, here = constraints_of(robot), len(q), list(q.T)
    turn = of.pushes(here, list(forces.T))
    by_q, by_qd = of.slopes(here, list(qd.T), list(motion.T), None if of_loops is None else list(of_loops.T))
    if kp is not None:
        by_q = of.drawn_closed(by_q, here, kp)
    return matrix(turn, count), matrix(by_q, count), matrix(by_qd, count)


def changed_by_pinocchio(
    robot: Reference,
    given: Given,
    loads: Sequence[Array],
    wanted: Sequence[Array],
    jacobian: Array,
) -> tuple[list[Array], list[Array]]:
    """Return what `changed_on_arrays` returns first, from the full linear systems of Pinocchio's mass matrices."""
    cuts = np.cumsum([load.shape[-1] for load in loads])[:-1]
    solution = dense_solution(robot, given, jacobian, *(np.concatenate(x, axis=-1) for x in (loads, wanted)))
    motions, forces = (np.split(each, cuts, axis=-1) for each in solution)
    return motions, forces
