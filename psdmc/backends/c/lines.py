"""Statements of a generated C function's body, and the body that they form."""

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
    """A statement that reads an input before the steps of a section; a uniform input is the same for all states."""

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
    """A C statement `const <V or real> name = text;`, which gives a name to a value."""

    name: str
    text: str
    uniform: bool

    @property
    def line(self) -> str:
        return f"const {'real' if self.uniform else 'V'} {self.name} = {self.text}"


@dataclass(frozen=True, slots=True)
class Store:
    """A C statement `vector[index] = text`. A uniform text must be spread over the lanes first; `macro` performs the
    store."""

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
    """A statement that sets `count` consecutive outputs to zero, in whole groups if the vector is stored in groups."""

    vector: str
    first: int
    count: int

    @property
    def line(self) -> str:
        return f"STORE_ZEROS({self.vector}, {self.first}, {self.count})"


@dataclass(frozen=True, slots=True)
class Cleared:
    """A statement that sets `count` consecutive outputs to zero in code for one state; code for SIMD lanes stores each
    alone."""

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
    """A C statement `vector[index ...] = texts` that stores a group of outputs at once, for the variant that writes
    rows. Other variants store these outputs one by one."""

    vector: str
    index: int
    texts: tuple[str, ...]

    @property
    def line(self) -> str:
        return f"STORE_GROUP({self.vector}, {self.index}, {', '.join(self.texts)})"


Line = Step | Store | Zeros | Cleared | GroupStore | Entry | Multiplication


@dataclass(frozen=True, slots=True)
class Angle:
    """One angle of a group, and the C names of its sine and cosine. None: not needed."""

    text: str
    sine: str | None
    cosine: str | None


@dataclass(frozen=True, slots=True)
class Section:
    """A part of a generated body: loads, steps, then the sines and cosines of the angles that these steps compute.

    Inputs that no angle needs are loaded in the last section, after all sines, so that they need not be kept while libm
    is called. Stores come with the last steps, after all loads: an output may overwrite an input.
    """

    loads: tuple[Load, ...]
    steps: tuple[Line, ...]
    angles: tuple[Angle, ...]
    number: int


@dataclass(frozen=True, slots=True)
class Body:
    """The body of a generated C function, ready to print.

    unused    vectors of the signature that the PROGRAM never reads
    products  matrix products after all other statements
    calls     operations that are macros
    parts     if the body is long, the functions that compute it, one after the other; it then has no sections
    kept      declarations of the vectors that pass values from part to part
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
    """A static C function that computes one part of a long body.

    parameters  C declarations of its parameters
    arguments   C text of the arguments in its call
    direct      outputs that are rows in the variant that writes rows
    """

    parameters: tuple[str, ...]
    arguments: tuple[str, ...]
    direct: tuple[str, ...]
    body: Body
