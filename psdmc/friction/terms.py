"""Functions that find the friction term for a name in files and options, such as 'viscous^0.5'. Of the law with a state
they make the PROGRAMs (lists of operations) of one joint."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from psdmc.friction.law import At, Law, Term
from psdmc.friction.laws import LAWS
from psdmc.program.program import Program, Slot
from psdmc.program.trace import Tracer

WORDS = tuple(law for law in LAWS.values() if law.word)
"""Laws that are terms of every joint: words of --friction."""
KEYS = {law.name: law for law in LAWS.values() if law.key}
"""Laws of some joints: keys of [friction]."""
WITH_STATE = {law.name: law for law in LAWS.values() if law.state is not None}
"""Laws of friction runs of single joints, one of which is a joint's whole friction."""

_ALWAYS = LAWS["coulomb"]
_GROWING = LAWS["viscous"]
OPTIONAL = LAWS["offset"]
"""A term of every joint, which [friction] can give to some joints only."""
EXAMPLE = ",".join(law.name for law in (_ALWAYS, _GROWING, OPTIONAL))
"""Words of --friction."""


def every_joint_s(exponents: Iterable[float], offset: bool) -> tuple[Term, ...]:
    """Return the friction terms that every joint has in a linear fit: Coulomb friction, and viscous friction with each
    of the given exponents.

    offset  whether each joint has a constant torque, too

    Raises ValueError if an exponent is out of range.
    """
    growing = (Term(_GROWING, float(d)) for d in exponents)
    return (Term(_ALWAYS), *growing, *((Term(OPTIONAL),) if offset else ()))


def expected_words() -> str:
    """Return the words that the option --friction accepts, as text for messages and documents."""
    growing, number = _GROWING, _GROWING.number
    assert number is not None
    assert number.usual is not None
    return (
        f"{_ALWAYS.name}, {growing.name}, {growing.name}^EXPONENT (above {number.low:g}, to {number.high:g}), "
        f"{OPTIONAL.name}"
    )


def options_of(words: Sequence[str]) -> tuple[tuple[float, ...], bool] | str:
    """Read the words of the option --friction. Return the exponents of viscous friction, and whether joints have a
    constant torque. Return a text that describes the fault if a word is wrong."""
    number = _GROWING.number
    assert number is not None
    terms = [
        found and found[0] for found in (named(word, {law.name: law for law in WORDS}) for word in words)
    ]
    for word, term in zip(words, terms, strict=True):
        if term is None or term.number == number.low:
            return f"found {word!r}, expected {expected_words()}"
    exponents = [term.number for term in terms if term is not None and term.number is not None]
    if _ALWAYS.name not in words:
        return f"no {_ALWAYS.name}, expected it among the terms: it is always fitted"
    if len(set(words)) < len(words) or len(set(exponents)) < len(exponents):
        return "a term twice, expected each once"
    if len(exponents) > number.most:
        return f"{len(exponents)} {_GROWING.name} terms, expected at most {number.most}"
    if exponents and number.usual not in exponents:
        return f"{_GROWING.name}^EXPONENT without {_GROWING.name}, expected both"
    return tuple(sorted(exponents, key=lambda d: (d != number.usual, d))), OPTIONAL.name in words


def named(name: str, laws: Mapping[str, Law]) -> tuple[Term, int] | None:
    """Return the friction term to which the value of this name belongs, and the position of the value among the term's
    values. Return None if the value belongs to no law that is linear in its values."""
    for law in laws.values():
        if law.state is not None:
            continue
        for place, value in enumerate(law.values):
            if law.number is None:
                if value.name == name:
                    return Term(law), place
                continue
            number = value.number_in(name, law.number.usual)
            if number is not None and law.number.low <= number <= law.number.high:
                return Term(law, number), place
    return None


def with_present_names(
    rows: Sequence[dict[str, Any]], exponents: Sequence[float]
) -> Sequence[dict[str, Any]]:
    """Return the friction values of an older model file with the names that psdmc uses now, which contain exponents.

    In files of psdmc 0.1 the first viscous term has a name without an exponent, whatever its exponent is.

    rows  one mapping per friction value, with its name and unit
    """
    first = Term(_GROWING, float(exponents[0])) if exponents else None
    if first is None or first.names[0] in [row.get("name") for row in rows]:
        return rows
    number = _GROWING.number
    assert number is not None
    usual = Term(_GROWING, number.usual)
    units = {usual.units(effort)[0]: first.units(effort)[0] for effort in ("N m", "N")}
    renamed = {usual.names[0]: first.names[0], f"{usual.names[0]}^{number.usual:g}": usual.names[0]}
    return [
        row | {"name": renamed[row["name"]], "unit": units.get(str(row.get("unit", "")), row.get("unit", ""))}
        if str(row.get("name")) in renamed
        else row
        for row in rows
    ]


(STATE_LAW,) = WITH_STATE.values()
"""The one law with a state: what the friction runs of a campaign are fitted with."""


# PROGRAMs of the law with a state


def state_programs(law: Law) -> dict[str, tuple[Program, tuple[str, ...]]]:
    """Return the PROGRAMs (lists of operations) 'step', 'pieces' and 'torque' of a friction law, by name. Each comes
    with the names of its inputs, apart from the law's fitted values p.

    'step' computes the next state, 'pieces' the number of additional steps, 'torque' the friction torque. Each PROGRAM
    has one output, `out`.
    """
    state = law.state
    assert state is not None
    return {
        "step": _traced(law, state.step, ("v0", "v1", "z", "dt")),
        "pieces": _traced(law, state.pieces, ("v0", "v1")),
        "torque": _traced(law, lambda p, v, z: law.torque(p, At(v=v, z=z)), ("v", "z")),
    }


def _traced(
    law: Law, function: Callable[..., Any], names: tuple[str, ...]
) -> tuple[Program, tuple[str, ...]]:
    tracer = Tracer()
    p = tracer.symbols("p", len(law.values))
    value = function(p, *(tracer.symbol(Slot(name, 0)) for name in names))
    return tracer.finish([(Slot("out", 0), value)]), names
