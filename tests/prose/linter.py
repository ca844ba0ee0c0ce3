"""proselint's findings in the house's prose: words that repeat, clichés, redundancies, words that are none."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from itertools import accumulate, count

from house_style import NOT_PROSE, Fault, Piece

CHECKS = (
    "cliches",
    "hedging",
    "industrial_language",
    "lexical_illusions",
    "malapropisms",
    "misc.apologizing",
    "misc.back_formations",
    "misc.illogic",
    "misc.metadiscourse",
    "misc.narcissism",
    "misc.pretension",
    "misc.whence",
    "mixed_metaphors",
    "mondegreens",
    "nonwords",
    "oxymorons",
    "redundancy",
    "spelling.able_atable",
    "spelling.able_ible",
    "spelling.ally_ly",
    "spelling.ance_ence",
    "spelling.ely_ly",
    "spelling.em_im_en_in",
    "spelling.er_or",
    "spelling.in_un",
    "spelling.misc",
    "spelling.ve_of",
    "uncomparables",
    "weasel_words",
)
"""proselint's checks that suit a technical text: not its typography, names of animals and terms of the street."""


BETWEEN = "\n\n--\n\n"
"""What parts the pieces, so that no word repeats the last piece's."""


def faults(pieces: Sequence[Piece]) -> Iterator[Fault]:
    """What proselint finds, by the piece that it begins in."""
    if not pieces:
        return
    from proselint.checks import __register__
    from proselint.config import Config
    from proselint.registry import CheckRegistry
    from proselint.tools import LintFile

    registry = CheckRegistry()
    if not registry.checks:
        registry.register_many(__register__)
    number = count()
    lines = [_line(piece, number) for piece in pieces]
    starts = list(accumulate((len(line) + len(BETWEEN) for line in lines), initial=0))
    config = Config(max_errors=100_000, checks=dict.fromkeys(CHECKS, True))
    for found in LintFile("prose", BETWEEN.join(lines)).lint(config):
        start, end = (at - 1 for at in found.check_result.span)  # proselint puts a line break first
        index = bisect_right(starts, start) - 1
        piece = pieces[index]
        words = lines[index][start - starts[index] : end - starts[index]]
        if found.check_result.check_path == "lexical_illusions" and not re.search("[a-z]{2}", words):
            continue  # a formula or a series of numbers
        yield Fault(
            piece.file, piece.line, "linter", piece.text, f"{found.check_result.check_path} '{words}'"
        )


def _line(piece: Piece, number: Iterator[int]) -> str:
    """The piece in one line, with a name for each piece of code: no name twice, as repetitions are faults."""
    return " ".join(NOT_PROSE.sub(lambda code: f" code{next(number)} ", piece.text).split())
