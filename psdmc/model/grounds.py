"""The reasons of a calibration's verdict: codes with figures, and the table of each code's sentence."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

MOST_LISTED = 4
"""Base parameters that a sentence names; the others are counted."""

Values = Mapping[str, Any]
OrInf = float
"""A standard deviation that the data may not give: infinite, null in files."""


@dataclass(frozen=True, slots=True)
class Ground:
    """One reason of a calibration's verdict.

    code    a key of the table WORDS, by which programs identify the reason
    values  figures for the sentence of this code, by name; NaN if a figure does not exist
    """

    code: str
    values: Values = field(default_factory=dict)

    @property
    def words(self) -> str:
        """Return the reason as a sentence. Raises KeyError, TypeError or ValueError for figures of another code."""
        return WORDS[self.code](self.values)


def listed(names: Sequence[str]) -> str:
    """Join names to a list in words: 'a', 'a and b', 'a, b and c'."""
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def _each(values: Values, form: str, first: int | None = None) -> str:
    """The items of a ground in words, all or the first few of them."""
    words = [form.format(**item) for item in values["items"]]
    if first is None or len(words) <= first:
        return listed(words)
    return f"{', '.join(words[:first])} and {len(words) - first} more"


# Times


@dataclass(frozen=True, slots=True)
class Delay:
    """The time in seconds by which the measured torque in a log comes after the motion.

    value  the delay
    std    standard deviation; infinite if the delay may be still longer than could be tested
    shown  whether the log shows that there is a delay
    """

    log: str
    value: float
    std: OrInf
    shown: bool

    @property
    def size(self) -> str:
        """Return the delay in seconds without its sign, as text, with two digits of the standard deviation."""
        if not math.isfinite(self.std):
            return f"{abs(self.value):.3g}"
        return f"{abs(self.value):.{self._digits}f}"

    @property
    def words(self) -> str:
        spread = f" +- {self.std:.{self._digits}f} s" if math.isfinite(self.std) else " s or more"
        return f"{self.size}{spread} {'later' if self.value > 0 else 'earlier'}"

    @property
    def _digits(self) -> int:
        return min(max(0, 1 - math.floor(math.log10(max(self.std, 1e-6)))), 7)


def _late(values: Values) -> str:
    delay = Delay(values["log"], values["seconds"], values["std"], True)
    columns = "[effort]" if delay.value > 0 else "[position] and [velocity]"
    return (
        f"{delay.log}: the torque is logged {delay.words} than the motion it belongs to: set `delay = {delay.size}` of "
        f"{columns} in a log description (psdmc calibrate --describe), or add it to the delay there"
    )


# Efforts at an extreme


def at_level(joint: str, level: float, unit: str, share: float) -> str:
    """Return words for a joint whose effort (torque or current) stays at one level in a share of the rows in which it
    moves. The unit may be unknown (empty)."""
    return f"{joint} at {f'{level:.4g} {unit}'.rstrip()} in {share:.0%}"


def _at_levels(values: Values) -> str:
    return ", ".join(at_level(**item) for item in values["items"])


# Columns of a log that are not what they say


def cycles(order: Sequence[int]) -> list[list[int]]:
    """Return the cycles of a permutation with more than one element, where order[k] replaces element k."""
    seen: set[int] = set()
    found = []
    for start in range(len(order)):
        cycle = []
        k = start
        while k not in seen:
            seen.add(k)
            cycle.append(k)
            k = order[k]
        if len(cycle) > 1:
            found.append(cycle)
    return found


def exchanges(order: Sequence[int]) -> int:
    """Return the smallest number of exchanges of two elements that make up a permutation."""
    return sum(len(cycle) - 1 for cycle in cycles(order))


def in_words(
    names: Sequence[str],
    order: Sequence[int],
    signs: Sequence[int],
    effort_order: Sequence[int],
    effort_signs: Sequence[int],
) -> str:
    """Return words for the suspicion that columns of a log are swapped or reversed.

    Joint k's position is then signs[k] times column order[k] of the log, and its effort is effort_signs[k] times column
    effort_order[k].
    """
    parts = []
    if order == effort_order:
        parts += _permutation(order, names, "position and effort")
    else:
        parts += _permutation(order, names, "position")
        parts += _permutation(effort_order, names, "effort")
    parts += _signs(signs, effort_signs, names)
    return ", and ".join(parts)


def _permutation(order: Sequence[int], names: Sequence[str], what: str) -> list[str]:
    found = []
    for cycle in cycles(order):
        joints = listed([names[k] for k in cycle])
        word = "swapped" if len(cycle) == 2 else "permuted"
        found.append(f"{joints} look {word} ({what})")
    return found


def _signs(signs: Sequence[int], effort_signs: Sequence[int], names: Sequence[str]) -> list[str]:
    if all(sign < 0 for sign in effort_signs) and all(sign > 0 for sign in signs):
        return ["the effort of every joint has the opposite sign"]
    kinds = {
        "position and effort": [p < 0 and e < 0 for p, e in zip(signs, effort_signs, strict=True)],
        "position": [p < 0 < e for p, e in zip(signs, effort_signs, strict=True)],
        "effort": [e < 0 < p for p, e in zip(signs, effort_signs, strict=True)],
    }
    found = []
    for what, turned in kinds.items():
        joints = [name for name, yes in zip(names, turned, strict=True) if yes]
        if joints:
            verb = "have" if " and " in what or len(joints) > 1 else "has"
            found.append(f"{what} of {listed(joints)} {verb} the opposite sign")
    return found


def _columns(values: Values) -> str:
    said = [in_words(values["joints"], **reading) for reading in values["readings"]]
    explained, logged = values["explained"], values["logged"]
    return f"{', or '.join(said)} (that explains {explained:.0%} of the torque's variation; the log as it is {logged:.0%})"


# What the model lacks


def _lacking(values: Values) -> str:
    named = [
        item["joint"]
        if math.isnan(item["ratio"])
        else f"{item['joint']} ({item['ratio']:.3g} times the sensor noise)"
        for item in values["items"]
    ]
    factor = values["factor"]
    by = "" if math.isnan(factor) else f", by a factor of about {factor:.1f}"
    return (
        f"the model lacks an effect at joint(s) {listed(named)}: the residual is no sensor noise, "
        f"and standard deviations are widened for it{by}"
    )


ERRORS = {
    "zero": "the position of {joint} is logged {size} too {side} (`offset` of [position])",
    "ratio": "the reduction ratio of {joint} is wrong: its position is logged {size} too {side}, its effort {size} too "
    "{other} (`gear_ratio`)",
    "position": "the position of {joint} is logged {size} too {side} (`scale` of [position])",
    "torque": "the effort of {joint} is logged {size} too {side} (`scale` of [effort])",
    "tilt": "the base leans by {size} from the gravity of the robot file (`gravity`)",
}
"""Sentences of errors of a log by kind, with the key that corrects each."""


def _one_error(item: Values) -> str:
    value, std, unit = abs(item["value"]), item["std"], item["unit"]
    size = f"{100 * value:.3g} +- {100 * std:.1g} %" if unit == "1" else f"{value:.2g} +- {std:.1g} {unit}"
    side, other = ("large", "small") if item["value"] > 0 else ("small", "large")
    return ERRORS[item["kind"]].format(joint=item["joint"], size=size, side=side, other=other)


def _log_error(values: Values) -> str:
    items = values["items"]
    return (
        f"the log fits better if {', or '.join(_one_error(item) for item in items)}; that explains "
        f"{items[0]['explains']:.0%} of what the fit leaves at joint {items[0]['felt']}: check, and correct it in a log "
        "description or in the robot file"
    )


def _odd_log(values: Values) -> str:
    return (
        "{log} contradicts the other logs: they predict its torque at joint {joint} with RMSE {rmse:.3g} {unit}, its own "
        "fit with {own:.3g} {unit} (chi-square {statistic:.4g} per degree of freedom): look for another load, friction or "
        "robot; leave it out of the fit".format(**values)
    )


def _logs_disagree(values: Values) -> str:
    return (
        "the {logs} logs contradict each other: the fit of the others predicts {log} at joint {joint} with RMSE "
        "{rmse:.3g} {unit}, its own fit with {own:.3g} {unit} (chi-square {statistic:.4g} per degree of freedom): look for "
        "another load, friction or robot; calibrate each log alone and compare".format(**values)
    )


def _coupling(values: Values) -> str:
    rises = [f"{item['joint']} {item['before']:.3f} to {item['after']:.3f}" for item in values["r2"]]
    which = "its efforts and positions" if values["positions_of_motors"] else "its efforts"
    return (
        "motors seem to drive several joints together, and the log does not say so: "
        f"{_each(values, 'the motor of {motor} moves {joint} by {ratio:.3g} +- {std:.1g} of its own motion')}; if {which} "
        f"are those of such motors, held-out R^2 rises: {', '.join(rises)}; if the robot is built so, write the proposed "
        "[[coupling]] into a log description; psdmc has not applied it"
    )


def _by_step(values: Values) -> str:
    return "{samples} independent samples for {unknowns} unknowns ({step})".format(**values)


OVER_FILE = "measured torque over the torque by the file's parameters"
VISIBLE = "on every joint whose torque the file shows"
SCALES = {1e-3: "kN m (or kN)?", 1e3: "mN m (or mN)?"}
"""Units by the gain that each would give."""

WORDS: Mapping[str, Callable[[Values], str]] = {
    # reasons and doubts
    "said": lambda v: str(v["text"]),  # of a psdmc that kept sentences only
    "saturated": lambda v: (
        f"the effort is cut off at a limit: joint {_at_levels(v)} of the rows in which it moves: record slower motions or "
        "smaller loads, or raise the limit of the drive or the sensor"
    ),
    "perhaps_saturated": lambda v: (
        f"the effort may be cut off at a limit, or this may be friction alone: joint {_at_levels(v)} of its moving rows: "
        "if the drive or sensor has that limit, record again with slower motions"
    ),
    "odd_log": _odd_log,
    "logs_disagree": _logs_disagree,
    "friction_drifts": lambda v: (
        f"friction changes over the {v['seconds']:.3g} s that are fitted of {v['log']}: "
        f"{_each(v, 'joint {joint} by {change:+.3g} +- {std:.1g} {unit} ({share:+.0%})', MOST_LISTED)}: move the robot "
        "until it is warm before you record, or leave out the first part by --warm SECONDS"
    ),
    "late": _late,
    "log_error": _log_error,
    "undescribed_coupling": _coupling,
    "unstated_load": lambda v: (
        f"the robot seems to carry a load of {v['mass']:.3g} +- {v['std']:.1g} kg at its tip that the file does not state: "
        f"the load explains {v['explains']:.0%} of the difference from the file; the calibrated values contain the load"
    ),
    "not_physical": lambda v: f"no mass distribution of a real robot is near the fit ({v['why']})",
    "starved": lambda v: (
        f"{_by_step(v)}: {v['samples'] / v['unknowns']:.1f} each, at least {v['limit']:g} are needed"
    ),
    "few_samples": lambda v: f"{_by_step(v)}: few, {v['limit']:g} each are sound",
    "wrong_gains": lambda v: (
        f"{OVER_FILE}: {_each(v, 'joint {joint} {gain:.3g} +- {std:.1g}')}; expected {v['low']:g} to {v['high']:g}"
    ),
    "odd_gains": lambda v: f"{OVER_FILE}: {_each(v, 'joint {joint} {gain:.3g} +- {std:.1g}')}",
    "wrong_file": lambda v: (
        f"{OVER_FILE}: {_each(v, 'joint {joint} {gain:.3g} +- {std:.1g}')}; the robot file is wrong there, or lacks a load, "
        "but the unit of the log is right: by the parameters that joints share, the logged effort is "
        f"{_each(v, '{scale:.2g} +- {scale_std:.1g}')} times the true one"
    ),
    "unjudged_scale": lambda v: (
        f"the scale of the effort of joint(s) {_each(v, '{joint}')} is not judged: their torque is mostly friction or drive "
        "inertia, and other joints do not show it; a wrong unit or torque constant there would not be noticed: check it"
    ),
    "friction_gives_power": lambda v: (
        f"friction would give power instead of taking it: {_each(v, 'joint {joint} {power:.2g} +- {std:.1g} W')}: "
        "effort and motion have opposite signs there, or belong to different joints"
    ),
    "low_r2": lambda v: (
        f"R^2 on held-out data below {v['limit']:g}: {_each(v, 'joint {joint} {r2:.3g} (RMSE {rmse:.3g} {unit})')}"
    ),
    "nothing_followed": lambda v: (
        "no joint's torque is followed: R^2 on held-out data "
        f"{_each(v, 'joint {joint} {r2:.3g} (RMSE {rmse:.3g} {unit})')}"
    ),
    "low_r2_of_step": lambda v: (
        f"R^2 on held-out data in step {v['step'].lower()}: {_each(v, 'joint {joint} {r2:.3g}')}"
    ),
    "contradicted": lambda v: "the log contradicts the model's joints",
    "sampled_slowly": lambda v: (
        f"sampled at {v['rate']:.3g} Hz and filtered at {v['cutoff']:g} Hz: accelerations of the fastest motion come out up "
        f"to {v['lost']:.0%} too small, and inertias too large; a cut-off of {v['sound']:.2g} Hz or less avoids that"
    ),
    "unlike_limits": lambda v: (
        f"the largest torque is {v['share']:.2g} times the file's effort limit: another unit?"
    ),
    "hardly_moving": lambda v: (
        f"joint(s) {_each(v, '{joint}')} hardly move (under {v['limit']:g} rad/s or m/s RMS): "
        "their friction and drive inertia are not seen"
    ),
    "lacking_effect": _lacking,
    "not_carried_over": lambda v: (
        "the fit does not carry over: RMSE on held-out and on fitted data: "
        f"{_each(v, 'joint {joint} {held_out:.3g} and {fitted:.3g} {unit}')}"
    ),
    "open_parameters": lambda v: (
        f"{len(v['items'])} of {v['count']} base parameters are not fixed by the data: {_each(v, '{name}', MOST_LISTED)} "
        "stay near the file's values, or zero"
    ),
    "known_badly": lambda v: (
        f"{len(v['items'])} base parameter(s) are known badly: "
        f"{_each(v, '{name} ({value:.3g} +- {std:.2g} {unit})', MOST_LISTED)}: other motions may fit worse than this one"
    ),
    "indefinite": lambda v: (
        f"the mass matrix is not positive definite in {v['failing']} of {v['poses']} poses: there is no forward dynamics"
    ),
    "unchecked": lambda v: (
        "the file lacks inertias to compare with, so psdmc cannot see a wrong unit of the effort or turned signs: "
        "check that the friction is positive and plausible"
    ),
    "negative_constants": lambda v: (
        f"the torque constant is negative at joint(s) {_each(v, '{joint}')}: current counts against the joint's sense"
    ),
    # suspects
    "columns": _columns,
    "scaled": lambda v: f"a gain of about {v['gain']:g} {VISIBLE}: {SCALES[v['gain']]}",
    "motor_side": lambda v: (
        f"a gain of about {v['gain']:.2g} = 1/{1.0 / v['gain']:.3g} {VISIBLE}: amperes in an effort column, or torque "
        "before a gear?"
    ),
    "other_unit": lambda v: f"a gain of about {v['gain']:.2g} {VISIBLE}: another unit?",
    # of an identified load
    "load_starved": lambda v: (
        f"{v['samples']:.3g} independent samples per unknown, expected at least {v['limit']:g}"
    ),
    "load_few_samples": lambda v: f"{v['samples']:.3g} independent samples per unknown",
    "mass_hidden": lambda v: f"the log does not show the load's mass: {v['seen']}",
    "mass_negative": lambda v: (
        f"the mass is {v['mass']:.3g} +- {v['std']:.2g} kg: is the model that of the robot without its load, and "
        "has the log's torque the same sign?"
    ),
    "no_mass": lambda v: (
        f"no mass is seen: {v['mass']:.3g} +- {v['std']:.2g} kg; centre and inertia mean nothing"
    ),
    "load_low_r2": lambda v: f"joint {v['joint']}: held-out R^2 {v['r2']:.3f} of the whole torque",
    "load_hidden": lambda v: f"not shown by the log: {', '.join(v['names'])} about the frame's origin",
}
"""The sentence of every code. A code keeps its meaning; a changed meaning is a new code."""
