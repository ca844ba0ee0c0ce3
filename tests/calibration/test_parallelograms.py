"""The palletiser, calibrated from a log of its four motors: the true torques are found, friction of motors with them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import psdmc

ROBOTS = Path(__file__).parents[2] / "examples" / "palletiser"
FRICTION, NOISE = (30.0, 40.0), 1.0
"""Viscous (N m s/rad) and Coulomb friction (N m) of each motor; noise, N m."""


def test_a_log_of_the_motors_calibrates_the_palletiser(tmp_path: Path) -> None:
    loops = ROBOTS / "palletiser_loops.toml"
    true = psdmc.derive(ROBOTS / "palletiser.urdf", loops=loops)
    text = (ROBOTS / "palletiser.urdf").read_text(encoding="utf-8")
    (tmp_path / "palletiser.urdf").write_text(text.replace('<mass value="48"/>', '<mass value="60"/>'))
    wrong = psdmc.derive(tmp_path / "palletiser.urdf", loops=loops)
    rng, time = np.random.default_rng(0), np.arange(0.0, 20.0, 0.005)
    q, qd, qdd = np.zeros((3, len(time), 4))
    for k in range(1, 6):
        a, b = rng.uniform(-0.25, 0.25, (2, 4)) / np.sqrt(k)
        w = 0.4 * np.pi * k
        s, c = np.sin(w * time)[:, None], np.cos(w * time)[:, None]
        q, qd, qdd = q + a * s + b * c, qd + w * (a * c - b * s), qdd - w**2 * (a * s + b * c)
    friction = FRICTION[0] * qd + FRICTION[1] * np.sign(qd)
    tau = true.inverse_dynamics(q, qd, qdd) + friction + rng.normal(0.0, NOISE, q.shape)
    names = [
        "time_s",
        *(f"{kind}.{name}" for kind in ("position_rad", "joint_torque_nm") for name in true.v_names),
    ]
    np.savetxt(
        tmp_path / "log.csv",
        np.column_stack([time, q, tau]),
        "%.9g",
        ",",
        header=",".join(names),
        comments="",
    )

    found = psdmc.calibrate(wrong, tmp_path / "log.csv")

    assert found.verdict.word.startswith("usable")
    states = rng.uniform(-1.0, 1.0, (3, 200, 4))
    expected = true.inverse_dynamics(*states)
    before, after = (
        np.abs(model.inverse_dynamics(*states) - expected).max(axis=0)[[0, 1, 3]]
        for model in (wrong, found.model)
    )
    largest = np.abs(expected).max(axis=0)[[0, 1, 3]]
    assert (after < 0.01 * largest).all()
    assert (before > 0.05 * largest).any()
