"""Springs and further friction of a fit, from the tables [[springs]] and [friction] of a log description. Each of their
unknown values, such as a stiffness, adds one column to the linear least-squares problem."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.columns.effect import Content, Effect, Motion, Spring, Unknown, joints_of
from psdmc.calibration.columns.kinds import KINDS
from psdmc.calibration.logs.foreign_bytes import quoted
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.toml_tables import TomlTable, is_number, require_none, shown
from psdmc.friction.law import At, Law, Term
from psdmc.friction.own import laws_of, read_law
from psdmc.friction.terms import KEYS, OPTIONAL
from psdmc.robot.mechanism import Mechanism


@dataclass(frozen=True, slots=True, eq=False)
class Rubbing:
    """The friction of some joints: one contribution to the motor torques that a fit predicts, with unknown values.

    terms     terms of friction laws, each with the index of its joint
    unknowns  the unknown values of all terms, term after term
    """

    terms: tuple[tuple[int, Term], ...]
    unknowns: tuple[Unknown, ...]

    @property
    def by_load(self) -> bool:
        return any("load" in term.reads for _, term in self.terms)

    def columns(self, motion: Motion) -> Array:
        load = np.zeros_like(motion.speed) if motion.load is None else motion.load
        sign = np.tanh(motion.speed / motion.sign_speed)
        each = []
        for joint, term in self.terms:
            at = At(*(part[:, joint] for part in (motion.place, motion.speed, sign, load)))
            each += [(joint, column) for column in term.columns(at)]
        found = np.zeros((*motion.speed.shape, len(each)))
        for k, (joint, column) in enumerate(each):
            found[:, joint, k] = column
        return found if motion.onto is None else np.einsum("tmk,mj->tjk", found, motion.onto)


def rubbing(terms: Sequence[tuple[int, Term]], chain: Mechanism) -> Rubbing:
    """Return the friction of some joints as one contribution to the motor torques that a fit predicts.

    terms  terms of friction laws, such as Coulomb friction, each with the index of its joint
    """
    unknowns = [
        Unknown(chain.v_names[joint], name, unit, value.low >= 0.0, value.within, value.start)
        for joint, term in terms
        for name, unit, value in zip(
            term.names, term.units(chain.leading_joints[joint].type.effort_unit), term.law.values, strict=True
        )
    ]
    return Rubbing(tuple(terms), tuple(unknowns))


MOST_SPRINGS = 50
HINT = "docs/how-to/springs-and-friction.md describes these tables"


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """The effects on torques, such as springs, that a fit has in addition to rigid bodies and plain joint friction.

    effects        the effects, each with unknown values
    content        the tables of the log description from which the effects were read, as plain values
    plain_offsets  False: the plain friction of joints has no constant torques, because some joints have one among these
                   effects, or no joint has one
    """

    effects: tuple[Effect, ...] = ()
    content: Content = field(default_factory=dict)
    plain_offsets: bool = True

    def __len__(self) -> int:
        return len(self.unknowns)

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        return tuple(unknown for effect in self.effects for unknown in effect.unknowns)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the values, for messages."""
        return tuple(f"{unknown.name} of {unknown.owner}" for unknown in self.unknowns)

    @property
    def of_springs(self) -> NDArray[np.bool_]:
        """Return, for each of the m unknown values, whether it belongs to a spring. The other values belong to joints."""
        own = [[isinstance(effect, Spring)] * len(effect.unknowns) for effect in self.effects]
        return np.array([is_own for each in own for is_own in each], dtype=bool)

    @property
    def by_load(self) -> bool:
        return any(effect.by_load for effect in self.effects)

    @property
    def never_negative(self) -> NDArray[np.bool_]:
        return np.array([unknown.never_negative for unknown in self.unknowns], dtype=bool)

    @property
    def start(self) -> Array:
        """Return the m values that the unknowns keep if the data do not determine them."""
        return np.array([unknown.start for unknown in self.unknowns])

    def values(self, motion: Motion) -> Array:
        """Return the motor torques per unit of each unknown value, before any filter: (N samples, n joints, m values)."""
        if not self.effects:
            return np.zeros((*motion.q.shape, 0))
        return np.concatenate([effect.columns(motion) for effect in self.effects], axis=2)

    def without_load(self) -> Columns:
        """Return the effects without those whose friction depends on the torque of the rigid bodies."""
        kept = tuple(effect for effect in self.effects if not effect.by_load)
        return replace(self, effects=kept)


def read_columns(
    content: Mapping[str, Any],
    chain: Mechanism,
    where: str = "description",
    offsets: bool = True,
    folder: Path | None = None,
) -> Columns:
    """Return springs and further friction from the tables `springs` and `friction` of a log description. Other tables
    are ignored.

    where    name of the log description, for messages
    offsets  whether plain friction has a constant torque for each joint, unless the tables say otherwise
    folder   folder of the Python files with users' own friction laws; None: no such file is run, for example when the
             tables come from a model file

    Raises InputError with the first faults.
    """
    faults: list[str] = []
    springs = _springs(content.get("springs", []), chain, faults)
    rubs, friction = _friction(content.get("friction", {}), chain, offsets, folder, faults)
    require_none(faults, where, HINT)
    kept = {"springs": content.get("springs"), "friction": friction}
    plain = friction.get(OPTIONAL.name, True) is True
    return Columns((*springs, *rubs), {key: value for key, value in kept.items() if value}, plain)


