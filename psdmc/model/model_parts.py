"""The attributes of every model, as an interface for files that DynamicsModel itself imports."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from psdmc.model.calibrated import Calibrated
from psdmc.robot.mechanism import Mechanism


class ModelParts(Protocol):
    """Parts of DynamicsModel, by its names."""

    @property
    def theta_b(self) -> NDArray[np.float64] | None: ...

    @property
    def mechanism(self) -> Mechanism: ...

    @property
    def certificate(self) -> NDArray[np.float64]: ...

    @property
    def provenance(self) -> Mapping[str, Any]: ...

    @property
    def calibrated(self) -> Calibrated | None: ...
