"""Limits of the sizes, names and numbers in a robot file. If a file exceeds a limit, the error message states the limit.

The limits are far beyond any real robot. With larger numbers, squares and products of lengths and masses would exceed
the range of 64-bit floats. The error would then appear far from the wrong number.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

MAX_BYTES = 4 * 2**20
"""Bytes of a robot file: the largest one known to us has 0.2 MB."""

MAX_LINKS = 1000
"""Links of a URDF: urdfdom and Pinocchio descend the tree by recursion and crash beyond a few thousand."""

MAX_COPIES = 3000
"""Elements that an MJCF file may ask for by repetition: MuJoCo compiles so many in a second, a million in hours."""

MAX_UNKNOWN = 100
"""Unknown kinds of elements in a URDF; each is compared with those that are known."""

MAX_JOINTS = 200
"""Movable joints of a chain: the longest serial robots have a few dozen."""

MAX_CHARACTERS = 100
"""Characters of a number: 17 digits distinguish any two 64-bit numbers."""

MAX_NAME = 1000
"""Characters of a name."""

MOST_FAULTS = 20
"""Faults of one file that a message names."""

SHOWN = 60
"""Characters of a file's text that a message repeats."""

TINIEST = 1e-300
"""Smallest magnitude besides zero: below it, numbers lose digits (denormal)."""


@dataclass(frozen=True, slots=True)
class Range:
    """The accepted magnitudes of a quantity in a robot file: zero, or from `least` to `most`, in `unit`."""

    least: float
    most: float
    unit: str

    def __str__(self) -> str:
        return f"0, or {self.least:g} to {self.most:g} {self.unit} in magnitude".replace("  ", " ")

    def fault(self, value: float) -> str | None:
        """Return a description of what is wrong with a finite number of this quantity, or None if nothing is."""
        if value == 0.0 or self.least <= abs(value) <= self.most:
            return None
        return f"is out of range, expected {self}"


LENGTH = Range(1e-60, 1e4, "m")
"""Files hold remains of rounding as small as (1e-16)^3; a chain of 200 joints of 10 km is far from overflow."""

ANGLE = Range(TINIEST, 1e3, "rad")
"""Beyond, sine and cosine would turn the number's last digit into 1e-13 and more."""

MASS = Range(1e-12, 1e6, "kg")
"""Pinocchio takes masses below 2e-16 kg for zero when it merges bodies."""

INERTIA = Range(1e-60, 1e16, "kg m^2")

DRIVE_INERTIA = Range(1e-18, 1e8, "kg m^2 (kg)")

RATIO = Range(TINIEST, 1e6, "")
"""Of a mimic joint's rate and its leader's, in rad and m: a screw with a pitch of 0.1 mm turns by 6e4 rad per m."""

DIRECTION = Range(TINIEST, 1e6, "")
"""Components of an axis; only their ratio matters."""

AXIS_LENGTH = Range(1e-6, 2e6, "")
"""Length of an axis as written: a shorter one is more likely a mistake than a direction."""

GRAVITY = Range(TINIEST, 1e3, "m/s^2")
"""Components; noise beside a larger one is harmless."""

GRAVITY_LENGTH = Range(1e-6, 2e3, "m/s^2")

QUATERNION = Range(TINIEST, 2.0, "")

ANY = Range(TINIEST, 1.8e308, "")
"""Joint limits are copied, not computed with; files write the largest number where there is none."""

LONGEST_LENGTH = Range(1e-6, 1e4, "m")
"""The longest length of a robot; the others may be any fraction of it."""


def shown(value: object) -> str:
    """Return a text or value of a file for a message: quoted as in Python, and shortened if it is long."""
    try:
        text = repr(value)
    except ValueError:
        # Python prints no integer of more than 4,300 digits.
        return "a number of thousands of digits"
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}... ({len(text)} characters)"


def joined(faults: Sequence[str]) -> str:
    """Return a list of faults as one line of a message, shortened if there are many."""
    more = [f"and {len(faults) - MOST_FAULTS} more"] if len(faults) > MOST_FAULTS else []
    return "; ".join([*faults[:MOST_FAULTS], *more])


def listed(names: Iterable[str], most: int = 12) -> str:
    """Return names in quotes for a message, shortened if there are many."""
    quoted = [f"'{name}'" for name in names]
    return ", ".join(quoted[:most]) + (f" and {len(quoted) - most} more" if len(quoted) > most else "")


def gravity_fault(gravity: Sequence[float]) -> str | None:
    """Return what is wrong with a gravity vector (three finite numbers, m/s^2), or None if nothing is."""
    faults = [GRAVITY.fault(component) for component in gravity]
    return next((fault for fault in faults if fault), None) or GRAVITY_LENGTH.fault(math.hypot(*gravity))


def scale_fault(lengths: Iterable[float]) -> str | None:
    """Return a description of what is wrong with the lengths of a robot (m) as a whole, or None if nothing is."""
    longest = max((abs(length) for length in lengths), default=0.0)
    fault = LONGEST_LENGTH.fault(longest)
    return f"the longest of all its lengths, {longest:g} m, {fault}" if fault else None


# Names of links and joints: a name is any text that fits on one line, and no two are equal.
def naming_faults(names: Sequence[str], what: str) -> list[str]:
    """Return what is wrong with the names of a robot's links or joints, one sentence for each fault."""
    counts = Counter(names)
    faults = [f"a {what} has no name"] if counts[""] else []
    faults += [fault for name in counts for fault in name_faults(name, what)]
    return faults + [f"{n} {what}s are called {shown(name)}" for name, n in counts.items() if n > 1 and name]


def name_faults(name: str, what: str) -> list[str]:
    """Return what is wrong with one name, one sentence for each fault."""
    # Control characters, line and paragraph separators, and halves of a character that no file can hold.
    has_control = any(unicodedata.category(letter) in ("Cc", "Cs", "Zl", "Zp") for letter in name)
    faults = [f"{what} name {shown(name)} has control characters"] if has_control else []
    if len(name) > MAX_NAME:
        faults.append(f"{what} name {shown(name)}: expected at most {MAX_NAME}")
    return faults


def free_name(wanted: str, taken: set[str]) -> str:
    """Return `wanted`, with underscores appended until the name is not in `taken`. The name is then added to `taken`."""
    while wanted in taken:
        wanted += "_"
    taken.add(wanted)
    return wanted


# Numbers are plain decimals in ASCII. Python's float also accepts underscores, digits of other alphabets and other kinds
# of spaces. The C++ streams of urdfdom accept none of them and read zero without a message. Because psdmc accepts only
# plain decimals, all readers get the same number.
WHITE_SPACE = " \t\n\r\f\v"
"""ASCII white space, which may stand around and between numbers."""

DECIMAL = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_GAP = re.compile(f"[{WHITE_SPACE}]+")


def words(text: str) -> list[str]:
    """Return the words of a text that are separated by ASCII white space."""
    return [word for word in _GAP.split(text) if word]


def decimal(word: str) -> float | None:
    """Return the number of a word; None if it is no finite decimal number, too long or too small."""
    if len(word) > MAX_CHARACTERS or not DECIMAL.fullmatch(word):
        return None
    value = float(word)
    if not math.isfinite(value) or (
        abs(value) < TINIEST and re.search("[1-9]", word.lower().partition("e")[0])
    ):
        return None
    return value
