"""Costs of arithmetic operations on a processor. psdmc uses them to choose among equivalent programs."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Latency:
    """Number of processor cycles until the result of an operation can be used. Only the order of magnitude matters.

    fused   for a multiply-add; if the processor has none, for a product and a sum
    sincos  for the sine and cosine that psdmc writes into the code
    choice  for a comparison and the selection of a value by its result
    call    for an elementary function of the C library
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
    """Costs and thresholds by which psdmc chooses among equivalent programs. The unit of a weight is the cost of one
    addition. A lane is one element of a SIMD vector; code for lanes computes one state per lane.

    latency             processor cycles per operation, for the order of additions (fuse_sums)
    div, neg            weight of a division, of a change of sign
    fused               weight that a multiply-add saves compared with a product and a sum
    sincos              weight of one sincos (sine and cosine written into the code), which computes `angles_per_sincos`
                        angles
    choice              weight of a minimum, maximum, magnitude or selection
    call                weight of an elementary function of the C library; code for lanes calls it once per state
    angle               weight of each further angle in a sincos: to load it and to extract sine and cosine
    angles_per_sincos   angles per sincos in code for one state; 1 if the target has no vectors
    registers           number of registers for floating-point numbers; used if `spills_wait`
    spills_wait         whether a spilled value (without a register) delays the code, as on processors that run one
                        instruction after the other
    crowded             code for lanes uses the operation order of the code for one state, unless that order keeps this
                        many times more values alive
    worth_two_bodies    code for lanes gets a function body of its own if it is this factor cheaper
    worth_sharing       code for one state uses the arithmetic of the code for lanes if it costs at most this factor:
                        then one body is enough
    shared_from         number of additions in a function from which `worth_sharing` is considered
    loops_from          number of rows from which products of square matrices are loops in code for one state
    worth_limbs         equal limbs (such as legs) are computed in parallel lanes if the code is cheaper by at least
                        this factor
    limb_real           weight of moving one input or output of a limb into or out of its lane
    limb_shared         weight of copying one value of the robot's trunk into all lanes
    limb_sum            weight of a sum over the lanes
    longest_of_two      number of additions; a longer function with parameters at run time gets no second body, which
                        would take tens of kilobytes
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
        """Return whether code that computes one state per SIMD lane differs from code for one state."""
        return self.angles_per_sincos > 1
