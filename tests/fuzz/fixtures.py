"""Small valid files of every kind: what mutations start from, and what stands around a mutated file."""

from __future__ import annotations

import hashlib
import json
from functools import cache
from pathlib import Path

import numpy as np

from psdmc.calibration.logs.log import Log
from psdmc.calibration.logs.log_files import write_log
from psdmc.calibration.motions.trajectory import Trajectory, write_trajectory
from psdmc.compiler import derive
from psdmc.derivation.derive import derive_model
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.load import load_robot, load_robot_text

FILES = Path(__file__).parent / "files"

CAMPAIGN_LOGS = ("motor.csv", "motor_loaded.npz", "gravity.csv", "friction.csv", "inertial.parquet")
SIMULATED = dict.fromkeys(CAMPAIGN_LOGS, "0" * 64)
"""An index that has them all, of other inputs: psdmc simulates them again."""

SHORT, FIT_TO_READ, FIT_TO_USE = (0.2, 60.0), (2.5, 24.0), (6.0, 40.0)
"""s and Hz of logs: refused as too short, long enough to be looked through, long enough to be fitted."""


def text(name: str) -> str:
    return (FILES / name).read_text(encoding="utf-8")


def digest(content: str) -> str:
    """SHA-256, as packages' manifests have it."""
    return hashlib.sha256(content.encode()).hexdigest()


@cache
def two_link_model() -> DynamicsModel:
    """The robot of the logs, the campaign and the plant."""
    return derive_model(load_robot_text(text("two_link.toml"), "dh", drive_inertia=(0.3, 0.1)).chain)


def log(seconds: float, rate: float, quantity: str = "motor_torque") -> Log:
    """Both joints moving; torques of the model plus Coulomb and viscous friction."""
    time = np.arange(int(seconds * rate)) / rate
    w = 2 * np.pi * np.array([0.31, 0.47])
    q = np.stack([0.9 * np.sin(w[0] * time), 0.8 * np.sin(w[1] * time + 0.4)], axis=1)
    qd = np.stack([0.9 * w[0] * np.cos(w[0] * time), 0.8 * w[1] * np.cos(w[1] * time + 0.4)], axis=1)
    tau = two_link_model().inverse_dynamics(q, qd, -(w**2) * q) + 1.5 * np.tanh(qd / 0.03) + 0.7 * qd
    rounded = [np.round(values, 5) for values in (time, q, qd, tau)]
    return Log("run", ("shoulder", "elbow"), *rounded, quantity=quantity)  # type: ignore[arg-type]


def trajectory(rows: int = 12, period: float = 0.01) -> Trajectory:
    time = np.arange(rows) * period
    q = np.round(np.stack([0.5 * time, 0.2 * np.sin(3 * time)], axis=1), 6)
    qd = np.round(np.stack([0.5 + 0 * time, 0.6 * np.cos(3 * time)], axis=1), 6)
    qdd = np.round(np.stack([0 * time, -1.8 * np.sin(3 * time)], axis=1), 6)
    return Trajectory(("shoulder", "elbow"), time, q, qd, qdd)


def write_files(folder: Path) -> None:
    """One file of each kind, and a campaign with logs, in a folder that does not exist yet."""
    (folder / "campaign" / "logs").mkdir(parents=True)
    (folder / "campaign" / "trajectories").mkdir()
    for name in ("two_link.toml", "branches.toml", "arm.urdf", "hand.urdf", "legs.urdf", "plant.toml"):
        (folder / name).write_text(text(name), encoding="utf-8")
    for name, content in {"empty": "", "broken.npz": "PK\x03\x04", "text.npz": "hello"}.items():
        (folder / name).write_text(content, encoding="utf-8")
    two_link_model().save(folder / "two_link.npz")
    derive_model(load_robot(folder / "arm.urdf").chain).save(folder / "arm.npz")
    derive(folder / "hand.urdf").save(folder / "hand.npz")
    derive(folder / "legs.urdf", floating=True).save(folder / "legs.npz")
    write_log(log(*FIT_TO_USE), folder / "log.csv")
    write_log(log(*SHORT), folder / "log.npz")
    (folder / "campaign" / "campaign.toml").write_text(text("campaign.toml"), encoding="utf-8")
    for name in CAMPAIGN_LOGS:
        write_log(log(*SHORT, "current"), folder / "campaign" / "logs" / name)
    (folder / "campaign" / "logs" / "simulated.json").write_text(json.dumps(SIMULATED), encoding="utf-8")
    write_trajectory(trajectory(), folder / "campaign" / "trajectories" / "short.csv")


def write_bag(folder: Path, size: tuple[float, float], *, mcap: bool) -> None:
    """A ROS 2 bag of joint states."""
    import rosbags.rosbag2 as bags
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    state = store.types["sensor_msgs/msg/JointState"]
    header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    plugin = bags.StoragePlugin.MCAP if mcap else bags.StoragePlugin.SQLITE3
    with bags.Writer(folder, version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection("/joint_states", state.__msgtype__, typestore=store)
        run = log(*size)
        assert run.velocity is not None
        for time, *row in zip(run.time, run.position, run.velocity, run.effort, strict=True):
            at = int(time * 1e9)
            head = header(stamp(3 + at // 10**9, at % 10**9), "")
            message = state(head, ["shoulder", "elbow"], *map(np.array, row))
            writer.write(connection, at, store.serialize_cdr(message, state.__msgtype__))
