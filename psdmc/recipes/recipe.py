"""The class Recipe, which says how a generated function is computed and with what it is compared. Each file of
psdmc/functions contains one recipe.

`on_both` writes functions of geometry and of the links' own bodies once: on symbols for a trace, on arrays for its
reference. `packed` makes functions that return only those entries of a matrix that can differ from zero, as a vector."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any, NamedTuple

from psdmc.dynamics.choices import Choices
from psdmc.dynamics.coordinates import first_rates
from psdmc.dynamics.frames import Frame
from psdmc.dynamics.scalar import Matrix, Scalar, Vector
from psdmc.dynamics.spatial import Body
from psdmc.dynamics.structure import Places
from psdmc.friction.joints import FrictionInDynamics
from psdmc.program.regions import Regions
from psdmc.program.signature import OF_ROWS, Signature
from psdmc.recipes.on_arrays import RobotOnArrays as RobotOnArrays
from psdmc.robot.mechanism import Array, Loop, Mechanism, NamedFrame, Placement

if TYPE_CHECKING:
    from psdmc.robot.reference import Reference as Reference
else:
    Reference = object  # for annotations alone: its module imports Pinocchio, which takes half a second
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from psdmc.dynamics.kinematics import AT_BASE
from psdmc.dynamics.scalar import scale, transform
from psdmc.program.signature import Quantity
from psdmc.recipes.on_arrays import entries

Outputs = Mapping[str, Any]
"""A scalar, or nested sequences of them, for each quantity of a signature that is stored, in the signature's order."""

Arrays = dict[str, Array]
"""Quantity's name -> (k, ...) values at k states, trailing axes as in the signature."""

Given = Mapping[str, Array]
"""The inputs at k states, as Arrays has the outputs."""


