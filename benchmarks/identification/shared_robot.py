"""The virtual robot, its motions and its logs, on which side_by_side.py compares programs of identification.

The robot is the UR10 of the package example-robot-data, with drive inertias and friction added. `psdmc excite` plans two
motions, and `psdmc simulate` writes their logs: one for the fit, and one that no program sees. The logs hold positions
and motor currents, as the logs of many robots do. The programs get a URDF whose masses and inertias are wrong.
"""

from __future__ import annotations

import csv
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
TORQUE_CONSTANTS = (13.26, 13.26, 11.09, 9.45, 9.45, 9.45)
"""N m/A at the joint, gear included: the size of a UR10's."""
DRIVE_INERTIA = (2.0, 2.0, 0.9, 0.25, 0.25, 0.25)
"""kg m^2 at the joint."""
COULOMB = (14.0, 16.0, 9.0, 2.6, 2.8, 2.2)
"""N m."""
VISCOUS = (13.0, 15.0, 9.0, 2.4, 2.2, 2.0)
"""N m s/rad."""
SIGN_SPEED = 1e-3
"""rad/s over which Coulomb friction changes sign: so fast that a sign and psdmc's tanh are equally right."""
RATE = 250.0
"""Rows of a log per second."""


@dataclass(frozen=True, slots=True)
class Case:
    """One comparison: what the robot, its log and its file are like.

    lugre     True: LuGre friction with a Stribeck peak and a bent viscous part; False: Coulomb and viscous friction
    current_noise   A RMS, white
    coloured        A RMS of noise whose neighbouring values are alike (time constant COLOUR), of each motor
    delay           s, effort_delay of the virtual robot
    seconds         part of the log that is used, from its start; None: all
    masses          relative error (standard deviation) of the masses and inertias in the robot file
    centres         m, error of each coordinate of the centres of mass in the robot file
    """

    name: str
    lugre: bool = False
    current_noise: float = 0.05
    coloured: float = 0.0
    delay: float = 0.0
    seconds: float | None = None
    masses: float = 0.3
    centres: float = 0.01


CASES = (
    Case("plain"),
    Case("rough", lugre=True, coloured=0.1, delay=2e-3),
    Case("short", seconds=4.0, masses=0.03, centres=0.001),
    Case("wrong file", masses=0.3, centres=0.03),
)
COLOUR = 0.05
"""s, time constant of coloured noise."""


@dataclass(frozen=True, slots=True)
class Folder:
    """The files of one case."""

    root: Path
    truth: Path = field(init=False)
    given: Path = field(init=False)
    log: Path = field(init=False)
    held_out: Path = field(init=False)
    noiseless: Path = field(init=False)
    motion: Path = field(init=False)

    def __post_init__(self) -> None:
        files = {
            "truth": "truth.urdf",
            "given": "given.urdf",
            "log": "log.csv",
            "held_out": "campaign/logs/validation.csv",
            "noiseless": "noiseless/logs/validation.csv",
            "motion": "campaign/trajectories/validation.csv",
        }
        for name, file in files.items():
            object.__setattr__(self, name, self.root / file)


def robot_file() -> Path:
    """The UR10's URDF in the package example-robot-data."""
    import cmeel  # type: ignore[import-untyped]

    found = sorted((Path(cmeel.__path__[0]).parent / "cmeel.prefix").rglob("ur10_robot.urdf"))
    if not found:
        raise SystemExit("ur10_robot.urdf is missing: pip install example-robot-data")
    return found[0]


def with_wrong_masses(urdf: str, masses: float, centres: float, seed: int = 1) -> str:
    """The URDF with other masses (a log-normal factor, also of the inertia) and centres of mass. A body stays a body."""
    rng = np.random.default_rng(seed)
    tree = ET.fromstring(urdf)
    for inertial in tree.iter("inertial"):
        mass, origin, inertia = inertial.find("mass"), inertial.find("origin"), inertial.find("inertia")
        if mass is None or inertia is None:
            continue
        factor = float(np.exp(masses * rng.standard_normal()))
        mass.set("value", repr(float(mass.get("value", "0")) * factor))
        for key, value in inertia.attrib.items():
            inertia.set(key, repr(float(value) * factor))
        if origin is None:
            origin = ET.SubElement(inertial, "origin", {"xyz": "0 0 0", "rpy": "0 0 0"})
        moved = np.array([float(x) for x in origin.get("xyz", "0 0 0").split()])
        moved += centres * rng.standard_normal(3)
        origin.set("xyz", " ".join(repr(float(x)) for x in moved))
    return ET.tostring(tree, encoding="unicode")


