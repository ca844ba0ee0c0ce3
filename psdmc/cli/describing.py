"""`psdmc calibrate --describe`, and the options of plain logs that a description has keys for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from psdmc.cli.lists import assignments, names, numbers
from psdmc.cli.next_step import say_next
from psdmc.cli.one_line import one_line
from psdmc.cli.output import check_output
from psdmc.errors import InputError

if TYPE_CHECKING:
    from psdmc.calibration.description.table_fit import FitChoice

DRAFT = Path("log.toml")


def describe_logs(given: Sequence[Path], output: Path | None, topic: str | None) -> None:
    """Write the draft of a description of logs, the first path being a model where it is one; never over a file."""
    from psdmc.calibration.describe import describe_command

    output = output or DRAFT
    check_output(output, *given)
    model, missing = describe_command(given, output, topic or "")
    print(f"{output}: log description drafted: read it, and correct what is guessed")
    for what in missing:
        print(f"note: no column was found for the {one_line(what)}: name it where the draft has '?'")
    calibrated = "calibrated.npz" if model is None else f"{model.stem}_calibrated.npz"
    say_next("calibrate", model or "MODEL.npz", output, "-o", calibrated)


def require_none(flags: Sequence[str]) -> None:
    """InputError where options of a fit are given with --describe, which fits nothing."""
    if flags:
        raise InputError(
            f"--describe drafts a description, and reads no {', '.join(flags)}",
            "give them to the command that it prints, or write them into the draft",
        )


def fit_choice(cutoff: float | None, split: str | None, friction: Sequence[str] | None) -> FitChoice:
    """The options of the linear fit that the command line gives; InputError where one is none."""
    from psdmc.calibration.description.table_fit import FitChoice, split_of
    from psdmc.friction.terms import EXAMPLE, options_of

    exponents, offset = None, None
    if friction:
        terms = options_of(names(friction))
        if isinstance(terms, str):
            raise InputError(f"--friction: {terms}", f"write --friction {EXAMPLE}")
        exponents, offset = terms
    shares = numbers([split] if split else None, "--split", SPLIT_HINT)
    chosen = None if shares is None else split_of(shares)
    if isinstance(chosen, str):
        raise InputError(f"--split: {chosen}", SPLIT_HINT)
    return FitChoice(cutoff, chosen, exponents, offset)


SPLIT_HINT = "write --split 0.3 for the last 30 %, or --split 0.15,40 for 15 % in 40 blocks"


def parsed_joint_map(given: Sequence[str] | None) -> dict[str, str]:
    """The model's joint by the log's, from 'LOGGED=JOINT,...'."""
    found: dict[str, str] = {}
    for word in assignments(given):
        logged, _, joint = (part.strip() for part in word.rpartition("="))
        if not logged or not joint or logged in found or joint in found.values():
            what = "names no joint" if not logged or not joint else "names a joint twice"
            raise InputError(f"--joint-map: {word!r} {what}", "write LOGGED=JOINT,LOGGED=JOINT")
        found[logged] = joint
    return found
