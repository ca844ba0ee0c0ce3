"""The form in which a file of psdmc/functions says how one generated function is made and compared with others."""

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
    """l base parameters as symbols, and the bodies and drives that stand for them."""

    theta_b: list[Any]
    bodies: tuple[Body, ...]
    drives: tuple[Scalar, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Ingredients:
    """What a trace runs on: symbols, and one robot's constants.

    They are quantities: each has a dimension and a value in units that lowering chooses (lower/units.py). A sum of unlike
    ones is an error.

    frames             n joint frames
    base_acceleration  minus gravity, along the axes that the first frame turns from
    bodies             n bodies about the joint frames, and
    drives             n drive inertias, from theta_b: they have the torques of the real ones and nothing else of them.
                       Empty for functions without theta_b
    choices            how the recursions are arranged
    base_axes          axes that the first frame turns from as columns in the base frame, and
    base_origin        their origin there
    link_frames        n, the file's link frames in the joint frames
    named              the named frames, placed in the joint frames
    tip                the tip frame, in the joint frame of
    tip_body           the body that it is fixed to
    lift               (11 n, l) theta_b to standard parameters about the link frames
    link_bodies        gives the links' own n bodies about the joint frames, of NaN where unknown
    si                 gives a constant, from its value and its unit: si(0.3, 'm'), si(1.5, 'N/m'); a number without unit is
                       itself
    inputs             the function's inputs by name
    by_theta           theta_b as symbols, also where it is compiled in, for derivatives by it: the derivatives of
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
        """Axes that the first frame turns from and their origin, in the base frame."""
        return self.base_axes, self.base_origin

    @property
    def still(self) -> list[Scalar]:
        """nv zero rates."""
        return [0.0] * first_rates(self.frames)[-1]


class Polynomials(StrEnum):
    """Which part of the torques expanded in E, P and theta_b a function is; the expanded lowering needs it."""

    TORQUE = "all terms"
    MASS = "terms of qdd"
    BIAS = "terms without qdd"
    GRAVITY = "terms of q alone"
    SOLVED = "terms of qdd, solved for it"
    REGRESSOR = "coefficients of theta_b"


class Needs(StrEnum):
    """What a model must have beyond theta_b."""

    POSITIVE_MASS = "a positive definite mass matrix"
    STANDARD = "standard parameters of its links"


@dataclass(frozen=True, slots=True)
class Packing:
    """Entries of a matrix.

    function     name of the function that puts out the whole matrix and nothing else
    places       their (row, column), from the robot and the lift of its base parameters
    is_triangle  whether they are a symmetric matrix's lower triangle
    """

    function: str
    places: Callable[[Mechanism, Array], Places]
    is_triangle: bool = False


@dataclass(frozen=True, slots=True)
class Recipe:
    """One generated function.

    signature    what it reads and puts out
    title        its name in prose
    trace        its arithmetic over psdmc.dynamics on symbols
    reference    the same in NumPy on the MODEL's own frames and bodies, no lowering involved: (robot, given) to the values
                 of all outputs. `given` holds every quantity of states; tau are the torques of q, qd and qdd
    against      name of Pinocchio's function that it is compared with
    pinocchio    the values of Pinocchio's function: (model on arrays, given)
    starts       name of the function whose search decides where frames sit and the unit of length
    shares       name of the function whose whole arrangement is used; only the choices within it are made again
    matters      fields of Choices that make a difference to it
    polynomials  what the expanded lowering needs; None: there is none for this function
    times_theta  whether its outputs times theta_b are torques and are compared as such: `pinocchio` gives these torques
    gradient     name of its output that is the gradient by theta_b of a number linear in theta_b. It is compared as that
                 number, times theta_b, which `pinocchio` gives
    beside       name of the function whose values this one's are differences of: errors are measured relative to those
    needs        what the model must have; left out: a positive definite mass matrix where the signature factorises one
    in_limbs     whether its algorithms say what they sum over limbs (Frame.limbs), so that these can run in lanes
    accelerates  whether its accelerations come by the cheaper of two ways (Choices.articulated)
    default      whether it is generated where no functions are named, and
    default_where_wide  whether it is then where some joint has several coordinates
    benched      whether `make bench` measures it
    packs        the matrix some of whose entries it puts out: its own function is lowered, and the other entries are left
                 out. Its `trace`, and the values of `pinocchio`, are that function's
    regions      its body as regions, which the C is made of; its `trace` is those regions written out. None, also of one
                 robot: the C is the straight line
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
    regions: Callable[[Sequence[Frame]], Regions | None] | None = None

    def __post_init__(self) -> None:
        if self.needs is None and self.signature.factorises:
            object.__setattr__(self, "needs", Needs.POSITIVE_MASS)

    @property
    def name(self) -> str:
        return self.signature.name
