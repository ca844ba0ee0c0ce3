"""The formats that are fuzzed: for each its target, its mutations, its seeds, and its share of a run."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random

import target_campaigns
import target_commands
import target_descriptions
import target_logs
import target_models
import target_packages
import target_robots
from minimise import smaller_archive, smaller_lines, smaller_options, smaller_runs, smaller_xml
from mutate_argv import mutate_argv
from mutate_bytes import mutate_bytes, mutate_lines
from mutate_csv import mutate_csv
from mutate_mjcf import mutate_mjcf
from mutate_npz import mutate_npz
from mutate_options import mutate_options
from mutate_package import mutate_package
from mutate_tables import mutate_parquet, mutate_sqlite
from mutate_toml import mutate_toml
from mutate_xml import mutate_xml

Target = Callable[[bytes, Path, bool], None]
Mutate = Callable[[bytes, Random], bytes]
Smaller = Callable[[bytes], Iterator[bytes]]


def no_set_up(folder: Path) -> None:
    """Nothing stands around the file."""


@dataclass(frozen=True, slots=True)
class Format:
    """One kind of input.

    run         reads one input in a scratch folder; `deep`: goes on to what a command would do next
    share       of the inputs of a run over all formats
    deep_every  one input in so many is run deep
    set_up      what stands around the file, made once per process
    """

    name: str
    suffix: str
    run: Target
    mutate: Mutate
    smaller: tuple[Smaller, ...]
    share: float
    deep_every: int
    set_up: Callable[[Path], None] = no_set_up


_TEXT = (smaller_lines, smaller_runs)
_ZIP = (smaller_archive, smaller_runs)
_RAW = (smaller_runs,)

FORMATS = {
    format.name: format
    for format in (
        Format("urdf", ".urdf", target_robots.urdf, mutate_xml, (smaller_xml, *_TEXT), 0.2, 20),
        Format("mjcf", ".xml", target_robots.mjcf, mutate_mjcf, (smaller_xml, *_TEXT), 0.08, 20),
        Format("dh", ".toml", target_robots.dh, mutate_toml, _TEXT, 0.2, 20),
        Format("options", ".json", target_robots.with_options, mutate_options, (smaller_options, *_TEXT), 0.1, 20),
        Format("model", ".npz", target_models.model, mutate_npz, _ZIP, 0.1, 10),
        Format("log-csv", ".csv", target_logs.csv, mutate_csv, _TEXT, 0.1, 40),
        Format("log-npz", ".npz", target_logs.npz, mutate_npz, _ZIP, 0.06, 40),
        Format("log-parquet", ".parquet", target_logs.parquet, mutate_parquet, _RAW, 0.05, 40),
        Format("log-db3", ".db3", target_logs.db3, mutate_sqlite, _RAW, 0.05, 40),
        Format("log-mcap", ".mcap", target_logs.mcap, mutate_bytes, _RAW, 0.02, 40),
        Format("bag", ".yaml", target_logs.bag, mutate_lines, _TEXT, 0.01, 40, target_logs.set_up_bag),
        Format("trajectory", ".csv", target_logs.trajectory, mutate_csv, _TEXT, 0.04, 1),
        Format("campaign", ".toml", target_campaigns.campaign, mutate_toml, _TEXT, 0.04, 50, target_campaigns.set_up),
        Format("description", ".toml", target_descriptions.description, mutate_toml, _TEXT, 0.05, 30,
               target_descriptions.set_up),
        Format("described-csv", ".csv", target_descriptions.described_csv, mutate_csv, _TEXT, 0.03, 2),
        Format("simulated", ".json", target_campaigns.simulated, mutate_package, _TEXT, 0.003, 1, target_campaigns.set_up),
        Format("plant", ".toml", target_campaigns.plant, mutate_toml, _TEXT, 0.05, 20, target_campaigns.set_up),
        Format("plant-robot", ".toml", target_campaigns.plant_robot, mutate_toml, _TEXT, 0.03, 20, target_campaigns.set_up),
        Format("package", ".json", target_packages.package, mutate_package, _TEXT, 0.04, 3),
        Format("argv", ".json", target_commands.command, mutate_argv, _TEXT, 0.012, 1),
    )
}  # fmt: skip


def chosen(words: str) -> list[Format]:
    """Formats by name or by the beginning of a name ("log"), separated by commas; all where there is none."""
    names = [word for word in words.split(",") if word]
    unknown = [name for name in names if not any(format.startswith(name) for format in FORMATS)]
    if unknown:
        raise SystemExit(f"no format {', '.join(unknown)}: there are {', '.join(FORMATS)}")
    return [
        format
        for format in FORMATS.values()
        if not names or any(format.name.startswith(name) for name in names)
    ]
