"""Random PROGRAMs for the passes' tests."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from random_programs import SEEDS, outputs_of, random_program

from psdmc.program.program import Program


@pytest.fixture(params=SEEDS)
def some_program(request: pytest.FixtureRequest) -> Program:
    return random_program(request.param)


@pytest.fixture
def outputs() -> Callable[[Program], np.ndarray]:
    return outputs_of