def _springs(value: object, chain: Mechanism, faults: list[str]) -> tuple[Effect, ...]:
    if not isinstance(value, list) or len(value) > MOST_SPRINGS:
        faults.append(f"springs: found {shown(value)}, expected [[springs]], at most {MOST_SPRINGS}")
        return ()
    found, names = list[Effect](), list[str]()
    for k, entry in enumerate(value, start=1):
        own: list[str] = []
        said = entry.get("kind") if isinstance(entry, dict) else None
        kind = KINDS.get(said) if isinstance(said, str) else None
        keys = kind.keys if kind else sorted({key for one in KINDS.values() for key in one.keys})
        table = TomlTable(entry, f"spring {k}", ("kind", "name", *keys), own)
        if isinstance(entry, dict):
            table.word("kind", tuple(KINDS))
            names.append(table.text("name"))
        found += kind.read(table, chain) if kind else ()
        faults += own
    twice = sorted({quoted(name) for name in names if name and names.count(name) > 1})
    if twice:
        faults.append(f"springs: name {', '.join(twice)} twice")
    return tuple(found)


def _friction(
    value: object, chain: Mechanism, offsets: bool, folder: Path | None, faults: list[str]
) -> tuple[tuple[Effect, ...], Content]:
    """Return what the key `friction` of a log description adds to the motor torques. Also return the table of `friction`,
    completed with offsets and the laws themselves. A text or a list of texts names users' own laws, for all joints."""
    if isinstance(value, str) or (
        isinstance(value, list) and value and all(isinstance(x, str) for x in value)
    ):
        value = {"laws": value if isinstance(value, list) else [value]}
    given = value.get("laws", []) if isinstance(value, dict) else []
    data = _own_laws(given, folder, faults)
    own = laws_of(data)
    laws = KEYS | own
    content = dict(TomlTable(value, "friction", (*laws, "laws"), faults).content)
    content |= {name: True for name in own if name not in content}
    content = _with_offsets(content, laws, chain, offsets) | ({"laws": data} if data else {})
    table = TomlTable(content, "friction", (*laws, "laws"), [])
    table.faults = faults
    found = [_terms(law, table, chain) for name, law in laws.items() if table.has(name)]
    return tuple(rubbing(terms, chain) for terms in found if terms), content


def _own_laws(given: object, folder: Path | None, faults: list[str]) -> list[Any]:
    """The plain values of users' own laws: of their files, or as a model file holds them."""
    if not isinstance(given, list):
        faults.append(f"friction: laws: found {shown(given)}, expected a list of Python files")
        return []
    odd = [shown(item) for item in given if not isinstance(item, dict) and not str(item).endswith(".py")]
    files = [item for item in given if isinstance(item, str)]
    if odd or (files and folder is None):
        faults.append(
            f"friction: found {[*odd, *map(shown, files)][0]}, expected a friction law's Python file"
        )
        return []
    data = [read_law(folder / item) if folder and isinstance(item, str) else item for item in given]
    try:
        laws_of(data)
    except ValueError as error:
        faults.append(f"friction: laws: {error}")
        return []
    return data


def _terms(law: Law, table: TomlTable, chain: Mechanism) -> list[tuple[int, Term]]:
    """Read what [friction] says of a law: which joints have it, and with which numbers."""
    value, where, number = table.content[law.name], f"{table.where}: {law.name}", law.number
    if number is None:
        joints = joints_of(value, where, chain, table.faults)
        everyone_s = law is OPTIONAL and isinstance(value, bool)
        return [] if everyone_s else [(k, Term(law)) for k in joints]
    own = TomlTable(value, where, (number.key, "joints"), table.faults)
    numbers = own.items(number.key)
    if not 0 < len(numbers) <= number.most or not all(
        is_number(v) and number.low <= v <= number.high for v in numbers
    ):
        own.faults.append(
            f"{where}: {number.key}: found {shown(own.content.get(number.key, []))}, expected 1 to {number.most} numbers "
            f"from {number.low:g} to {number.high:g} {number.unit}"
        )
        return []
    terms = [Term(law, float(v)) for v in numbers]
    if len({term.names for term in terms}) < len(terms):
        own.faults.append(f"{where}: {number.key}: one of them twice")
    joints = joints_of(own.content.get("joints", True), f"{where}: joints", chain, table.faults)
    return [(k, term) for k in joints for term in terms]


def _with_offsets(
    content: Content, laws: Mapping[str, Law], chain: Mechanism, offsets: bool
) -> dict[str, Any]:
    """Add an offset to each joint that has no law instead of one, if the table speaks of no offsets. An asymmetry and an
    offset differ near rest only. Offsets of all joints that plain friction has not are listed."""
    key = OPTIONAL.name
    said = content.get(key)
    if said is True and not offsets:
        return {**content, key: list(chain.v_names)}
    instead = [content[name] for name, law in laws.items() if law.instead == key and content.get(name)]
    instead = [value for value in instead if isinstance(value, bool | list)]
    if said is not None or not offsets or not instead:
        return dict(content)
    lacking = [name for value in instead for name in (chain.v_names if isinstance(value, bool) else value)]
    return {**content, key: [name for name in chain.v_names if name not in lacking]}
