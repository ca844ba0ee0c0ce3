"""The recipe of a generated function. It says how the function is computed and with what it is compared. Each file of
psdmc/functions contains one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any, NamedTuple

from psdmc.dynamics.body import Body
from psdmc.dynamics.choices import Choices
from psdmc.dynamics.frames import Frame
from psdmc.dynamics.scalar import Matrix, Scalar, Vector
from psdmc.dynamics.slices import first_rates
from psdmc.dynamics.structure import Places
from psdmc.program.regions import Regions
from psdmc.program.signature import Signature
from psdmc.robot.mechanism import Array, Mechanism, NamedFrame, Placement

if TYPE_CHECKING:
    from psdmc.recipes.on_arrays import RobotOnArrays
    from psdmc.robot.reference import Reference

Outputs = Mapping[str, Any]
"""A scalar, or nested sequences of them, for each quantity of a signature that is stored, in the signature's order."""

Arrays = dict[str, Array]
"""Quantity's name -> (k, ...) values at k states, trailing axes as in the signature."""


class ByTheta(NamedTuple):
    """Base parameters as l symbols, and the bodies and drive inertias that depend on them."""

    theta_b: list[Any]
    bodies: tuple[Body, ...]
    drives: tuple[Scalar, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Ingredients:
    """Everything from which a function is recorded: symbols for its inputs, and one robot's constants.

    Each is a quantity with a dimension and a value in units that lowering chooses (lower/units.py). A sum of unlike
    quantities is an error.

    frames             n joint frames
    base_acceleration  minus gravity, along the base's axes (see base_axes)
    bodies             n bodies about the joint frames, from theta_b. They have the torques of the real ones, but not
                       their masses. Empty for functions without theta_b
    drives             n drive inertias, from theta_b; empty likewise
    choices            the arrangement of the recursions
    base_axes          the axes in which the first frame is given, as columns in the base frame
    base_origin        the origin from which the first frame is given, in the base frame
    link_frames        n, the file's link frames in the joint frames
    named              the named frames, placed in the joint frames
    tip                the tip frame, in the joint frame of tip_body
    tip_body           the body to which the tip frame is fixed
    lift               (11 n, l) theta_b to standard parameters about the link frames
    link_bodies        returns the links' real n bodies about the joint frames; NaN if unknown
    si                 returns a constant from its value and its unit: si(0.3, 'm'), si(1.5, 'N/m'). A number without unit
                       needs no si
    inputs             the function's inputs by name
    by_theta           returns theta_b as symbols, also if it is compiled in, for derivatives by it. The derivatives of
                       quantities that are linear in theta_b, such as torques, do not depend on its values
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
    tip: Placement
    tip_body: int
    lift: Array
    link_bodies: Callable[[], tuple[Body, ...]]
    si: Callable[[float, str], Scalar]
    inputs: Mapping[str, list[Any]]
    by_theta: Callable[[], ByTheta]

    @property
    def root(self) -> tuple[Matrix, Vector]:
        """The axes and the origin, in the base frame, in which the first frame is given."""
        return self.base_axes, self.base_origin

    @property
    def still(self) -> list[Scalar]:
        """nv zero rates."""
        return [0.0] * first_rates(self.frames)[-1]


class Polynomials(StrEnum):
    """Which part of the torques' polynomials (in E, P and theta_b) a function computes. The expanded lowering uses it."""

    TORQUE = "all terms"
    MASS = "terms of qdd"
    BIAS = "terms without qdd"
    GRAVITY = "terms of q alone"
    SOLVED = "terms of qdd, solved for it"
    REGRESSOR = "coefficients of theta_b"


class Needs(StrEnum):
    """What a model must have for a function, in addition to theta_b."""

    POSITIVE_MASS = "a positive definite mass matrix"
    STANDARD = "standard parameters of its links"


@dataclass(frozen=True, slots=True)
class Packing:
    """The entries of a matrix that a function with packed output stores.

    function     name of the function whose only output is the whole matrix
    places       returns their (row, column), from the robot and the lift of its base parameters
    is_triangle  whether they are a symmetric matrix's lower triangle
    """

    function: str
    places: Callable[[Mechanism, Array], Places]
    is_triangle: bool = False


@dataclass(frozen=True, slots=True)
class Recipe:
    """One generated function.

    signature    its name, inputs and outputs
    title        its name in prose
    trace        records its arithmetic on symbols, with the algorithms of psdmc.dynamics
    reference    the same in NumPy on the MODEL's own frames and bodies, without lowering: (robot, given) to the values of
                 all outputs. `given` holds every quantity of states; tau are the torques of q, qd and qdd
    against      name of Pinocchio's function with which it is compared
    pinocchio    the values of Pinocchio's function: (model on arrays, given)
    starts       name of the function whose search chooses the positions of frames and the unit of length
    shares       name of the function whose whole arrangement is used; only the choices of recursion are made again
    matters      fields of Choices that make a difference to it
    polynomials  which part of the torques' polynomials it is; None: it has no expanded lowering
    times_theta  whether its outputs times theta_b are torques and are compared as such: `pinocchio` returns these torques
    gradient     name of its output that is the gradient, by theta_b, of a number linear in theta_b. Multiplied by
                 theta_b, the gradient is compared with that number, which `pinocchio` returns
    beside       name of a function if outputs are differences of that function's values: errors are relative to those
    needs        what the model must have; left out: a positive definite mass matrix if the signature factorises one
    in_limbs     whether its algorithms mark sums over limbs (Frame.limbs), so that limbs can run in SIMD lanes
    accelerates  whether it computes accelerations, by the cheaper of two algorithms (Choices.articulated)
    default      whether it is generated if the user names no functions
    default_where_wide  the same for robots with joints of several coordinates
    benched      whether `make bench` measures it
    packs        the entries of another function's matrix that it stores: that function is lowered, and the other entries are
                 left out. `trace`, and the values of `pinocchio`, are those of that function
    regions      its body as loops and calls, from which C is printed; `trace` executes them. None: C is printed from
                 straight-line code
    """

    signature: Signature
    title: str
    trace: Callable[[Ingredients], Outputs]
    reference: Callable[[RobotOnArrays, Mapping[str, Array]], Arrays]
    against: str
    pinocchio: Callable[[Reference, Mapping[str, Array]], Arrays]
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
    regions: Callable[[Sequence[Frame]], Regions] | None = None

    def __post_init__(self) -> None:
        if self.needs is None and self.signature.factorises:
            object.__setattr__(self, "needs", Needs.POSITIVE_MASS)

    @property
    def name(self) -> str:
        return self.signature.name
