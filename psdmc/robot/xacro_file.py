"""A xacro file as the URDF that xacro makes of it, where xacro is installed."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path

from psdmc.errors import InputError

REASON = 300
"""Characters of xacro's own message that an error repeats."""


def expanded(file: Path, source: str) -> str:
    """The text of the URDF. Expanding runs the expressions that the file holds, and reads the files that it includes.

    InputError where xacro is not installed, or refuses the file.
    """
    try:
        import xacro
    except ImportError:
        raise InputError(
            f"{source}: a xacro file, and xacro is not installed",
            "pip install 'psdmc[xacro]', or expand it yourself: xacro FILE > robot.urdf",
        ) from None
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            return str(xacro.process_file(str(file)).toxml())
    except Exception as error:  # whatever an expression of the file raises
        reason = " ".join(f"{error} {said.getvalue()}".split()) or type(error).__name__
        raise InputError(
            f"{source}: xacro cannot expand it: {reason[:REASON]}",
            "see what it says by itself: xacro FILE",
        ) from None
