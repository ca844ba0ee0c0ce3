"""A model's kernels, lowered once a run for all tests that ask for them, in any worker, and for psdmc.compile."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.lower.admitted import wanted
from psdmc.lower.kernels import Lowering, lower
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program.kernel import Kernel
from psdmc.target.presets import COSTS
from psdmc.toolchain.compile import lowered_once


def lowered(
    model: DynamicsModel,
    lowering: Lowering = "auto",
    functions: Sequence[str] | None = None,
    theta_variants: bool = True,
) -> dict[str, Kernel]:
    """As `lower` gives them. With `theta_variants` under the key that psdmc.compile uses."""
    names = wanted(functions, model.mechanism)
    parts = (model.content_hash, lowering, repr(COSTS), *names, *(() if theta_variants else ("baked alone",)))
    return lowered_once(parts, lambda: lower(model, lowering, names, theta_variants=theta_variants))
