"""Describe the machine on which times are measured, and test whether other programs ran during a measurement.

Also compile the libraries that psdmc is compared with, for this machine, and keep the results in a cache.
"""

from __future__ import annotations

import os
import platform
import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

from psdmc.errors import ToolchainError
from psdmc.target.presets import X86_64_V3
from psdmc.toolchain.cache import cache_key, cached
from psdmc.toolchain.compiler_command import find_compiler, run

# Compilers and compiled libraries


CXX_CANDIDATES = ("c++", "g++", "clang++")


def native_flags() -> tuple[str, ...]:
    """Compiler flags that psdmc uses on this machine. The benchmark compiles all libraries with them."""
    return find_compiler().flags


def counted_flags() -> tuple[str, ...]:
    """Return the compiler flags for counting instructions. They permit AVX2 instructions but no AVX-512, which valgrind
    does not support. So counts are equal on all machines."""
    return (*find_compiler().portable, *X86_64_V3.flags)


def built(
    product: str, command: Sequence[str], sources: Mapping[str, str], depends: Sequence[str] = ()
) -> Path:
    """Run a command that makes the file `product` from source files, and return the path of this file. The sources are
    first written into a folder.

    command  argument list; it does not run if the cache has a result from equal content
    sources  text of each file by its path in the folder
    depends  what else the result depends on, such as versions of libraries

    Raise ToolchainError if the command fails or makes no such file.
    """

    def build(folder: Path) -> None:
        for path, text in sources.items():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).write_text(text)
        run(command, product, str(folder))
        if not (folder / product).is_file():
            raise ToolchainError(
                f"{product}: {Path(command[0]).name} made no such file", "run the build by hand to see why"
            )

    return produced(build, sources, ("bench", product, *command, *depends)) / product


def produced(build: Callable[[Path], None], sources: Mapping[str, str], parts: Sequence[str]) -> Path:
    """Return the folder that `build` fills with compiled files; from the cache if possible. `parts` lists what the
    files depend on in addition to the sources, such as compiler flags."""
    compiler = find_compiler()
    target = [compiler.target] if any("native" in part for part in parts) else []
    return cached(cache_key(sources, (compiler.version, *target, *parts)), build)


def cxx() -> str:
    """Return the command of the C++ compiler, from $CXX or found. Raise ToolchainError if there is none."""
    chosen = os.environ.get("CXX")
    for name in [chosen] if chosen else CXX_CANDIDATES:
        if shutil.which(name):
            return name
    raise ToolchainError("no C++ compiler found", "install one (Debian: apt install g++) or set CXX")


# The machine and its load


IDLE_SHARE = 0.05
"""Cores that other processes may keep busy while a trial counts: beyond, a shared core costs up to a factor of two."""

RESOLUTION = 0.02
"""s; /proc/stat counts in hundredths: less than two of them do not show another process."""

_TICKS = os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 100


@dataclass(frozen=True, slots=True)
class Machine:
    """The properties of the machine that a time depends on."""

    processor: str
    cores: int
    system: str
    compiler: str
    flags: str
    governor: str
    python: str
    numpy: str


def this_machine() -> Machine:
    """Return the properties of this machine on which a time depends, as far as the system reports them."""
    return Machine(
        processor=_cpu_line("model name") or platform.processor() or platform.machine(),
        cores=os.cpu_count() or 1,
        system=f"{platform.system()} {platform.release()} {platform.machine()}",
        compiler=_compiler_version(),
        flags=_compiler_flags(),
        governor=_text("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor")
        or "not stated by this machine",
        python=platform.python_version(),
        numpy=np.__version__,
    )


def others_share() -> Callable[[], float]:
    """Return a function that measures how much processor time other processes have used since the call of others_share.
    The result is an average number of busy cores.

    The result is zero if the system does not report this time (no /proc/stat).
    """
    begin = _busy_seconds(), time.process_time(), time.monotonic()

    def share() -> float:
        busy, own, wall = _busy_seconds(), time.process_time(), time.monotonic()
        others = (busy - begin[0]) - (own - begin[1]) - RESOLUTION
        return max(0.0, others) / max(wall - begin[2], 1e-9) if busy else 0.0

    return share


def _busy_seconds() -> float:
    """All cores' time that was not idle, time stolen by other virtual machines included."""
    fields = _text("/proc/stat").split("\n", 1)[0].split()[1:9]
    if len(fields) < 8:
        return 0.0
    user, nice, system, _idle, _wait, irq, soft_irq, steal = (int(field) for field in fields)
    return (user + nice + system + irq + soft_irq + steal) / _TICKS


def _compiler_version() -> str:
    try:
        return find_compiler().version.splitlines()[0]
    except (ToolchainError, IndexError):
        return "none found"


def _compiler_flags() -> str:
    try:
        return " ".join(native_flags())
    except ToolchainError:
        return ""


def _cpu_line(key: str) -> str:
    lines = _text("/proc/cpuinfo").splitlines()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith(key)), "")


def _text(path: str) -> str:
    try:
        return Path(path).read_text().strip()
    except OSError:
        return ""


PACKAGES = ("psdmc", "numpy", "pin", "casadi", "cmeel-cppadcodegen", "mujoco")


def version_of(package: str) -> str:
    """Return the installed version of a package, or a text that says that it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def versions() -> dict[str, str]:
    """Return the installed version of each compared library, by its name."""
    return {package: version_of(package) for package in PACKAGES}
