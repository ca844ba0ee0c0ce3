"""What a back end receives and returns: facts, arithmetic and values on one side, the text of files on the other.

A back end is a room of this folder. Its module `back_end` has the constant BACK_END; nothing else of it is known above.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module

from psdmc.backends.info import PackageInfo
from psdmc.backends.options import EmitOptions
from psdmc.backends.reference_states import ReferenceStates
from psdmc.errors import InputError, InternalError
from psdmc.program.kernel import Kernel
from psdmc.program.signature import Signature, in_order
from psdmc.robot.mechanism import BASE_FRAME

BACK_ENDS = ("c", "rust")
"""By name, the rooms of this folder."""


@dataclass(frozen=True, slots=True)
class Function:
    """One function: `meaning` in words for this robot, and its kernels, with compiled-in parameters first."""

    signature: Signature
    meaning: str
    kernels: tuple[Kernel, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Emission:
    """What is emitted, in no language.

    info        the robot's facts; its names are untrusted text
    kernels     the functions' arithmetic, by name
    references  states and the functions' values there, for the package's own test
    adapters    other programs that the package is also for, by name
    """

    info: PackageInfo
    kernels: Mapping[str, Kernel]
    options: EmitOptions
    references: ReferenceStates | None = None
    adapters: tuple[str, ...] = ()

    @property
    def functions(self) -> tuple[Function, ...]:
        """The functions that `kernels` hold, in the order of headers."""
        return functions_of(self.kernels, self.info.base_frame)


@dataclass(frozen=True, slots=True)
class BackEnd:
    """A language that packages are written in.

    language    its name for people
    named       what is called by the robot's name
    files       path -> text of every file of the package, manifest.json last
    identifier  the robot's name in the language
    entry       of that name: the file that a user opens first, and how it is used
    next        of the package's folder: the command that follows
    lacks       options of `emit` that it does not have
    """

    language: str
    named: str
    files: Callable[[Emission], dict[str, str]]
    identifier: Callable[[str], str]
    entry: Callable[[str], tuple[str, str]]
    next: Callable[[str], str]
    lacks: tuple[str, ...] = ()


def back_end(name: str) -> BackEnd:
    """By name; InputError where there is none of it."""
    if name not in BACK_ENDS:
        raise InputError(f"there is no back end {name!r}", f"choose one of {', '.join(BACK_ENDS)}")
    found: BackEnd = import_module(f"psdmc.backends.{name}.back_end").BACK_END
    return found


def functions_of(kernels: Mapping[str, Kernel], base_frame: str = BASE_FRAME) -> tuple[Function, ...]:
    """The functions that kernels belong to, in the order of their signatures, whatever the mapping's order. `base_frame`:
    what their meanings call it."""
    wrong = [name for name, kernel in kernels.items() if name != kernel.name]
    if wrong:
        raise InternalError(f"kernel {wrong[0]!r} is filed under a name that is not its own")
    signatures = {kernel.function.name: kernel.function for kernel in kernels.values()}
    found = []
    for signature in in_order(tuple(signatures.values())):
        own = [kernels[name] for name in (signature.name, f"{signature.name}_theta") if name in kernels]
        found.append(Function(signature, signature.meaning.replace(BASE_FRAME, base_frame), tuple(own)))
    return tuple(found)
