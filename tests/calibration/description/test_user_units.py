"""A log in a user's units, columns and signs is the same log as the plain one in SI units."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model
from test_payload_identification import Run, record

import psdmc
from psdmc.calibration.calibrate import CalibrateOptions
from psdmc.calibration.description.description import read_description
from psdmc.calibration.description.read_described import described_logs
from psdmc.calibration.logs.log import AnyLog, Log
from psdmc.calibration.logs.log_files import read_log, write_columns
from psdmc.calibration.verdict.record import Calibration
from psdmc.errors import InputError

GEARS = (101.0, 101.0, 101.0, 60.0, 60.0, 50.0)
CONSTANTS = (0.2, 0.2, 0.15, 0.1, 0.1, 0.05)
SIGNS = (1.0, -1.0, 1.0, 1.0, -1.0, 1.0)
ZEROS = (0.0, 12.5, -90.0, 180.0, 3.25, -7.0)

USER = """
[[log]]
file = "user.csv"
[time]
column = "t"
unit = "ms"
[position]
unit = "deg"
[velocity]
unit = "rpm"
[effort]
unit = "mA"
"""


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = record(tmp_path_factory.mktemp("logs") / "plain.csv", Run(seed=3, loaded=False, seconds=20.0))
    log = read_log(path)
    speed = np.gradient(log.position, log.time, axis=0)
    columns = {"time_s": log.time}
    for k, joint in enumerate(log.joint_names):
        columns[f"position_rad.{joint}"] = log.position[:, k]
        columns[f"velocity_rad_s.{joint}"] = speed[:, k]
        columns[f"motor_torque_nm.{joint}"] = log.effort[:, k]
    write_columns(columns, path)
    return path


def in_user_units(log: Log) -> dict[str, np.ndarray]:
    """Columns of motors: milliseconds, degrees before the gear, rpm, mA, some counted the other way."""
    assert log.velocity is not None
    columns = {"t": 1000.0 * log.time}
    for k, (gear, constant, sign, zero) in enumerate(zip(GEARS, CONSTANTS, SIGNS, ZEROS, strict=True)):
        columns[f"enc{k}"] = sign * np.degrees(log.position[:, k]) * gear + zero
        columns[f"n{k}"] = sign * log.velocity[:, k] * gear * 60.0 / (2.0 * np.pi)
        columns[f"i{k}"] = sign * log.effort[:, k] / (gear * constant) * 1000.0
    return columns


def joint_tables(names: tuple[str, ...], column) -> str:
    lines = []
    for k, (name, gear, constant, sign, zero) in enumerate(
        zip(names, GEARS, CONSTANTS, SIGNS, ZEROS, strict=True)
    ):
        common = f"sign = {sign:g}, gear_ratio = {gear!r}"
        lines += [
            "[[joint]]",
            f'name = "{name}"',
            f"position = {{ column = {column('enc', k)}, offset = {zero!r}, {common} }}",
            f"velocity = {{ column = {column('n', k)}, {common} }}",
            f"effort = {{ column = {column('i', k)}, torque_constant = {constant!r}, {common} }}",
        ]
    return "\n".join(lines)


def by_name(prefix: str, k: int) -> str:
    return f'"{prefix}{k}"'


def logs_of(path: Path, names: tuple[str, ...]) -> tuple[AnyLog, ...]:
    return described_logs(read_description(path, names), names)


def theta(found: Calibration) -> np.ndarray:
    return np.concatenate([found.model.known_theta_b(), [row.value for row in found.friction]])


def test_a_calibration_from_the_user_s_units_is_the_plain_one_s(plain: Path, tmp_path: Path):
    log, model = read_log(plain), bundled_model("kr6")
    write_columns(in_user_units(log), tmp_path / "user.csv")
    (tmp_path / "log.toml").write_text(USER + joint_tables(log.joint_names, by_name), encoding="utf-8")

    bare = CalibrateOptions(physical=False)  # where consistency is asked for, a solver iterates: 1e-6
    ours, theirs = psdmc.calibrate(model, tmp_path / "log.toml", bare), psdmc.calibrate(model, plain, bare)

    assert np.abs(theta(ours) - theta(theirs)).max() < 1e-9 * np.abs(theta(theirs)).max()
    for name, both in theirs.steps[0].joints.items():
        assert ours.steps[0].joints[name].held_out.r2 == pytest.approx(both.held_out.r2, abs=1e-9)
    assert ours.verdict is not None
    assert theirs.verdict is not None
    assert ours.verdict.word == theirs.verdict.word
    constants = {row.joint: row.value for row in ours.motors}
    wanted = [k * n for k, n in zip(CONSTANTS, GEARS, strict=True)]
    assert list(constants.values()) == pytest.approx(wanted, rel=1e-14)


def test_the_same_logs_from_every_kind_of_file(plain: Path, tmp_path: Path):
    log = read_log(plain)
    columns = in_user_units(log)
    names = list(columns)
    table = np.column_stack(list(columns.values()))
    write_columns(columns, tmp_path / "user.csv")
    write_columns(columns, tmp_path / "user.npz")
    write_columns(columns, tmp_path / "user.parquet")
    np.savetxt(tmp_path / "bare.csv", table, "%.17g", ",")
    np.savetxt(tmp_path / "bare.txt", table, "%.17g", " ")
    np.savetxt(tmp_path / "commented.dat", table, "%.17g", "\t", header="\t".join(names))
    semicolons = "\n".join(";".join(f"{x:.17g}".replace(".", ",") for x in row) for row in table)
    (tmp_path / "commas.csv").write_text(";".join(names) + "\n" + semicolons, encoding="utf-8")
    prelude = "Logger 3000\nmachine;7\n" + ";".join(names) + "\n" + semicolons.replace(",", ".")
    (tmp_path / "prelude.csv").write_text(prelude, encoding="utf-8")
    words = "\n".join(f"run,{line}" for line in (tmp_path / "bare.csv").read_text().splitlines())
    (tmp_path / "words.csv").write_text("mode," + ",".join(names) + "\n" + words, encoding="utf-8")
    np.savez(
        tmp_path / "arrays.npz",
        t=columns["t"],
        enc=np.column_stack([columns[f"enc{k}"] for k in range(6)]),
        n=np.column_stack([columns[f"n{k}"] for k in range(6)]),
        i=np.column_stack([columns[f"i{k}"] for k in range(6)]),
        comment=np.array(["a", "b"]),
    )
    (wanted,) = described(tmp_path, log.joint_names, "user.csv", by_name)

    def number(prefix: str, k: int) -> str:
        return str(names.index(f"{prefix}{k}") + 1)

    def of_array(prefix: str, k: int) -> str:
        return f'"{prefix}[{k + 1}]"'

    cases = [
        ("user.npz", by_name, ""),
        ("user.parquet", by_name, ""),
        ("bare.csv", number, ""),
        ("bare.txt", number, ""),
        ("commented.dat", by_name, ""),
        ("commas.csv", by_name, ""),
        ("prelude.csv", by_name, "[csv]\nskip = 2\n"),
        ("words.csv", by_name, ""),
        ("arrays.npz", of_array, ""),
    ]
    for file, column, more in cases:
        (found,) = described(tmp_path, log.joint_names, file, column, more)
        for what in ("time", "position", "velocity", "effort"):
            assert np.array_equal(getattr(found, what), getattr(wanted, what)), (file, what)


def described(folder: Path, names: tuple[str, ...], file: str, column, more: str = "") -> tuple[AnyLog, ...]:
    text = (USER + more).replace("user.csv", file) + joint_tables(names, column)
    if "bare" in file:
        text = text.replace('column = "t"', "column = 1")
    (folder / "log.toml").write_text(text, encoding="utf-8")
    return logs_of(folder / "log.toml", names)


def test_positions_and_torques_in_files_of_their_own(plain: Path, tmp_path: Path):
    log = read_log(plain)
    np.savetxt(tmp_path / "q.txt", log.position, "%.17g")
    np.savetxt(tmp_path / "tau.txt", log.effort, "%.17g")
    joints = "\n".join(
        f'[[joint]]\nname = "{name}"\n'
        f'position = {{ column = {k}, table = "q" }}\neffort = {{ column = {k}, table = "tau" }}'
        for k, name in enumerate(log.joint_names, start=1)
    )
    head = (
        '[[log]]\ntables = { q = "q.txt", tau = "tau.txt" }\n[time]\nrate = 100\n[position]\nunit = "rad"\n'
    )
    (tmp_path / "log.toml").write_text(head + joints, encoding="utf-8")

    (found,) = logs_of(tmp_path / "log.toml", log.joint_names)

    assert np.array_equal(found.position, log.position)
    assert np.array_equal(found.effort, log.effort)
    assert np.abs(found.time - log.time).max() < 1e-9
    assert found.velocity is None

    np.savetxt(tmp_path / "tau.txt", log.effort[:-1], "%.17g")
    with pytest.raises(
        InputError, match=r"log\.toml: tables of one log differ in rows: .*q\.txt has 2000, .*tau"
    ):
        logs_of(tmp_path / "log.toml", log.joint_names)


def test_times_that_are_dates(plain: Path, tmp_path: Path):
    """2026-05-01T12:00:00 UTC is 1,777,636,800 s after 1970; one row in another zone."""
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    log = read_log(plain)
    start = np.datetime64("2026-05-01T12:00:00", "us")
    stamps = start + np.round(1e6 * log.time).astype("timedelta64[us]")
    names = log.joint_names
    columns = {f"position_rad.{name}": log.position[:, k] for k, name in enumerate(names)}
    columns |= {f"motor_torque_nm.{name}": log.effort[:, k] for k, name in enumerate(names)}
    parquet.write_table(pyarrow.table({"when": stamps, **columns}), tmp_path / "log.parquet")
    cells = [str(stamp).replace("T", " ") for stamp in stamps]
    cells[7] = f"{stamps[7] + np.timedelta64(2, 'h')!s}+02:00"
    lines = [
        ",".join([cell, *(f"{x:.17g}" for x in row)])
        for cell, *row in zip(cells, *columns.values(), strict=True)
    ]
    (tmp_path / "log.csv").write_text(
        ",".join(["when", *columns]) + "\n" + "\n".join(lines), encoding="utf-8"
    )

    for file in ("log.csv", "log.parquet"):
        text = f'[[log]]\nfile = "{file}"\n[time]\ncolumn = "when"\nunit = "date"\n'
        (tmp_path / "log.toml").write_text(text, encoding="utf-8")
        (found,) = logs_of(tmp_path / "log.toml", names)
        assert np.abs(found.time - 1_777_636_800.0 - log.time).max() < 1e-6
        assert found.date == "2026-05-01"
        assert np.array_equal(found.rows(0, len(found)).effort, log.effort)

    lines[3] = lines[3].replace("2026", "20x6")
    (tmp_path / "log.csv").write_text(
        ",".join(["when", *columns]) + "\n" + "\n".join(lines), encoding="utf-8"
    )
    (tmp_path / "log.toml").write_text(text.replace("log.parquet", "log.csv"), encoding="utf-8")
    with pytest.raises(InputError, match=r"log\.csv: line 5, column 'when': '20x6-05-01 .*' is no date"):
        logs_of(tmp_path / "log.toml", names)
    (tmp_path / "log.toml").write_text(
        text.replace("log.parquet", "log.csv").replace('"date"', '"s"'), encoding="utf-8"
    )
    with pytest.raises(InputError, match=r"'2026-05-01 12:00:00\.000000' is no number") as raised:
        logs_of(tmp_path / "log.toml", names)
    assert "unit = 'date'" in (raised.value.hint or "")
