"""Describe the machine on which times are measured, and test whether other programs ran during a measurement."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

from psdmc.bench.build import native_flags
from psdmc.errors import ToolchainError
from psdmc.toolchain.compiler_command import find_compiler

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
