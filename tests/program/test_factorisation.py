"""Named matrices: the numbers of their pivots, and what is said of them."""

from __future__ import annotations

import pytest

from psdmc.functions import SIGNATURES
from psdmc.program.signature import Q, Quantity, Signature, Sizes, Structure, SymmetricMatrix

SIZES = Sizes(n=7, nq=8, nv=7, l=40, frames=3)
M = SymmetricMatrix("M", Structure.LIMBS, ("nv",), "the joint at which M fails", "M fails")


def with_matrices(*matrices: SymmetricMatrix) -> Signature:
    return Signature("trial", 1000, "", (Q,), (Quantity("x"),), theta=True, factorises=matrices)


def test_pivots_of_several_matrices_are_numbered_one_after_the_other() -> None:
    six = SymmetricMatrix("A", Structure.BLOCKS, ("frames", "6"), "6 k + r", "A fails")
    sign = SymmetricMatrix("B", Structure.DENSE, ("1",), "0 if B fails", "B fails")
    function = with_matrices(M, six, sign)

    assert function.pivots is not None
    assert SIZES.size(function.pivots) == 7 + 18 + 1
    assert function.pivot_numbers == (
        "the joint at which M fails",
        "nv + 6 k + r",
        "nv + frames 6 + 0 if B fails",
    )


def test_blocks_of_a_matrix_keep_what_is_not_given() -> None:
    four = M.in_blocks("4", number="stage", failure="a stage fails")

    assert (four.name, four.structure, four.axes) == ("M", Structure.BLOCKS, ("4", "nv"))
    assert SIZES.size(with_matrices(four).pivots) == 28
    assert with_matrices().pivots is None


@pytest.mark.parametrize("axes", [(), ("frames", "6")])
def test_a_matrix_that_is_one_has_one_axis(axes: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match="A: dense with axes"):
        SymmetricMatrix("A", Structure.DENSE, axes, "row", "A fails")


def test_lengths_are_words_numbers_and_sums_of_their_products() -> None:
    assert SIZES.shape(("nv", "6", "frames*6", "nv+frames*6+2")) == (7, 6, 18, 27)
    with pytest.raises(ValueError, match="an axis is a number or one of"):
        Quantity("x", ("nv+feet",))


def test_inputs_are_drawn_within_their_bounds() -> None:
    assert Quantity("x", largest=3.0).drawn(-1.0) == -3.0
    mu = Quantity("mu", largest=1.0, least=0.25)
    assert [mu.drawn(share) for share in (-1.0, 0.0, 1.0)] == [0.25, 0.625, 1.0]


def test_python_raises_only_for_matrices_with_an_error() -> None:
    raising = [name for name, signature in SIGNATURES.items() if signature.raises]
    starts = (
        "operational_space_inertia",
        "contact_space_inertia",
        "contact_inverse",
        "constrained",
        "impulse",
        "passive_motion",
        "assemble",
        "loop_inverse_dynamics",
    )
    assert raising == [name for name in SIGNATURES if name.startswith(starts)]
    assert SIGNATURES["forward_dynamics"].factorises
