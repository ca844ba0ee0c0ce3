"""The statements of which the body of a generated C function consists, and the classes that hold them."""

from __future__ import annotations

from dataclasses import dataclass

from psdmc.backends.c.products import Entry, Multiplication
from psdmc.program.program import Op, Slot

KEPT, KEPT_REALS = "kept", "kept_reals"
"""Vectors between the parts of a long body: of values, and of those that are the same for all states."""

BETWEEN = frozenset({KEPT, KEPT_REALS})


def spread(text: str, uniform: bool) -> str:
    """The text as a `V`."""
    return f"SPLAT({text})" if uniform else text


@dataclass(frozen=True, slots=True)
class Load:
    """A statement that reads one entry of an input vector. A uniform entry is equal for all states of a batch."""

    name: str
    vector: str
    index: int
    uniform: bool

    @property
    def line(self) -> str:
        if self.uniform:
            return f"const real {self.name} = {self.vector}[{self.index}]"
        return f"const V {self.name} = LOAD({self.vector}, {self.index})"


@dataclass(frozen=True, slots=True)
class Step:
    """A C statement `const V name = text;` or `const real name = text;`, which stores the value of an expression in a C
    variable. V is a real number or a SIMD vector. If `uniform`, the value is equal for all states of a batch and has
    the type real."""

    name: str
    text: str
    uniform: bool

    @property
    def line(self) -> str:
        return f"const {'real' if self.uniform else 'V'} {self.name} = {self.text}"


@dataclass(frozen=True, slots=True)
class Store:
    """A C statement `vector[index] = text`, written as a call of `macro`. If `uniform`, the value is equal for all
    states of a batch, and is copied to all SIMD lanes first."""

    vector: str
    index: int
    text: str
    uniform: bool
    macro: str = "STORE"

    @property
    def line(self) -> str:
        if self.vector == KEPT_REALS:
            return f"{self.vector}[{self.index}] = {self.text}"
        text = spread(self.text, self.uniform)
        if self.vector == KEPT:
            return f"{self.vector}[{self.index}] = {text}"
        return f"{self.macro}({self.vector}, {self.index}, {text})"


@dataclass(frozen=True, slots=True)
class Zeros:
    """A statement that sets `count` consecutive outputs to zero. If the vector is stored in groups of four, zeros are
    stored in groups of four, too."""

    vector: str
    first: int
    count: int

    @property
    def line(self) -> str:
        return f"STORE_ZEROS({self.vector}, {self.first}, {self.count})"


@dataclass(frozen=True, slots=True)
class Cleared:
    """A statement that sets `count` consecutive outputs to zero in code for one state. Code for a batch, with one state
    per SIMD lane, stores each zero alone."""

    vector: str
    first: int
    count: int

    @property
    def line(self) -> str:
        return f"CLEAR({self.vector}, {self.first}, {self.count})"

    @property
    def slots(self) -> tuple[Slot, ...]:
        return tuple(Slot(self.vector, self.first + k) for k in range(self.count))


@dataclass(frozen=True, slots=True)
class GroupStore:
    """One C statement that stores four neighbouring outputs, `vector[index]` to `vector[index + 3]`.

    The statement is a call of the macro STORE_GROUP with the C texts of the four values. It takes effect in code that
    computes one state per SIMD lane and writes each state into a row of the output array. In all other code, the
    macro does nothing, and one statement per output (class Store) stores the values.
    """

    vector: str
    index: int
    texts: tuple[str, ...]

    @property
    def line(self) -> str:
        return f"STORE_GROUP({self.vector}, {self.index}, {', '.join(self.texts)})"


Line = Step | Store | Zeros | Cleared | GroupStore | Entry | Multiplication


@dataclass(frozen=True, slots=True)
class Angle:
    """C text of one angle, and the C variables for its sine and cosine; None if the value is not needed."""

    text: str
    sine: str | None
    cosine: str | None


@dataclass(frozen=True, slots=True)
class Section:
    """A part of a generated function body: statements that read inputs, statements that compute, and then the sines and
    cosines of angles that were computed.

    Inputs that no angle depends on are read in the last section. Such inputs need not be kept in registers while the C
    library computes sines. Outputs are stored after all inputs are read, because an output array may be one of the
    input arrays.
    """

    loads: tuple[Load, ...]
    steps: tuple[Line, ...]
    angles: tuple[Angle, ...]
    number: int


@dataclass(frozen=True, slots=True)
class Body:
    """The body of a generated C function, ready for the template.

    sections  the statements
    unused    inputs that the body never reads
    products  matrix products after all other statements
    calls     operations that are written as C macros
    parts     if the body is long, the C functions that compute it one after the other; `sections` is then empty
    kept      C declarations of the arrays that pass values from one part to the next
    """

    sections: tuple[Section, ...]
    unused: tuple[str, ...]
    products: tuple[Multiplication, ...] = ()
    calls: frozenset[Op] = frozenset()
    parts: tuple[Part, ...] = ()
    kept: tuple[str, ...] = ()

    @property
    def has_clears(self) -> bool:
        """Whether runs of zeros are cleared."""
        return any(isinstance(line, Cleared) for section in self.sections for line in section.steps)


@dataclass(frozen=True, slots=True)
class Part:
    """A static C function that computes one part of a long function body.

    parameters  C declarations of its parameters
    arguments   C text of the arguments in its call
    direct      outputs for which the batch variant passes rows of the output array
    body        C statements
    """

    parameters: tuple[str, ...]
    arguments: tuple[str, ...]
    direct: tuple[str, ...]
    body: Body
