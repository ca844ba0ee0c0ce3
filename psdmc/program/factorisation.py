"""The symmetric matrices that functions factorise: which entries are zero, what a pivot that is not positive means, and
how the caller is informed.

A matrix A = L^T D L is positive definite if all pivots, the entries of D, are positive. C returns the number of the
first pivot that is not; Python gives NaN or an error.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum


class Structure(StrEnum):
    """Which entries of a symmetric matrix are zero at every state.

    DENSE   no entry is zero at every state
    LIMBS   limbs on a core: entries of two joints are zero if neither joint carries the other. Elimination from the last
            row up keeps these zeros (Featherstone 2008, section 6.5)
    BLOCKS  square blocks on the diagonal, each factorised by itself; the other entries are zero
    """

    DENSE = "dense"
    LIMBS = "limbs on a core"
    BLOCKS = "blocks"


@dataclass(frozen=True, slots=True)
class SymmetricMatrix:
    """A symmetric matrix that a function factorises. If it is not positive definite, the function has no result.

    name       the matrix's name in sentences
    structure  which entries are zero
    axes       lengths of the vector of pivots, or of signs with one for each block
    number     in words, the number from 0 of the pivot or sign that is not positive; C returns 1 more
    failure    the reason, in Python's documentation: words that follow "If "
    unit, powers  of the pivots, as Quantity has them
    error      one line that Python raises as an error, in which {axis} stands for the name of an entry of that axis (such
               as {frames}) and {input} for a scalar input; empty: the results of such a state are NaN
    hint       the remedy that is printed with the error
    """

    name: str
    structure: Structure
    axes: tuple[str, ...]
    number: str
    failure: str
    error: str = ""
    hint: str = ""
    unit: str = "1"
    powers: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if not self.axes or (len(self.axes) > 1 and self.structure is not Structure.BLOCKS):
            raise ValueError(f"{self.name}: {self.structure} with axes {self.axes}")

    def in_blocks(self, count: str, number: str, failure: str) -> SymmetricMatrix:
        """Return several matrices of this kind, one after the other, as one block-diagonal matrix."""
        return replace(
            self,
            structure=Structure.BLOCKS,
            axes=(count, *self.axes),
            powers=(0, *self.powers) if self.powers else (),
            number=number,
            failure=failure,
        )
