"""The function `psdmc.calibrate`. The code of the calibration is imported when the function is called."""

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
    """Fit a model to logs of the robot. Returns an object with the calibrated model, the identified values and the verdict.

    The attribute `verdict.word` of the result is "usable", "usable, with doubts" or "not usable". The lists
    `verdict.reasons`, `verdict.suspects` and `verdict.doubts` explain the verdict. The attribute `model` is the calibrated
    model, even if the verdict is "not usable".

    model              a model, or the path of a model file
    logs               paths of the logs, of a log description (TOML), or of a campaign folder (planned motions and their
                       logs) that `psdmc excite` wrote
    options            filter and friction law of the fit; None: those of the log description, or the defaults
    torque_constants   torque per current of each joint, for logs of motor currents: a dictionary from joint names to
                       N m/A at the joint (after the gear). With `loaded`, psdmc finds the constants of all joints on which
                       the load exerts a torque. In that case, give only the constants of the other joints. None: those of
                       the log description, or of `model` if it was calibrated before
    validation         logs that psdmc uses only to test the fitted model. Without validation logs, psdmc tests the model
                       with the last part of each log, and does not use this part for the fit
    loaded             logs of motor currents that were recorded with a known load at the tip. From `logs`, recorded without
                       the load, and `loaded`, psdmc finds the torque constants
    load               the known load of the logs `loaded`, as four numbers: mass (kg), and x, y, z of the centre of mass (m,
                       in the tip frame). Instead, you can give the path of a load file that `psdmc payload` wrote

    Raises InputError if a file is missing or if psdmc cannot use a log.
    """
    from psdmc.calibration.calibrate import calibrate as run
    from psdmc.calibration.known_load import given_load

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
