"""The input of a calibration: a campaign, a log description, or plain logs, some of them for validation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from psdmc.calibration.campaign_file import is_campaign
from psdmc.calibration.description.columns_found import torque_constants
from psdmc.calibration.description.description import (
    FIT,
    FitChoice,
    is_description,
    read_description,
    with_choice,
)
from psdmc.calibration.description.read_described import described_logs
from psdmc.calibration.identify.linear_problem import LinearOptions
from psdmc.calibration.logs.foreign_bytes import listed, quoted
from psdmc.calibration.logs.formats import has_topics
from psdmc.calibration.logs.log import AnyLog, without_start
from psdmc.calibration.logs.log_files import open_log
from psdmc.errors import InputError
from psdmc.progress import Progress


@dataclass(frozen=True, slots=True, eq=False)
class LogSources:
    """Logs for a calibration, and the options of the fit that their log description states.

    logs       the logs
    linear     options of the linear fit
    constants  torque constants, N m/A by joint name, for logs of currents; empty: the description gives none
    """

    logs: tuple[AnyLog, ...]
    linear: LinearOptions
    constants: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class LogNaming:
    """Names of topics and joints in plain logs.

    topic   topic of a bag with joint states; empty: its only one, or /joint_states
    joints  names of the model's joints by the names in the log, if they differ
    """

    topic: str = ""
    joints: Mapping[str, str] = field(default_factory=dict)

    @property
    def flags(self) -> list[str]:
        """Return the names of the command-line options that the user gave for topic or joint names."""
        return (["--topic"] if self.topic else []) + (["--joint-map"] if self.joints else [])

    def require_bag(self, paths: Sequence[Path]) -> None:
        """Raise InputError if a topic is given although no log has topics. A log description states its topics itself."""
        if self.topic and not any(has_topics(path) or is_description(path) for path in paths):
            raise InputError(f"--topic {quoted(self.topic)}: none of the logs is a bag", "leave it out")

    def opened(self, path: Path, progress: Progress) -> AnyLog:
        """Open a log and give its joints the model's names. Raises InputError if it lacks a joint with a given name."""
        log = open_log(path, progress, topic=self.topic)
        unknown = [quoted(name) for name in self.joints if name not in log.joint_names]
        if unknown:
            has = listed([quoted(name) for name in log.joint_names])
            raise InputError(f"{log.name}: --joint-map: no joint(s) {listed(unknown)}", f"the log has {has}")
        names = tuple(self.joints.get(name, name) for name in log.joint_names)
        sliding = None if log.sliding is None else tuple(self.joints.get(name, name) for name in log.sliding)
        return replace(log, joint_names=names, sliding=sliding)


def campaign_of(paths: Sequence[Path]) -> Path | None:
    """Return the campaign among the sources, or None. Raises InputError if other sources are given with a campaign."""
    if not paths:
        raise InputError("no log to calibrate from", "give a campaign's folder, a log description, or logs")
    campaigns = [path for path in paths if is_campaign(path) and not is_description(path)]
    if campaigns and len(paths) > 1:
        raise InputError(
            f"{campaigns[0]}: a campaign, given with {len(paths) - 1} other log(s) or campaign(s)",
            "calibrate from one campaign, or from plain logs",
        )
    return campaigns[0] if campaigns else None


def plain_sources(
    paths: Sequence[Path], joint_names: tuple[str, ...], linear: LinearOptions, progress: Progress
) -> LogSources:
    """Open the logs of a log description or of plain files, without additional logs for validation."""
    return log_sources(paths, (), joint_names, linear, FitChoice(), LogNaming(), progress)


def log_sources(
    paths: Sequence[Path],
    validation: Sequence[Path],
    joint_names: tuple[str, ...],
    linear: LinearOptions,
    choice: FitChoice,
    naming: LogNaming,
    progress: Progress,
) -> LogSources:
    """Open the logs for a fit. `paths` are log files, or one log description (a TOML file that names logs and describes
    their columns).

    validation  log files that are used for validation only. All rows of the other logs are then used for the fit, unless
                the option `split` of `choice` holds out a share of their rows for validation
    choice      options of the command line, which take precedence over those in the log description

    Raises InputError if a file cannot be used, or if a log description is given together with other files.
    """
    described = [path for path in paths if is_description(path)]
    if described and len(paths) + len(validation) > 1:
        raise InputError(
            f"{described[0]}: a log description, given with {len(paths) + len(validation) - 1} other log(s)",
            "name the other logs in it, each as a [[log]]",
        )
    if not described:
        fit = [naming.opened(path, progress) for path in paths]
        held = [replace(naming.opened(path, progress), use="validate") for path in validation]
        logs = _named_apart((*fit, *held), (*paths, *validation))
        return LogSources(_warm(logs, choice), _options(linear, FitChoice(), choice, bool(held)))
    if naming.flags:
        raise InputError(
            f"{', '.join(naming.flags)}: for plain logs, {described[0]} is a log description",
            "write topic in its [[log]], and logged_as in its [[joint]]",
        )
    description = read_description(described[0], joint_names)
    logs = described_logs(description, joint_names, progress)
    own = description.part(FIT)
    held_out = any(log.use == "validate" for log in logs)
    options = _options(description.options(linear), own, choice, held_out)
    constants = torque_constants(description, joint_names) if logs[0].quantity == "current" else {}
    return LogSources(_warm(logs, choice), options, constants)


def _named_apart(logs: Sequence[AnyLog], paths: Sequence[Path]) -> tuple[AnyLog, ...]:
    """The logs, of which those whose files have equal names in different folders are called by their paths."""
    names = [log.name for log in logs]
    return tuple(
        replace(log, name=str(path)) if names.count(log.name) > 1 else log
        for log, path in zip(logs, paths, strict=True)
    )


def _warm(logs: Sequence[AnyLog], choice: FitChoice) -> tuple[AnyLog, ...]:
    """The logs without their first seconds, if the user leaves these out."""
    return tuple(logs if choice.warm is None else (without_start(log, choice.warm) for log in logs))


def _options(linear: LinearOptions, own: FitChoice, choice: FitChoice, held_out: bool) -> LinearOptions:
    """Return the options of the fit. Options of the command line take precedence over those of the log description. If
    whole logs are for validation, no rows of the others are held out, unless an option asks for it."""
    linear = with_choice(linear, choice)
    if held_out and own.split is None and choice.split is None:
        return replace(linear, split=replace(linear.split, held_out=0.0))
    return linear
