"""File formats in which robots' controllers take a planned motion: one file per format."""

from psdmc.calibration.motions.formats import franka, ros2, rsi, urscript
from psdmc.calibration.motions.formats.motion_format import MotionFormat

FORMATS: dict[str, MotionFormat] = {each.FORMAT.name: each.FORMAT for each in (ros2, urscript, rsi, franka)}
"""Formats by their names on the command line."""
