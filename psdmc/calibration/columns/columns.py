"""The extra columns of a fit, from the tables of a description: [[springs]] and [friction]."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.columns.effect import Content, Effect, Motion, Unknown
from psdmc.calibration.columns.kinds import kinds_of
from psdmc.calibration.columns.spring import Spring
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.toml_tables import TomlTable, require_none, shown
from psdmc.calibration.logs.wording import quoted
from psdmc.robot.mechanism import Mechanism

MOST_SPRINGS = 50
HINT = "docs/how-to/springs-and-friction.md describes these tables"


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """The effects of a fit beside rigid bodies and plain friction.

    content        the tables that they were read from, plain values
    plain_offsets  whether plain friction has offsets where it would; False: some joints' are among the effects, or none's
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
        """For messages."""
        return tuple(f"{unknown.name} of {unknown.owner}" for unknown in self.unknowns)

    @property
    def of_springs(self) -> NDArray[np.bool_]:
        """(m,) whether a value is a spring's; the others are joints'."""
        own = [[isinstance(effect, Spring)] * len(effect.unknowns) for effect in self.effects]
        return np.array([is_own for each in own for is_own in each], dtype=bool)

    @property
    def by_load(self) -> bool:
        return any(effect.by_load for effect in self.effects)

    @property
    def never_negative(self) -> NDArray[np.bool_]:
        return np.array([unknown.never_negative for unknown in self.unknowns], dtype=bool)

    def values(self, motion: Motion) -> Array:
        """(N, n, m) motor torque per unit of each unknown, before any filter."""
        if not self.effects:
            return np.zeros((*motion.q.shape, 0))
        return np.concatenate([effect.columns(motion) for effect in self.effects], axis=2)

    def without_load(self) -> Columns:
        """Those that do not depend on the rigid bodies' torque."""
        kept = tuple(effect for effect in self.effects if not effect.by_load)
        return replace(self, effects=kept)


def read_columns(
    content: Mapping[str, Any], chain: Mechanism, where: str = "description", offsets: bool = True
) -> Columns:
    """The columns of a description's tables `springs` and `friction`; other keys are not looked at.

    where    the file, for messages
    offsets  whether plain friction has offsets unless the tables say otherwise

    InputError with the first faults.
    """
    faults: list[str] = []
    springs = _springs(content.get("springs", []), chain, faults)
    rubbing, friction = _friction(content.get("friction", {}), chain, offsets, faults)
    require_none(faults, where, HINT)
    kept = {"springs": content.get("springs"), "friction": friction}
    plain = friction.get("offset", True) is True
    return Columns((*springs, *rubbing), {key: value for key, value in kept.items() if value}, plain)


def _springs(value: object, chain: Mechanism, faults: list[str]) -> tuple[Effect, ...]:
    if not isinstance(value, list) or len(value) > MOST_SPRINGS:
        faults.append(f"springs: found {shown(value)}, expected [[springs]], at most {MOST_SPRINGS}")
        return ()
    kinds, found, names = kinds_of("springs"), [], list[str]()
    for k, entry in enumerate(value, start=1):
        where, own = f"spring {k}", list[str]()
        kind = (
            kinds.get(entry.get("kind", "")) if isinstance(entry, dict) and _is_text(entry, "kind") else None
        )
        keys = (
            "kind",
            "name",
            *(kind.keys if kind else sorted({key for one in kinds.values() for key in one.keys})),
        )
        table = TomlTable(entry, where, keys, own)
        if isinstance(entry, dict):
            table.word("kind", tuple(kinds))
            names.append(table.text("name"))
        found += list(kind.read(table, chain)) if kind else []
        faults += own
    twice = sorted({quoted(name) for name in names if name and names.count(name) > 1})
    if twice:
        faults.append(f"springs: name {', '.join(twice)} twice")
    return tuple(found)


def _is_text(entry: Mapping[str, Any], key: str) -> bool:
    return isinstance(entry.get(key), str)


def _friction(
    value: object, chain: Mechanism, offsets: bool, faults: list[str]
) -> tuple[tuple[Effect, ...], Content]:
    """The effects of [friction], and the table with what it says of offsets."""
    kinds = kinds_of("friction")
    content = TomlTable(value, "friction", tuple(kinds), faults).content
    table = TomlTable(_with_offsets(content, chain, offsets), "friction", tuple(kinds), [])
    table.faults = faults
    effects = [
        effect for name, kind in kinds.items() if table.has(name) for effect in kind.read(table, chain)
    ]
    return tuple(effects), table.content


def _with_offsets(content: Content, chain: Mechanism, offsets: bool) -> dict[str, Any]:
    """Where some joints' friction is asymmetric and the table speaks of no offsets, the other joints have them: an asymmetry
    and an offset differ near rest only. Offsets of all joints that plain friction has not are listed."""
    given, said = content.get("asymmetric"), content.get("offset")
    if said is True and not offsets:
        return {**content, "offset": list(chain.joint_names)}
    if said is not None or not offsets or not given or not isinstance(given, bool | list):
        return dict(content)
    lacking = chain.joint_names if isinstance(given, bool) else given
    return {**content, "offset": [name for name in chain.joint_names if name not in lacking]}
