"""The command `psdmc calibrate --describe`, which drafts a log description from logs and optionally a model."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from psdmc.calibration.campaign_file import is_campaign
from psdmc.calibration.description.draft import drafted
from psdmc.calibration.logs.log_files import column_names
from psdmc.errors import InputError
from psdmc.files import write_whole
from psdmc.model.load import load

MODEL_ARRAYS = {"manifest", "B"}
"""Arrays that model files have and logs do not."""


def describe_command(
    given: Sequence[str | Path], output: str | Path, topic: str = ""
) -> tuple[Path | None, tuple[str, ...]]:
    """Write the draft of a log description to `output`. Returns the model file, or None if none was given, and the
    joint quantities for which no column was found.

    given   paths of logs; the first one may be a model file, whose joints are then described

    Raises InputError if a log cannot be read, or if a file with the name of the output exists.
    """
    paths, output = [Path(path) for path in given], Path(output)
    model = paths.pop(0) if is_model_file(paths[0]) else None
    if not paths:
        raise InputError(
            f"{model}: a model, and no log to describe", "psdmc calibrate --describe MODEL.npz LOG"
        )
    for path in paths:
        if is_campaign(path):
            raise InputError(
                f"{path}: no log, but a campaign or a description", "give a log: a table or a bag"
            )
    if output.exists() or output.is_symlink():
        raise InputError(f"{output}: exists already, and is left as it is", "give another name: -o FILE.toml")
    names = None if model is None else load(model).joint_names
    draft = drafted(paths, output, names, topic)
    write_whole(output, draft.text)
    return model, draft.missing


def is_model_file(path: Path) -> bool:
    """Return whether a file is an .npz file with the arrays of a model."""
    if path.suffix.lower() != ".npz" or not path.is_file():
        return False
    try:
        return set(column_names(path)) >= MODEL_ARRAYS
    except InputError:
        return False
