"""C code of the operations for which C has no operator, such as square roots. The code exists for one state, and for
SIMD vectors with one state or one limb per lane.

In a generated function body, each of these operations is a macro with the name of the operation. The macros are defined
in two headers: square roots, which every compiler has for vectors, in roots.h, and all others in operations.h.
"""

from __future__ import annotations

from dataclasses import dataclass

from psdmc.program.operations import Op, Unit


@dataclass(frozen=True, slots=True)
class CallView:
    """The C code of one operation for which C has no operator.

    parameters  names of the arguments of its macro and its C functions
    one         C expression for one state; FUNCTION(name) becomes the C library's function for float or double
    many        C expression for SIMD vectors; BLEND(mask, x, y) is x in lanes whose mask is set, else y; '': each lane
                is computed alone with `one`
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
        """Return what the macro stands for if the code computes one state."""
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
        """Return the definition of the operation's C macro in code that computes one state per SIMD lane."""
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
        """Return the name of the C function that computes the operation. `kind` says for what: reals (one state), lanes
        (one state per lane) or limbs (one limb per lane)."""
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
    """Return the C code of the given operations, in the order of the table CALLS."""
    return tuple(call for op, call in CALLS.items() if op in calls)
