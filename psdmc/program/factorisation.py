"""The symmetric matrices that functions factorise: which entries are zero, what a pivot means that is not positive, and
how the caller is informed.

A matrix A = L^T D L is positive definite if all pivots, the entries of D, are positive. If one is not, the generated C
function returns the number of the first such pivot, from 1. Python gives NaN or an error.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum


class Structure(StrEnum):
    """The entries of a symmetric matrix that are zero at every state.

    DENSE   no entry is zero at every state
    LIMBS   branches (limbs) on a common body: the entry of two joints is zero if neither joint carries the other.
            Elimination from the last row up keeps these zeros (Featherstone 2008, section 6.5)
    BLOCKS  square blocks on the diagonal, each factorised separately; the other entries are zero
    """

    DENSE = "dense"
    LIMBS = "limbs on a core"
    BLOCKS = "blocks"


@dataclass(frozen=True, slots=True)
class SymmetricMatrix:
    """A symmetric matrix that a function factorises. If the matrix is not positive definite, the function has no
    result.

    name       the matrix's name in sentences
    structure  which entries are zero
    axes       shape of the array of pivots, in words such as nv; for blocks, that of the array with one sign per block
    number     words for the number, from 0, of the pivot or sign that is not positive; C returns this number plus 1
    failure    the reason, in Python's documentation: words that follow "if "; several reasons are one line each
    unit       unit of the pivots
    powers     how the unit depends on the axes, as in Quantity
    error      one line that Python raises as an error; {axis} stands for the name of an entry of that axis (such as
               {frames}), and {input} for a scalar input. Empty: the results of such a state are NaN
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
        """Return the block-diagonal matrix whose blocks are several matrices like this one.

        count            name of the number of blocks
        number, failure  as in SymmetricMatrix, for the new matrix
        """
        return replace(
            self,
            structure=Structure.BLOCKS,
            axes=(count, *self.axes),
            powers=(0, *self.powers) if self.powers else (),
            number=number,
            failure=failure,
        )
