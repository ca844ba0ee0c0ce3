"""Draws random states of a robot, evaluates functions at them, and writes both to Parquet files."""

from psdmc.sampling.parts import Sampled, sample
from psdmc.sampling.plan import Sampling
from psdmc.sampling.states import Motion

__all__ = ["Motion", "Sampled", "Sampling", "sample"]
