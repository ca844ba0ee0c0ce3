"""Errors on their way out of `python -m` modules: a message, a hint, a status."""

from __future__ import annotations

from psdmc.errors import DerivationError, exit_status_of


def test_an_action_s_own_status_is_kept():
    assert exit_status_of(lambda: None) == 0
    assert exit_status_of(lambda: 1) == 1


def test_an_error_becomes_two_lines_and_its_status(capsys):
    def fails() -> None:
        raise DerivationError("too many joints", "use --no-expand")

    assert exit_status_of(fails) == 3
    assert capsys.readouterr().err == "error: too many joints\nhint: use --no-expand\n"
