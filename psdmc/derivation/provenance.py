"""Where a model comes from: what is needed to read its source again."""

from __future__ import annotations

import hashlib
from typing import Any

from psdmc.derivation.snap_effect import snap_effect
from psdmc.robot.load import LoadedRobot


def provenance(loaded: LoadedRobot) -> dict[str, Any]:
    """The model's origin as plain JSON values: enough to read the source again."""
    effect = snap_effect(loaded.mechanism, loaded.unsnapped().chain) if loaded.snap_report else None
    return {
        "source_text": loaded.source_text,
        "source_sha256": hashlib.sha256(loaded.source_text.encode()).hexdigest(),
        "source_format": loaded.source_format,
        "source_name": loaded.source_name,
        "options": loaded.options.as_json(),
        "snapped": [{"where": snap.where, "angle_rad": snap.angle} for snap in loaded.snap_report],
        "snap_torque_change": None if effect is None else effect.tolist(),
    }
