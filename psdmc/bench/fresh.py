"""Derive a model in a new process, to measure the time and memory of the derivation."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path

from psdmc.derivation.derive import derive_model
from psdmc.errors import DerivationError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.processes import in_a_new_process
from psdmc.robot.mechanism import Mechanism

if sys.platform != "win32":
    import resource

STATUS = Path("/proc/self/status")


@dataclass(frozen=True, slots=True, eq=False)
class Derivation:
    """A model with the time and memory of its derivation. peak_bytes is for the whole process; None if the system does
    not report it."""

    model: DynamicsModel
    seconds: float
    peak_bytes: int | None


def derive_fresh(chain: Mechanism) -> Derivation:
    """Return the model of a robot, derived in a new process, with time and memory of the derivation. The matrices E and
    P are left out if they do not fit into memory."""
    return in_a_new_process(measured_derivation, chain)


def measured_derivation(chain: Mechanism) -> Derivation:
    """Derive a model twice in this process, and return it with the time of the second derivation and the peak memory of
    the process."""
    derive_model(chain, expand=False)  # imports and first calls are not measured
    start = time.perf_counter()
    try:
        model = derive_model(chain)
    except DerivationError:
        start = time.perf_counter()
        model = derive_model(chain, expand=False)
    return Derivation(model, time.perf_counter() - start, _peak_bytes())


def _peak_bytes() -> int | None:
    if sys.platform == "win32":
        return None
    if STATUS.is_file():  # Linux inherits ru_maxrss from the parent, but not this
        kibibytes = next(
            line.split()[1] for line in STATUS.read_text().splitlines() if line.startswith("VmHWM")
        )
        return 1024 * int(kibibytes)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak
