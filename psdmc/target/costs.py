"""Costs of arithmetic on a machine, for lowering's search and the passes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Latency:
    """Cycles until a result can be used; only their order of magnitude matters.

    fused   of a multiply-add; where there is none, of a product and a sum
    sincos  of the inline sine and cosine
    choice  of a comparison and of what it chooses
    call    of an elementary function of the C library
    """

    load: int
    add: int
    mul: int
    fused: int
    div: int
    neg: int
    sincos: int
    choice: int
    call: int


@dataclass(frozen=True, slots=True)
class Costs:
    """Figures for choosing among equal programs. Weights are in additions.

    latency             for the order of sums (fuse_sums)
    div, neg            weight of a division, of a change of sign
    fused               weight that a multiply-add saves on its product and its sum
    sincos              weight of one inline sincos, which serves `angles_per_sincos` angles
    choice              weight of a minimum, maximum, magnitude or selection
    call                weight of an elementary function of the C library: in lanes one for each state
    angle               weight of each further angle: to put it in and to take sine and cosine out
    angles_per_sincos   in code for one state; 1 where the target has no vectors
    registers           for reals; used where `spills_wait`
    spills_wait         whether a spilled value delays the code (one instruction after the other); other machines hide it
    crowded             lanes take the order for one state unless it keeps this many times more values alive
    worth_two_bodies    lanes get a body of their own where it saves this factor
    worth_sharing       one state takes the lanes' arithmetic where that costs it no more than this factor: one body, and
                        the lanes' sines saved
    shared_from         additions from which that is considered
    loops_from          rows from which products of square matrices behind a PROGRAM are loops in code for one state
    worth_limbs         limbs run in lanes where this saves that factor
    limb_real           weight of bringing one of a limb's inputs into its lane, or an output out of it
    limb_shared         weight of bringing one of the core's values into all lanes
    limb_sum            weight of a sum over the lanes
    longest_of_two      additions; with parameters at run time a longer body is not written twice: it is tens of kilobytes
    """

    latency: Latency
    div: float
    neg: float
    fused: float
    sincos: float
    choice: float
    call: float
    angle: float
    angles_per_sincos: int
    registers: int
    spills_wait: bool
    crowded: float
    worth_two_bodies: float
    worth_sharing: float
    shared_from: float
    longest_of_two: float
    worth_limbs: float
    limb_real: float
    limb_shared: float
    limb_sum: float
    loops_from: int

    @property
    def has_vectors(self) -> bool:
        """Whether code with one state per lane differs from code for one state."""
        return self.angles_per_sincos > 1
