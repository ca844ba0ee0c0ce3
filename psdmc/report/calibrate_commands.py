"""Runs the commands `psdmc excite` and `calibrate`: read files, compute, and write files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from psdmc.backends.c.render import identifier
from psdmc.backends.manifest import content_of
from psdmc.calibration.calibrate import CalibrateOptions, calibrate
from psdmc.calibration.campaign import (
    CampaignOptions,
    Plan,
    being_written,
    plan_campaign,
    require_free,
    write_campaign,
)
from psdmc.calibration.campaign_file import is_campaign
from psdmc.calibration.description.draft import drafted
from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.identify.state_friction import actuator_files, calibrated_actuators
from psdmc.calibration.known_load import given_load
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.log_files import column_names
from psdmc.calibration.logs.parts import LOST, on_cluster
from psdmc.calibration.motions.search import cpu_seconds
from psdmc.calibration.motions.trajectory import write_trajectory
from psdmc.calibration.sources import LogNaming
from psdmc.calibration.verdict.record import Calibration, verdict_of
from psdmc.compiler import compile as compile_model
from psdmc.errors import InputError
from psdmc.files import refuse_foreign_folder, write_together, write_whole
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.load import load, model_of
from psdmc.model.store import save
from psdmc.progress import Progress, silent
from psdmc.report.calibrate_report import excitation_figure, require_free_numbers, write_report
from psdmc.robot.mechanism import require_axes


def excite_command(
    model: str | Path,
    folder: str | Path,
    options: CampaignOptions | None = None,
    progress: Progress = silent,
    force: bool = False,
) -> Plan:
    """Plan a calibration campaign for a model. Write trajectories, campaign.toml, excitation.json, .csv and .svg into
    `folder`.

    force   replace the plan of an existing campaign; without `force`, a campaign in the folder gives an InputError
            before the search
    """
    began = cpu_seconds()
    options = options or CampaignOptions()
    if not force:
        require_free(folder)
    known = load(model)
    require_axes(known.mechanism, "a campaign")
    plan = plan_campaign(known, regressor_of(known, progress), options, progress, began)
    one_period = plan.found.motion.sampled(known.joint_names, options.sweep.period)
    picture = excitation_figure(plan.found, known.joint_names, [joint.limits for joint in plan.chain.joints])
    with being_written(folder):
        campaign = write_campaign(folder, plan.runs, plan.found, options.table, options.formats, force=force)
        write_trajectory(one_period, campaign.parent / "excitation.csv")
        write_whole(campaign.parent / "excitation.svg", picture)
    return plan


def calibrate_command(
    model: DynamicsModel | str | Path,
    sources: Sequence[str | Path],
    output: str | Path,
    report: str | Path | None = None,
    options: CalibrateOptions | None = None,
    torque_constants: Mapping[str, float] | None = None,
    actuators: str | Path | None = None,
    progress: Progress = silent,
    keep: bool = False,
    validation: Sequence[str | Path] = (),
    naming: LogNaming | None = None,
    loaded: Sequence[str | Path] = (),
    load_on: str | None = None,
    scheduler: str | None = None,
) -> Calibration:
    """Calibrate a model or model file with a campaign or logs, and write the calibrated model and a report.

    output     path of the calibrated model file
    report     path of an HTML page; its numbers go into a JSON file next to it. A JSON file of another kind is not
               replaced
    actuators  folder into which C code of friction and motors is written
    loaded     further logs, recorded while the robot carried the known load `load_on`: 'MASS,X,Y,Z' or the file of a
               load
    keep       whether to write the model and the C code even if the verdict is `not usable`
    validation  plain logs that are not fitted but test the fit
    naming     topic and joint names of plain logs
    scheduler  address of a Dask scheduler, whose workers compute the parts of long logs; None: this process does
    """
    if report is not None:
        require_free_numbers(report)
    known = model_of(model)
    if actuators is not None:
        require_actuators_folder(known, actuators)
    with on_cluster(scheduler, progress) as workers:
        record = calibrate(
            known,
            list(sources),
            options,
            regressor=CompiledWhenAsked(known, progress),
            torque_constants=torque_constants,
            validation=validation,
            naming=naming,
            loaded=loaded,
            load=None if load_on is None else given_load(load_on),
            progress=progress,
        )
    if workers is not None and workers.lost:
        record = replace(record, notes=(*record.notes, LOST))
    if report is not None:
        write_report(record, report)
    if not (verdict_of(record).usable or keep):
        return record
    save(record.model, output)
    if actuators is not None:
        write_actuators(record.model, actuators)
    return record


def write_actuators(model: DynamicsModel, folder: str | Path) -> list[Path]:
    """Write C code for the friction and motors into a folder. Raise InputError without a calibration."""
    found = model.calibrated
    if found is None:
        raise InputError(f"{model.mechanism.name}: not calibrated", "run `psdmc calibrate` first")
    require_actuators_folder(model, folder)
    view = calibrated_actuators(model.mechanism.name, model.v_names, found)
    files = actuator_files(view)
    write_together(Path(folder), files)
    return [Path(folder) / path for path in files]


def require_actuators_folder(model: DynamicsModel, folder: str | Path) -> None:
    """Raise InputError if a folder has files that the C code would not replace. A package of psdmc may be there, and
    earlier C code of friction and motors of this robot."""
    header = Path(folder) / "include" / f"{identifier(model.mechanism.name)}_actuators.h"
    if not content_of(folder) and not header.is_file():
        refuse_foreign_folder(folder, "choose a new or empty folder, or that of the robot's package")


class CompiledWhenAsked:
    """A model's regressor that is compiled at its first use, so that errors in logs are found before the compilation."""

    def __init__(self, model: DynamicsModel, progress: Progress) -> None:
        self._model, self._progress = model, progress
        self._compiled: Regressor | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        """Another process compiles the model again, and says no steps."""
        return CompiledWhenAsked, (self._model, silent)

    def regressor(self, q: Array, qd: Array, qdd: Array) -> Array:
        if self._compiled is None:
            self._compiled = regressor_of(self._model, self._progress)
        return self._compiled.regressor(q, qd, qdd)


