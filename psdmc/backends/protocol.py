"""The interface of a back end (C, Rust): it receives metadata, arithmetic and reference values, and returns the text of
files.

Each back end is a folder next to this file. Other code uses only the constant BACK_END of its module `back_end`.
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
    """One generated function: `meaning` describes it for this robot; of its kernels, the one with compiled-in
    parameters comes first."""

    signature: Signature
    meaning: str
    kernels: tuple[Kernel, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Emission:
    """The content of a package, independent of the language in which it is written.

    info        the robot's metadata; its names are untrusted text
    kernels     the functions' arithmetic, by name
    references  states and the functions' values there, for the package's self-test
    adapters    names of the other programs for which the package has files
    """

    info: PackageInfo
    kernels: Mapping[str, Kernel]
    options: EmitOptions
    references: ReferenceStates | None = None
    adapters: tuple[str, ...] = ()

    @property
    def functions(self) -> tuple[Function, ...]:
        """The generated functions that `kernels` contain, in the order of headers."""
        return functions_of(self.kernels, self.info.base_frame)


@dataclass(frozen=True, slots=True)
class BackEnd:
    """A language in which psdmc can write packages.

    language    the name of the language for users
    named       what has the robot's name in this language, such as a crate
    files       returns path -> text of every file of the package, manifest.json last
    identifier  returns the robot's name in the language
    entry       from this name, returns the file that a user opens first, and how it is used
    next        from the package's folder, returns the next command to type
    lacks       options of `emit` that the back end does not have
    """

    language: str
    named: str
    files: Callable[[Emission], dict[str, str]]
    identifier: Callable[[str], str]
    entry: Callable[[str], tuple[str, str]]
    next: Callable[[str], str]
    lacks: tuple[str, ...] = ()


def back_end(name: str) -> BackEnd:
    """Return the back end with this name. Raises InputError if there is none."""
    if name not in BACK_ENDS:
        raise InputError(f"there is no back end {name!r}", f"choose one of {', '.join(BACK_ENDS)}")
    found: BackEnd = import_module(f"psdmc.backends.{name}.back_end").BACK_END
    return found


def functions_of(kernels: Mapping[str, Kernel], base_frame: str = BASE_FRAME) -> tuple[Function, ...]:
    """Return the functions to which the kernels belong, in the order of the functions' signatures. `base_frame` is the
    name of the base frame in their descriptions."""
    wrong = [name for name, kernel in kernels.items() if name != kernel.name]
    if wrong:
        raise InternalError(f"kernel {wrong[0]!r} is filed under a name that is not its own")
    signatures = {kernel.function.name: kernel.function for kernel in kernels.values()}
    found = []
    for signature in in_order(tuple(signatures.values())):
        own = [kernels[name] for name in (signature.name, f"{signature.name}_theta") if name in kernels]
        found.append(Function(signature, signature.meaning.replace(BASE_FRAME, base_frame), tuple(own)))
    return tuple(found)