def plant_text(case: Case) -> str:
    """The plant file of `psdmc simulate` for a case."""
    lines = ['robot = "truth.urdf"', 'tip = "tool0"', f"sign_speed = {SIGN_SPEED}"]
    if not case.lugre:
        lines.append('friction = ["coulomb", "viscous"]')
    lines += ["[sensors]", "position_step = 2e-5", f"current_noise = {case.current_noise}"]
    lines += ["current_step = 2e-3", f"effort_delay = {case.delay}"]
    rows = zip(JOINTS, TORQUE_CONSTANTS, DRIVE_INERTIA, COULOMB, VISCOUS, strict=True)
    for name, constant, inertia, coulomb, viscous in rows:
        lines += ["[[joint]]", f'name = "{name}"', f"torque_constant = {constant}"]
        lines += [f"drive_inertia = {inertia}", f"coulomb = {coulomb}", f"viscous = {viscous}"]
        if case.lugre:
            lines += [f"static = {1.3 * coulomb}", "stribeck_velocity = 0.05", "viscous_exponent = 0.7"]
            lines += [f"stiffness = {2e3 * coulomb}", f"damping = {2 * coulomb}"]
    return "\n".join(lines) + "\n"


def psdmc(*words: str, folder: Path) -> None:
    """Run a command of psdmc in a folder."""
    done = subprocess.run(
        [sys.executable, "-m", "psdmc", *words], cwd=folder, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise SystemExit(f"psdmc {' '.join(words)}: exit status {done.returncode}: {done.stderr}")


def plan(folder: Path, seconds: float) -> None:
    """Plan the two motions: `seconds` of CPU time for the search."""
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(robot_file(), folder / "truth.urdf")
    psdmc("derive", "truth.urdf", "--drive-inertia", "all", "--no-expand", "-o", "truth.npz", folder=folder)
    options = ["--one-log", "--validation", "--acceleration", "8", "--rate", str(RATE), "--repeats", "3"]
    options += ["--no-collisions", "--range", "shoulder_lift_joint=-2.5:0", "--seconds", str(seconds)]
    psdmc("excite", "truth.npz", "-o", "campaign", *options, folder=folder)


def record(planned: Path, root: Path, case: Case, seed: int = 0) -> Folder:
    """Simulate the logs of a case in the folder `root`, from the motions in the folder `planned`."""
    root.mkdir(parents=True, exist_ok=True)
    files = Folder(root)
    shutil.copy(planned / "truth.urdf", files.truth)
    given = with_wrong_masses(files.truth.read_text(encoding="utf-8"), case.masses, case.centres)
    files.given.write_text(given, encoding="utf-8")
    (root / "plant.toml").write_text(plant_text(case), encoding="utf-8")
    for campaign in ("campaign", "noiseless"):
        shutil.rmtree(root / campaign, ignore_errors=True)
        shutil.copytree(planned / "campaign", root / campaign)
    psdmc("simulate", "plant.toml", "campaign", "--seed", str(seed), folder=root)
    psdmc("simulate", "plant.toml", "noiseless", "--ideal", folder=root)
    _spoil(root / "campaign" / "logs" / "exciting.csv", files.log, case, seed)
    return files


def _spoil(source: Path, target: Path, case: Case, seed: int) -> None:
    """Write the log of the fit: the first seconds, with coloured noise on the currents."""
    header, rows = read_table(source)
    n = len(JOINTS)
    rows = rows if case.seconds is None else rows[rows[:, 0] <= case.seconds]
    if case.coloured:
        kept = float(np.exp(-1.0 / (RATE * COLOUR)))
        rng = np.random.default_rng(seed + 100)
        noise = np.zeros((len(rows), n))
        for k, fresh in enumerate(rng.standard_normal((len(rows) - 1, n)), start=1):
            noise[k] = kept * noise[k - 1] + np.sqrt(1.0 - kept**2) * fresh
        rows[:, -n:] += case.coloured * noise
    with target.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows([[repr(float(x)) for x in row] for row in rows])


def read_table(path: Path) -> tuple[Sequence[str], Array]:
    """The header and the numbers of a CSV file."""
    with path.open(encoding="utf-8") as file:
        header = next(csv.reader(file))
        return header, np.loadtxt(file, delimiter=",", ndmin=2)


def read_log(path: Path) -> tuple[Array, Array, Array]:
    """(N,) time in s, (N, n) positions in rad and (N, n) torques in N m of a log of currents in A."""
    n = len(JOINTS)
    header, rows = read_table(path)
    if len(header) != 1 + 2 * n:
        raise SystemExit(f"{path}: {len(header)} columns, expected time, {n} positions and {n} currents")
    return rows[:, 0], rows[:, 1 : 1 + n], rows[:, 1 + n :] * np.array(TORQUE_CONSTANTS)


def read_motion(path: Path) -> tuple[Array, Array, Array]:
    """(N, n) exact positions, rates and accelerations of a planned motion."""
    n = len(JOINTS)
    _, rows = read_table(path)
    return rows[:, 1 : 1 + n], rows[:, 1 + n : 1 + 2 * n], rows[:, 1 + 2 * n : 1 + 3 * n]
