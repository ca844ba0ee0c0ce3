"""A two-link arm with known truth, its model, and a short campaign: enough for every step, quick enough for a test."""

from __future__ import annotations

import shutil
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from quick_campaign import QUICK

from psdmc.calibration.calibrate import calibrate
from psdmc.calibration.campaign import plan_campaign, write_campaign
from psdmc.calibration.identify.predictor import ChainRegressor
from psdmc.calibration.logs.log import Log
from psdmc.calibration.motions.trajectory import Trajectory
from psdmc.calibration.plant.virtual_robot import load_virtual_robot, simulate
from psdmc.calibration.simulate_campaign import SimulateOptions, simulate_campaign
from psdmc.calibration.verdict.record import Calibration
from psdmc.derivation.derive import derive_model
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.load import load_robot

sys.path.append(str(Path(__file__).parent / "identify"))  # whose helpers the tests of verdicts import by name

ROBOT = """
name = "two_link"
convention = "standard"
gravity = [0.0, -9.81, 0.0]
[[joint]]
name = "shoulder"
type = "revolute"
a = 0.4
alpha = 0.0
d = 0.0
theta = 0.0
drive_inertia = 0.3
limits = { position = ["-150 deg", "150 deg"], speed = 4.0, acceleration = 15.0 }
[joint.link]
mass = 2.0
com = [-0.15, 0.02, 0.0]
inertia_com = { xx = 0.01, yy = 0.05, zz = 0.05, xy = 0.0, xz = 0.0, yz = 0.0 }
[[joint]]
name = "elbow"
type = "revolute"
a = 0.3
alpha = 0.0
d = 0.0
theta = 0.0
drive_inertia = 0.1
limits = { position = ["-140 deg", "140 deg"], speed = 5.0, acceleration = 25.0 }
[joint.link]
mass = 1.5
com = [-0.1, -0.01, 0.0]
inertia_com = { xx = 0.01, yy = 0.03, zz = 0.03, xy = 0.0, xz = 0.0, yz = 0.0 }
"""

PLANT = """
robot = "two_link.toml"
[sensors]
position_step = 5e-7
current_noise = 5e-3
current_step = 1e-3
effort_delay = 1e-3
[harness]
joints = ["elbow"]
torque = 0.5
angle = 1.0
[[joint]]
name = "shoulder"
torque_constant = 12.0
coulomb = 3.0
static = 3.8
stribeck_velocity = 0.03
viscous = 4.0
viscous_exponent = 0.7
stiffness = 9e3
damping = 12.0
[[joint]]
name = "elbow"
torque_constant = 5.0
coulomb = 1.2
static = 1.5
stribeck_velocity = 0.05
viscous = 1.5
viscous_exponent = 0.65
stiffness = 4e3
damping = 6.0
"""


@dataclass(frozen=True)
class Arm:
    """Where the files are, the model with its true parameters, and the same without."""

    folder: Path
    plant: Path
    model: DynamicsModel

    @property
    def unknown(self) -> DynamicsModel:
        return replace(self.model, theta_b=None)

    @property
    def regressor(self) -> ChainRegressor:
        return ChainRegressor(self.model)


@pytest.fixture(scope="session")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Arm:
    folder = tmp_path_factory.mktemp("two_link")
    (folder / "two_link.toml").write_text(ROBOT, encoding="utf-8")
    (folder / "plant.toml").write_text(PLANT, encoding="utf-8")
    chain = load_robot(folder / "two_link.toml", drive_inertia=True).chain
    return Arm(folder, folder / "plant.toml", derive_model(chain))


@pytest.fixture(scope="session")
def campaign(arm: Arm) -> Path:
    """A written campaign without logs."""
    plan = plan_campaign(arm.model, arm.regressor, QUICK)
    return write_campaign(arm.folder / "campaign", plan.runs, plan.found, "npz")


def logged(arm: Arm, campaign: Path, name: str, **variant: bool) -> Path:
    """The campaign's folder with logs of a variant of the plant."""
    folder = arm.folder / name
    shutil.copytree(campaign.parent, folder, dirs_exist_ok=True)
    simulate_campaign(arm.plant, folder, SimulateOptions(**variant))
    return folder


def calibrated(arm: Arm, folder: Path) -> tuple[Path, Calibration]:
    """A folder with logs, and what they calibrate."""
    return folder, calibrate(arm.unknown, folder, regressor=arm.regressor)


@pytest.fixture(scope="session")
def ideal_logs(arm: Arm, campaign: Path) -> Path:
    return logged(arm, campaign, "ideal", ideal_sensors=True)


@pytest.fixture(scope="session")
def ideal(arm: Arm, ideal_logs: Path) -> tuple[Path, Calibration]:
    return calibrated(arm, ideal_logs)


@pytest.fixture(scope="session")
def noisy(arm: Arm, campaign: Path) -> tuple[Path, Calibration]:
    return calibrated(arm, logged(arm, campaign, "noisy"))


@pytest.fixture(scope="session")
def harness(arm: Arm, campaign: Path) -> tuple[Path, Calibration]:
    return calibrated(arm, logged(arm, campaign, "harness", harness=True))


def smooth_log(
    arm: Arm, seconds: float = 12.0, rate: float = 250.0, noise: float = 0.01, seed: int = 3
) -> Log:
    """Both joints moving, torques exact for the model plus Coulomb and viscous friction and a little noise."""
    time = np.arange(int(seconds * rate)) / rate
    w = 2 * np.pi * np.array([0.31, 0.47])
    q = np.stack([0.9 * np.sin(w[0] * time), 0.8 * np.sin(w[1] * time + 0.4)], axis=1)
    qd = np.stack([0.9 * w[0] * np.cos(w[0] * time), 0.8 * w[1] * np.cos(w[1] * time + 0.4)], axis=1)
    qdd = -(w**2) * q
    assert arm.model.theta_b is not None
    tau = arm.regressor.regressor(q, qd, qdd) @ arm.model.theta_b
    tau = tau + np.array([1.0, 0.6]) * np.tanh(qd / 0.03) + np.array([0.8, 0.5]) * qd
    tau = tau + noise * np.random.default_rng(seed).standard_normal(tau.shape)
    return Log("smooth", arm.model.joint_names, time, q, qd, tau, "motor_torque")


@pytest.fixture
def log(arm: Arm) -> Log:
    return smooth_log(arm)


@pytest.fixture(scope="session")
def plant_log(arm: Arm) -> Log:
    """Torques of PLANT (Pinocchio, LuGre friction, sensors) through two sines a joint, 30 s at 100 Hz."""
    return plant_log_of(arm.plant)


def plant_log_of(plant: Path) -> Log:
    """The same of a plant file with these joints and torque constants."""
    time = np.arange(3000) / 100.0
    q, qd, qdd = (np.zeros((len(time), 2)) for _ in range(3))
    for size, hertz, phase in ((0.9, (0.17, 0.23), (0.0, 0.7)), (0.35, (0.41, 0.57), (1.1, 0.2))):
        w = 2 * np.pi * np.array(hertz)
        angle = w * time[:, None] + np.array(phase)
        q += size * np.sin(angle)
        qd += size * w * np.cos(angle)
        qdd -= size * w**2 * np.sin(angle)
    motion = Trajectory(("shoulder", "elbow"), time, q, qd, qdd)
    log = simulate(load_virtual_robot(plant), motion)
    return replace(log, name="plant", effort=log.effort * np.array([12.0, 5.0]), quantity="motor_torque")
