"""The interface of a back end, which writes packages in one language (C, Rust). A back end receives metadata,
arithmetic and reference values, and returns the text of files.

Each back end is a folder next to this file. Other code uses only the constant BACK_END in the module `back_end` of the
folder.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module

from psdmc.backends import BACK_ENDS
from psdmc.backends.info import EmitOptions, PackageInfo
from psdmc.backends.reference_states import ReferenceStates
from psdmc.errors import InputError, InternalError
from psdmc.program.kernel import Kernel
from psdmc.program.signature import Signature, in_order
from psdmc.robot.mechanism import BASE_FRAME


@dataclass(frozen=True, slots=True)
class Function:
    """One generated function: `signature` has its inputs and outputs, `meaning` describes it for this robot. `kernels`
    are its variants without and with the base parameters as an input; the variant without comes first."""

    signature: Signature
    meaning: str
    kernels: tuple[Kernel, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Emission:
    """The content of a package, independent of the language (such as C) in which it is written.

    info        the robot's metadata; its names are untrusted text
    kernels     the arithmetic of each function variant, by name
    references  states and the functions' values there, for the package's self-test; None: no self-test
    adapters    names of the other programs for which the package has files
    estimator   the arithmetic that the load estimator calls; None: no estimator
    """

    info: PackageInfo
    kernels: Mapping[str, Kernel]
    options: EmitOptions
    references: ReferenceStates | None = None
    adapters: tuple[str, ...] = ()
    estimator: Kernel | None = None

    @property
    def functions(self) -> tuple[Function, ...]:
        """Return the generated functions of which the package has kernels, in the order of the function list."""
        return functions_of(self.kernels, self.info.base_frame)


@dataclass(frozen=True, slots=True)
class BackEnd:
    """A language in which psdmc can write packages.

    language    the name of the language for users
    named       what a package is called in this language, such as crate
    files       function that returns the text of every file of the package, by path, manifest.json last
    identifier  function that converts the robot's name to a valid name in the language
    entry       function that returns, for this valid name, the file that a user opens first, and how it is used
    next        function that returns, for the package's folder, the next command to type
    lacks       options of `emit` that this language does not support
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


def functions_of(kernels: Mapping[str, Kernel], base_frame: str) -> tuple[Function, ...]:
    """Return the functions to which the given kernels (variants of generated functions) belong, in the order of the
    function list. `base_frame` is the name of the base frame in the functions' descriptions."""
    wrong = [name for name, kernel in kernels.items() if name != kernel.name]
    if wrong:
        raise InternalError(f"kernel {wrong[0]!r} is filed under a name that is not its own")
    signatures = {kernel.function.name: kernel.function for kernel in kernels.values()}
    found = []
    for signature in in_order(tuple(signatures.values())):
        own = [kernels[name] for name in (signature.name, f"{signature.name}_theta") if name in kernels]
        found.append(Function(signature, signature.meaning.replace(BASE_FRAME, base_frame), tuple(own)))
    return tuple(found)