class ByTheta(NamedTuple):
    """The base parameters theta_b as l symbols, and the bodies and the drive inertias computed from these symbols."""

    theta_b: list[Any]
    bodies: tuple[Body, ...]
    drives: tuple[Scalar, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Ingredients:
    """Everything from which the code of a function is recorded: symbols for the function's inputs, and the constants of
    one robot.

    Each symbol and constant is a quantity with a dimension and a value in units that lowering chooses (lower/factored.py).
    Adding quantities with different dimensions is an error.

    frames             n joint frames
    base_acceleration  minus gravity, along the base's axes (see base_axes)
    bodies             n bodies about the joint frames, computed from theta_b. They give the torques of the real bodies,
                       but have other masses. Empty for functions that do not use theta_b
    drives             n inertias of the joints' drives, computed from theta_b. Empty for functions that do not use
                       theta_b
    choices            which of several equivalent forms each recursion along the robot has
    base_axes          axes in which the placement of the first joint is given: columns, in the base frame
    base_origin        origin from which the placement of the first joint is given, in the base frame
    link_frames        placements of the n link frames of the robot file in the joint frames
    named              the named frames, placed in the joint frames
    loops              the closed loops, whose frames are placed in the joint frames, or in the base frame
    tip                the tip frame, in the joint frame of tip_body
    tip_body           the body to which the tip frame is fixed
    lift               (11 n, l) matrix that gives standard parameters about the link frames from theta_b
    link_bodies        returns the n bodies with the robot file's standard parameters, about the joint frames; NaN if
                       unknown
    si                 returns a constant from its value and its unit: si(0.3, 'm'), si(1.5, 'N/m'). A number without
                       unit needs no si
    inputs             the function's inputs by name
    by_theta           returns theta_b as symbols, for derivatives by theta_b. The function can be called even if the
                       code contains fixed values of theta_b: torques are linear in theta_b, so derivatives do not
                       depend on the values
    friction           joint friction, which the torques of motors contain; None: they have none
    """

    frames: tuple[Frame, ...]
    base_acceleration: Vector
    bodies: tuple[Body, ...]
    drives: tuple[Scalar, ...]
    choices: Choices
    base_axes: Matrix
    base_origin: Vector
    link_frames: tuple[Placement, ...]
    named: tuple[NamedFrame, ...]
    loops: tuple[Loop, ...]
    tip: Placement
    tip_body: int
    lift: Array
    link_bodies: Callable[[], tuple[Body, ...]]
    si: Callable[[float, str], Scalar]
    inputs: Mapping[str, list[Any]]
    by_theta: Callable[[], ByTheta]
    friction: FrictionInDynamics | None = None

    @property
    def root(self) -> tuple[Matrix, Vector]:
        """Return the axes and the origin, in the base frame, relative to which the placement of the first joint is
        given."""
        return self.base_axes, self.base_origin

    @property
    def still(self) -> list[Scalar]:
        """nv zero rates."""
        return [0.0] * first_rates(self.frames)[-1]


class Polynomials(StrEnum):
    """The terms of the joint torques that a function computes in the expanded form of code. There the torques are sums
    of products of theta_b, constants, and functions of q, qd and qdd."""

    TORQUE = "all terms"
    MASS = "terms of qdd"
    BIAS = "terms without qdd"
    GRAVITY = "terms of q alone"
    SOLVED = "terms of qdd, solved for it"
    REGRESSOR = "coefficients of theta_b"


class Needs(StrEnum):
    """A property of a model, besides known base parameters, that a generated function needs."""

    POSITIVE_MASS = "a positive definite mass matrix"
    LOOPS = "closed loops"
    PASSIVE = "closed loops with passive joints"
    STANDARD = "standard parameters of its links"


@dataclass(frozen=True, slots=True)
class Packing:
    """The entries of a matrix that a function with packed output (a vector of nonzero entries) stores.

    function     name of the function whose only output is the whole matrix
    places       returns the entries' rows and columns, from the robot and the matrix that gives standard parameters
                 from base parameters
    is_triangle  whether the entries are the lower triangle of a symmetric matrix
    """

    function: str
    places: Callable[[Mechanism, Array], Places]
    is_triangle: bool = False


@dataclass(frozen=True, slots=True)
class Recipe:
    """Everything about one generated function: name, arguments, computation, and comparison with Pinocchio.

    signature    the function's name, inputs and outputs
    title        the function's name in documents
    trace        records the function's arithmetic on symbols, with the algorithms of psdmc.dynamics
    reference    computes all outputs in NumPy from the model's frames and bodies, without generated code: takes (robot,
                 given). `given` holds q, qd, qdd, tau and other inputs for many states; tau are the torques of q, qd
                 and qdd
    against      name of Pinocchio's function with which the results are compared
    pinocchio    computes the results with Pinocchio: takes (robot, given)
    starts       name of the function whose search chooses the positions of frames and the unit of length
    shares       name of a function whose search results are used, too; only the choices among recursions are made again
    matters      fields of Choices that change the function's code
    polynomials  which terms of the torques' polynomials the function computes; None: the function has no expanded form
                 of code
    times_theta  whether the outputs times theta_b are torques, and `pinocchio` returns these torques for comparison
    gradient     name of the output that is the gradient, by theta_b, of a scalar linear in theta_b. The gradient times
                 theta_b is compared with this scalar, which `pinocchio` returns
    beside       name of another function if the outputs are differences of its values: errors are relative to the
                 values of this other function
    needs        what the model must have; left out: a positive definite mass matrix if the signature factorises one
    in_limbs     whether the algorithms mark sums over limbs (equal branches, such as legs), so that limbs can run in
                 SIMD lanes
    accelerates  whether the function computes accelerations, by the cheaper of two algorithms (Choices.articulated)
    default      whether the function is generated if the user names no functions
    default_where_wide  `default` for robots that have joints of several coordinates, such as a floating base
    benched      whether `make bench` measures the function
    packs        the entries of another function's matrix that the function stores. The code of the other function is
                 generated, and all other entries are left out. `trace` and `pinocchio` compute the whole matrix
    regions      the function's body as loops and calls, from which C is printed; `trace` computes the same. It is made
                 from the joint frames and the named frames. None: C is printed from code without loops
    closes       whether the function takes closed loops into account. Other functions with contacts and theta_b are refused
                 for robots with loops; all others compute the spanning tree, whose loops are open
    straight     number of joint rates up to which C is printed from code without loops although there are `regions`.
                 Code without loops has SIMD lanes for batches. A KR6's second derivatives also execute 15 % fewer
                 instructions, but a quadruped's would be 38,000 operations
    """

    signature: Signature
    title: str
    trace: Callable[[Ingredients], Outputs]
    reference: Callable[[RobotOnArrays, Given], Arrays]
    against: str
    pinocchio: Callable[[Reference, Given], Arrays]
    starts: str | None = None
    shares: str | None = None
    matters: tuple[str, ...] = Choices.__slots__
    polynomials: Polynomials | None = None
    times_theta: bool = False
    gradient: str | None = None
    beside: str | None = None
    needs: Needs | None = None
    in_limbs: bool = False
    accelerates: bool = False
    default: bool = False
    default_where_wide: bool = False
    benched: bool = False
    packs: Packing | None = None
    regions: Callable[[Sequence[Frame], Sequence[NamedFrame]], Regions] | None = None
    straight: int = 8
    closes: bool = False

    def __post_init__(self) -> None:
        if self.needs is None and any("nv" in matrix.axes for matrix in self.signature.factorises):
            object.__setattr__(self, "needs", Needs.POSITIVE_MASS)

    @property
    def name(self) -> str:
        return self.signature.name

    def lack_of_loops(self, robot: Mechanism) -> str | None:
        """Return why a robot has no such function, because it has closed loops or has none; None: it may have it."""
        if not robot.loops:
            return "the robot has no closed loops" if self.needs in (Needs.LOOPS, Needs.PASSIVE) else None
        if self.needs is Needs.PASSIVE and not robot.passive_rates:
            return "its closed loops name no passive joints"
        signature = self.signature
        touching = {"contacts", *OF_ROWS}
        touches = any(touching & {*q.axes} for q in (*signature.inputs, *signature.outputs))
        if touches and signature.theta and not self.closes:
            return "for robots with closed loops, psdmc does not generate it yet"
        return None


Rows = Sequence[Sequence[Scalar]]


@dataclass(frozen=True, slots=True, eq=False)
class PlacedRobot:
    """The constants of a robot whose first joint frame is placed in the base frame at `root`.

    solids  gives the links' own bodies about the joint frames
    """

    frames: Sequence[Frame]
    named: Sequence[NamedFrame]
    loops: Sequence[Loop]
    root: tuple[Matrix, Vector]
    solids: Callable[[], Sequence[Body]]

    @property
    def mass(self) -> Scalar:
        """Return the mass of all links, kg."""
        return sum(body.mass for body in self.solids())

    def in_base(self, v: Vector) -> Vector:
        """Convert a vector from the axes that the first joint frame turns from to the base's axes."""
        return transform(self.root[0], v)

    def rows_in_base(self, rows: Rows, factor: Scalar = 1.0) -> list[list[Scalar]]:
        """Convert the columns of a matrix likewise, three rows after three, and multiply them by a factor."""
        columns = [
            [x for k in range(0, len(column), 3) for x in scale(self.in_base(column[k : k + 3]), factor)]
            for column in zip(*rows, strict=True)
        ]
        return [list(row) for row in zip(*columns, strict=True)]


def on_both(
    values: Callable[..., Outputs], inputs: Sequence[Quantity]
) -> tuple[Callable[[Ingredients], Outputs], Callable[[RobotOnArrays, Given], Arrays]]:
    """Return the trace and the reference of a function with these inputs. `values` computes its outputs from a PlacedRobot
    and each input as a list."""

    def trace(g: Ingredients) -> Outputs:
        placed = PlacedRobot(g.frames, g.named, g.loops, g.root, g.link_bodies)
        return values(placed, *(g.inputs[quantity.name] for quantity in inputs))

    def reference(robot: RobotOnArrays, given: Given) -> Arrays:
        chain = robot.chain
        placed = PlacedRobot(robot.frames, chain.frames, chain.loops, AT_BASE, lambda: robot.solids)
        found = values(placed, *(list(given[quantity.name].T) for quantity in inputs))
        count = len(given[inputs[0].name if inputs else "q"])
        return {name: entries(value, count) for name, value in found.items()}

    return trace, reference


VALUES = Quantity(
    "values",
    ("nonzeros",),
    means="entries of the matrix; `CompiledRobot.pattern` returns their rows and columns",
)


def packed(dense: Recipe, order: int, meaning: str, summary: str, packing: Packing) -> Recipe:
    """Return the recipe of a function that returns the nonzero entries of a matrix as a vector. The function `dense`
    computes the whole matrix."""
    function, (matrix,) = dense.signature, dense.signature.outputs

    def reference(robot: RobotOnArrays, given: Given) -> Arrays:
        rows, columns = _indices(packing, robot)
        return {VALUES.name: dense.reference(robot, given)[matrix.name][:, rows, columns]}

    return replace(
        dense,
        signature=Signature(
            f"{dense.name}_packed",
            order,
            meaning,
            function.inputs,
            (VALUES,),
            theta=function.theta,
            factorises=function.factorises,
            calls=function.calls,
            summary=summary,
            weighs=function.weighs,
        ),
        title=f"{dense.title}, packed",
        reference=reference,
        starts=None,
        polynomials=None,
        in_limbs=False,
        default=False,
        benched=False,
        packs=packing,
    )


def unpacked(packing: Packing, dense: Recipe, robot: RobotOnArrays, values: Array) -> Arrays:
    """Return the whole matrices that `dense` would return, from the vectors (k, nonzeros) of their nonzero entries, for
    k states."""
    (matrix,) = dense.signature.outputs
    lengths = {"nv": robot.nv, "nxa": 3 * robot.nv, "nxu": 3 * robot.nv, "l": robot.lift.shape[1]}
    found = np.zeros((len(values), *(lengths[axis] for axis in matrix.axes)))
    rows, columns = _indices(packing, robot)
    found[:, rows, columns] = values
    if packing.is_triangle:
        found[:, columns, rows] = values
    return {matrix.name: found}


def _indices(packing: Packing, robot: RobotOnArrays) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    rows, columns = np.array(packing.places(robot.chain, robot.lift), dtype=np.intp).reshape(-1, 2).T
    return rows, columns
