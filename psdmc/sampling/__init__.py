"""Draws random states of a robot, evaluates functions at them, and writes both to Parquet files."""

from psdmc.sampling.along import Motion
from psdmc.sampling.parts import Sampled, sample
from psdmc.sampling.settings import Sampling

__all__ = ["Motion", "Sampled", "Sampling", "sample"]
