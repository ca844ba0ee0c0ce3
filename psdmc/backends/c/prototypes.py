"""C signatures of the generated functions. The header and the definitions use these signatures, and so do the
declarations for the Python package cffi."""

from __future__ import annotations

from dataclasses import dataclass

from psdmc.program.signature import Signature


@dataclass(frozen=True, slots=True)
class Variant:
    """One variant of a generated function: for one state or for many, with parameters compiled in or at run time."""

    suffix: str
    is_batch: bool
    theta: bool


SINGLE = Variant("", False, False)
BATCH = Variant("_batch", True, False)
BATCH_SOA = Variant("_batch_soa", True, False)
THETA = Variant("_theta", False, True)
THETA_BATCH = Variant("_theta_batch", True, True)

BAKED = (SINGLE, BATCH, BATCH_SOA)
AT_RUN_TIME = (THETA, THETA_BATCH)


@dataclass(frozen=True, slots=True)
class Prototype:
    """A C function's type: `returns symbol(arguments)`."""

    returns: str
    symbol: str
    arguments: tuple[str, ...]

    @property
    def text(self) -> str:
        return f"{self.returns} {self.symbol}({', '.join(self.arguments)})"


def prototype(function: Signature, variant: Variant, robot: str, real: str) -> Prototype:
    """The signature of `robot`_`function``variant` in C."""
    inputs = (*(q.name for q in function.inputs), *(("theta_b",) if variant.theta else ()))
    outputs = (f"{real} *{q.name}" for q in function.outputs)
    arguments = (*(f"const {real} *{name}" for name in inputs), *outputs)
    if variant.is_batch:
        arguments = ("size_t count", *arguments)
    return Prototype(_returns(function, variant), f"{robot}_{function.name}{variant.suffix}", arguments)


def payload_prototypes(robot: str, real: str) -> tuple[Prototype, Prototype]:
    """Return the signatures of the two functions that add a load to theta_b (the base parameters). One function is for
    a load at the tip, the other for a load at a frame with a given number."""
    load = (f"{real} mass", f"const {real} *com", f"const {real} *inertia", f"{real} *theta_b")
    return (
        Prototype("void", f"{robot}_add_payload", load),
        Prototype("int", f"{robot}_add_payload_at", ("size_t frame", *load)),
    )


def bodies_prototype(robot: str, real: str) -> Prototype:
    """Return the signature of the function that computes theta_b (the base parameters) from the masses, centres of mass
    and inertias of all bodies."""
    given = tuple(f"const {real} *{name}" for name in ("masses", "coms", "inertias"))
    return Prototype("void", f"{robot}_theta_from_bodies", (*given, f"{real} *theta_b"))


def friction_prototype(robot: str, real: str, by_position: bool) -> Prototype:
    """The function of the joints' friction."""
    given = ("q", "qd") if by_position else ("qd",)
    arguments = (*(f"const {real} *{name}" for name in given), f"{real} *tau_f")
    return Prototype("void", f"{robot}_friction", arguments)


def _returns(function: Signature, variant: Variant) -> str:
    """C's return type. A function that can fail returns which entry failed (one state), or which row (many)."""
    if not function.factorises:
        return "void"
    return "size_t" if variant.is_batch else "int"
