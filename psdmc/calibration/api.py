"""`psdmc.calibrate`. The rest of this stage is loaded when it is called."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.load import model_of

if TYPE_CHECKING:
    from psdmc.calibration.calibrate import CalibrateOptions
    from psdmc.calibration.verdict.record import Calibration


def calibrate(
    model: DynamicsModel | str | Path,
    logs: str | Path | Sequence[str | Path],
    options: CalibrateOptions | None = None,
    torque_constants: Mapping[str, float] | None = None,
    validation: str | Path | Sequence[str | Path] = (),
    loaded: str | Path | Sequence[str | Path] = (),
    load: str | Path | Sequence[float] | None = None,
) -> Calibration:
    """Fit a model to logs of the robot. Returns the calibrated model, the identified values and the verdict.

    The result's `verdict.word` is "usable", "usable, with doubts" or "not usable". `verdict.reasons`, `.suspects` and
    `verdict.doubts` explain the word. The result's `model` is the calibrated model, for every verdict.

    model              a model, or the path of a model file
    logs               paths of the logs, or the path of a log description (TOML)
    options            filter and friction law of the fit; None: those of the log description, or the defaults
    torque_constants   N m/A at the joint (gear included) by joint name, for logs of currents; with `loaded`, only for
                       joints that do not feel the load
    validation         logs that only test the fit; psdmc then fits to all other logs, and tests with none of them
    loaded             more logs of currents, recorded with a known load on the robot, to find torque constants
    load               the known load: mass (kg) and centre of mass (m, tip frame) as four numbers, or a load file

    Raises InputError if a file is missing or a log cannot be used.
    """
    from psdmc.calibration.calibrate import calibrate as run
    from psdmc.calibration.given_load import given_load

    with_load = [loaded] if isinstance(loaded, str | Path) else list(loaded)
    known = None if load is None else given_load(load)
    return run(
        model_of(model),
        logs,
        options,
        torque_constants=torque_constants,
        validation=validation,
        loaded=with_load,
        load=known,
    )
