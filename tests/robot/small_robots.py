"""URDFs written on the spot, bundled and foreign robot files, and torques to compare."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from urdf_text import urdf

from psdmc.dynamics.frames import base_acceleration, frames_of
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.dynamics.parameters import bodies_of, drive_inertia_of
from psdmc.robot.load import LoadedRobot, load_robot_text
from psdmc.robot.mechanism import Array, Mechanism
from psdmc.robot.reference import reference

EXAMPLES = Path(__file__).parents[2] / "examples" / "robots"


def load_urdf(*parts: str, **options: object) -> LoadedRobot:
    return load_robot_text(urdf(*parts), "urdf", source_name="arm.urdf", **options)  # type: ignore[arg-type]


def dh(*rows: str, convention: str = "standard") -> str:
    """A DH file with one [[joint]] per text of keys."""
    head = f'name = "arm"\nconvention = "{convention}"\n'
    return head + "".join(f"[[joint]]\n{row}\n" for row in rows)


def load_dh(*rows: str, convention: str = "standard", **options: object) -> LoadedRobot:
    text = dh(*rows, convention=convention)
    return load_robot_text(text, "dh", source_name="arm.toml", **options)  # type: ignore[arg-type]


def torques(chain: Mechanism, q: Array, qd: Array, qdd: Array) -> Array:
    """psdmc's Newton-Euler on the chain as it stands; states (k, n)."""
    x = chain.parameters
    bodies, drives, base = bodies_of(chain, x), drive_inertia_of(x), base_acceleration(chain)
    return np.array(inverse_dynamics(frames_of(chain), bodies, drives, q.T, qd.T, qdd.T, base)).T


def largest_difference(loaded: LoadedRobot, *, snapped: bool, seed: int = 1) -> float:
    """Between psdmc's and Pinocchio's torques on 50 random states, per joint relative to its largest."""
    q, qd, qdd = np.random.default_rng(seed).normal(size=(3, 50, len(loaded.chain)))
    expected = reference(loaded, snapped=snapped).inverse_dynamics(q, qd, qdd)
    error = np.max(np.abs(torques(loaded.chain, q, qd, qdd) - expected), axis=0)
    size = np.max(np.abs(expected), axis=0)
    return float(np.max(error / np.where(size > 0.0, size, 1.0)))
