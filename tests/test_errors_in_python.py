"""What Python shows of an error: the message, its hint below; also after a trip to another process."""

from __future__ import annotations

import copy
import pickle
import traceback

import pytest

import psdmc
from psdmc.errors import DerivationError, InputError, PsdmcError, ToolchainError


@pytest.mark.parametrize("kind", [InputError, DerivationError, ToolchainError])
def test_a_traceback_ends_with_the_hint(kind: type[PsdmcError]) -> None:
    error = kind("arm.urdf: no links", "give a URDF with links")
    assert str(error) == "arm.urdf: no links"
    assert traceback.format_exception(error)[-2:] == [
        f"psdmc.errors.{kind.__name__}: arm.urdf: no links\n",
        "hint: give a URDF with links\n",
    ]


def test_an_error_without_hint_has_no_note() -> None:
    assert not hasattr(InputError("wrong"), "__notes__")


@pytest.mark.parametrize("trip", [copy.copy, copy.deepcopy, lambda error: pickle.loads(pickle.dumps(error))])
def test_a_worker_s_error_arrives_whole(trip: object) -> None:
    found = trip(InputError("wrong", "right"))
    assert (type(found), found.message, found.hint) == (InputError, "wrong", "right")
    assert found.__notes__ == ["hint: right"]


def test_what_a_user_meets_in_a_notebook() -> None:
    with pytest.raises(InputError) as caught:
        psdmc.derive("nowhere.urdf")
    assert "hint: give the path of a URDF or DH .toml file\n" in traceback.format_exception(caught.value)
