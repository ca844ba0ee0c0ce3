"""C code of the operations for which C has no operator, for one state and for vectors with one state or limb per lane.

In a generated function body, such an operation is a macro of the same name. The macros are defined in roots.h (square
roots, which every compiler has for vectors) and in operations.h.
"""

from __future__ import annotations

from dataclasses import dataclass

from psdmc.program.operations import Op, Unit


@dataclass(frozen=True, slots=True)
class CallView:
    """One operation for which C has no operator.

    parameters  of its macro and its functions
    one         C expression of them for reals; FUNCTION(name) is the C library's function for the package's real
    many        the same for vectors, where BLEND(mask, x, y) is x in the lanes whose mask is set; '': lane by lane
    """

    op: Op
    parameters: tuple[str, ...]
    one: str
    many: str = ""

    @property
    def macro(self) -> str:
        return self.op.upper()

    @property
    def arguments(self) -> str:
        return ", ".join(self.parameters)

    def single(self, suffix: str) -> str:
        """What the macro is for one state."""
        return (
            f"{self.function('real')}({self.arguments})"
            if self.has_header
            else self.one.format(suffix=suffix)
        )

    def one_lane(self, suffix: str) -> str:
        """The real of one lane."""
        lanes = ", ".join(f"{name}[lane]" for name in self.parameters)
        return f"{self.op}{suffix}({lanes})"

    @property
    def lanes(self) -> str:
        """Definition of the operation's macro in code for one state per lane."""
        return f"{self.function('lanes') if self.has_header else 'root_lanes'}({self.arguments})"

    @property
    def has_header(self) -> bool:
        """Whether its functions stand in operations.h."""
        return self.op is not Op.SQRT

    @property
    def is_library(self) -> bool:
        """Whether it calls the C library."""
        return self.op.unit is Unit.CALL

    def function(self, kind: str) -> str:
        """Name of the C function that computes the operation for reals, lanes or limbs."""
        return f"{self.op}_{kind}"

    def declared(self, kind: str) -> str:
        """The parameters of that function."""
        return ", ".join(f"{kind} {name}" for name in self.parameters)


_ALL = (
    CallView(Op.SQRT, ("value",), "sqrt{suffix}(value)"),
    CallView(Op.ABS, ("a",), "fabs{suffix}(a)", "({kind})(({bits})a & ~({bits})(-({kind}){{0}}))"),
    CallView(
        Op.MIN, ("a", "b"), "a < b || a != a ? a : b", "BLEND({kind}, {bits}, (a < b) | (a != a), a, b)"
    ),
    CallView(
        Op.MAX, ("a", "b"), "a > b || a != a ? a : b", "BLEND({kind}, {bits}, (a > b) | (a != a), a, b)"
    ),
    CallView(Op.SELECT, ("a", "b", "x", "y"), "a < b ? x : y", "BLEND({kind}, {bits}, a < b, x, y)"),
    CallView(Op.EXP, ("a",), "exp{suffix}(a)"),
    CallView(Op.TANH, ("a",), "tanh{suffix}(a)"),
    CallView(Op.LOG, ("a",), "log{suffix}(a)"),
    CallView(Op.POW, ("a", "b"), "pow{suffix}(a, b)"),
    CallView(Op.ATAN2, ("a", "b"), "atan2{suffix}(a, b)"),
)

CALLS = {call.op: call for call in _ALL}


def call_views(calls: frozenset[Op]) -> tuple[CallView, ...]:
    """Return the C code of the given operations, in the order of the table."""
    return tuple(call for op, call in CALLS.items() if op in calls)
