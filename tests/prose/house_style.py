"""The rules of the house style that a program can check: each takes a piece of prose and returns its faults."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

Kind = Literal["paragraph", "cell", "heading", "message", "docstring"]

LONGEST = {"sentence": 30, "paragraph": 90, "cell": 25}
"""Most words of each. The guide asks writers for 25, 60 and 20."""

NOT_PROSE = re.compile(r"`[^`]*`|\(https?[^)]*\)|\]\([^)]*\)")
WORD = re.compile(r"[A-Za-z][A-Za-z'’-]*")
SENTENCE_END = re.compile(r"(?<=[.!?:;])\s+(?=[A-Z`*\[])")

BANNED = (
    (r"\bheld against\b", "compared with"),
    (r"\bmend(s|ed|ing)?\b", "fix, repair"),
    (r"\bof (its|their) own\b", "a separate ..., or nothing"),
    (r"\b(is|are|was|were|be|been) said\b", "psdmc prints, warns, reports"),
    (r"\b(tells?|told|telling)\b", "print, report, show, distinguish"),
    (r"\bstands\b", "is"),
    (r"\bcom(es?|ing) out\b", "psdmc writes, the result is"),
    (r"\bso many\b", "the number"),
    (r"\bbeside\b", "compared with, next to, in addition to"),
    (r"\bbeyond\b", "over, more than, above, outside"),
    (r"\bfree[- ](roots?|bases?)\b|\bfree-?flyers?\b", "floating base"),
    (r"\bways?\b", "method, direction, path"),
    (
        r"\b(an?|one|the|each|every|half|whole|per|first|last|two|three) turns?\b",
        "revolution, rotation, step",
    ),
    (r"(^|, )where (it|there|they|an?|the|no|none|that|this|some|nothing|one)\b", "if"),
    (r"\bproved against\b", "compared with"),
    (r"\bsimply\b|\bnote that\b|\bobviously\b|\bof course\b", "nothing"),
    (r"\bits\b[^.]*\bits\b[^.]*\bits\b", "the nouns"),
)
"""Expressions of words that the house does not use, and what to write instead."""

MACHINES = (
    r"Zen ?\d|Nehalem|Haswell|Broadwell|Sky ?lake|Cascade Lake|Ice Lake|Sapphire Rapids|Emerald Rapids|Granite Rapids"
    r"|Neoverse[- ]\w+|Apple M\d",
    r"EPYC \w+|Ryzen \d+ \w+|Xeon [\w-]+|Core i\d\S*|Graviton ?\d|Raspberry Pi \d",
)
"""Processor cores and processors that are sold: a sentence names at most one of each. Targets such as Cortex-M cores may
be listed, as no time was measured on them."""

HASH = re.compile(r"(?<![\w.#-])(?=[0-9a-f]*\d)(?=\d*[a-f])[0-9a-f]{7,40}(?!\w|[.-]\w)")

_BANNED = tuple((re.compile(expression, re.IGNORECASE), instead) for expression, instead in BANNED)
_MACHINES = tuple(re.compile(expression) for expression in MACHINES)


@dataclass(frozen=True, slots=True)
class Piece:
    """A paragraph, a table's cell, a heading, a message or a docstring's paragraph, in one line."""

    file: str
    line: int
    kind: Kind
    text: str


@dataclass(frozen=True, slots=True)
class Fault:
    """A breach of a rule, at a line; `text` is the sentence, paragraph or cell."""

    file: str
    line: int
    rule: str
    text: str
    reason: str

    @property
    def name(self) -> str:
        """What the list of exceptions calls it: file, rule and the text's first 60 characters."""
        return f"{self.file} | {self.rule} | {self.text[:60].strip()}"

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.rule}: {self.reason}: {self.text[:90]}"


def plain(text: str) -> str:
    """The text without code, addresses and links' targets, an x for each."""
    return NOT_PROSE.sub(" x ", text)


def words(text: str) -> int:
    return len(WORD.findall(plain(text)))


def sentences(text: str) -> list[str]:
    """A text's sentences. Colons and semicolons before a capital letter end one, too."""
    return SENTENCE_END.split(text.strip())


def faults(pieces: Iterable[Piece]) -> Iterator[Fault]:
    """Every breach of every rule."""
    for piece in pieces:
        for rule in (_length, _sentence_lengths, _banned_words, _hashes, _two_machines):
            yield from rule(piece)


def _length(piece: Piece) -> Iterator[Fault]:
    rule = "cell" if piece.kind == "cell" else "paragraph"
    if piece.kind != "heading" and (count := words(piece.text)) > LONGEST[rule]:
        yield _fault(piece, rule, piece.text, f"{count} words, at most {LONGEST[rule]}")


def _sentence_lengths(piece: Piece) -> Iterator[Fault]:
    if piece.kind in ("cell", "heading"):
        return
    for sentence in sentences(piece.text):
        if (count := words(sentence)) > LONGEST["sentence"]:
            yield _fault(piece, "sentence", sentence, f"{count} words, at most {LONGEST['sentence']}")


def _banned_words(piece: Piece) -> Iterator[Fault]:
    lead = "| " if piece.kind == "cell" else ""  # a cell may begin with "where the feet are"
    for sentence in sentences(piece.text):
        for expression, instead in _BANNED:
            if found := expression.search(lead + plain(sentence)):
                yield _fault(piece, "banned word", sentence, f"'{found[0].strip(', ')}': write {instead}")


def _hashes(piece: Piece) -> Iterator[Fault]:
    for found in HASH.finditer(piece.text):
        yield _fault(piece, "hash", piece.text[found.start() :], "commit hashes belong to decision records")


def _two_machines(piece: Piece) -> Iterator[Fault]:
    for sentence in sentences(piece.text):
        for expression in _MACHINES:
            names = sorted(set(expression.findall(plain(sentence))))
            if len(names) > 1:
                yield _fault(piece, "machines", sentence, f"{' and '.join(names)} in one sentence")


def _fault(piece: Piece, rule: str, text: str, reason: str) -> Fault:
    return Fault(piece.file, piece.line, rule, " ".join(text.split()), reason)