def regressor_of(model: DynamicsModel, progress: Progress = silent) -> Regressor:
    """The model's regressor, compiled for this machine."""
    progress("compiling the regressor")
    return compile_model(model, functions=["regressor"])


MODEL_ARRAYS = {"manifest", "B"}
"""Arrays that model files have and logs do not."""


def describe_command(
    given: Sequence[str | Path], output: str | Path, topic: str = ""
) -> tuple[Path | None, tuple[str, ...]]:
    """Write the draft of a log description to `output`. Returns the model file, or None if none was given, and the
    joint quantities for which no column was found.

    given   paths of logs; the first one may be a model file, whose joints are then described

    Raises InputError if a log cannot be read, or if a file with the name of the output exists.
    """
    paths, output = [Path(path) for path in given], Path(output)
    model = paths.pop(0) if is_model_file(paths[0]) else None
    if not paths:
        raise InputError(
            f"{model}: a model, and no log to describe", "psdmc calibrate --describe MODEL.npz LOG"
        )
    for path in paths:
        if is_campaign(path):
            raise InputError(
                f"{path}: no log, but a campaign or a description", "give a log: a table or a bag"
            )
    if output.exists() or output.is_symlink():
        raise InputError(f"{output}: exists already, and is left as it is", "give another name: -o FILE.toml")
    names = None if model is None else load(model).joint_names
    draft = drafted(paths, output, names, topic)
    write_whole(output, draft.text)
    return model, draft.missing


def is_model_file(path: Path) -> bool:
    """Return whether a file is an .npz file with the arrays of a model."""
    if path.suffix.lower() != ".npz" or not path.is_file():
        return False
    try:
        return set(column_names(path)) >= MODEL_ARRAYS
    except InputError:
        return False
