"""A pendulum's kernels, written by hand: what goes in is in sight of what should come out."""

from __future__ import annotations

import numpy as np

from psdmc.backends.c.package import PackageView, package_view
from psdmc.backends.info import EmitOptions, JointInfo, PackageInfo
from psdmc.backends.reference_states import ReferenceStates
from psdmc.functions import SIGNATURES
from psdmc.model.equations import BaseParameter
from psdmc.program.kernel import Kernel
from psdmc.program.text import parse

INVERSE = """
    q = load q[0]
    a = load qdd[0]
    J = const 0.25
    w = const 4.905
    s = sin q
    Ja = mul J a
    ws = mul w s
    tau = add Ja ws
    out tau[0] = tau
"""
INVERSE_THETA = """
    q = load q[0]
    a = load qdd[0]
    J = load theta_b[0]
    m = load theta_b[1]
    g = const 9.81
    s = sin q
    w = mul m g
    Ja = mul J a
    ws = mul w s
    tau = add Ja ws
    out tau[0] = tau
"""
FORWARD = """
    q = load q[0]
    t = load tau[0]
    J = const 0.25
    w = const 4.905
    s = sin q
    ws = mul w s
    b = sub t ws
    a = div b J
    out pivot[0] = J
    out qdd[0] = a
"""


def kernel(name: str, text: str, theta: bool = False, batch: str | None = None) -> Kernel:
    program = parse(text)
    return Kernel(SIGNATURES[name], theta, program, parse(batch) if batch else program, "expanded")


def pendulum_kernels() -> dict[str, Kernel]:
    return {
        "forward_dynamics": kernel("forward_dynamics", FORWARD),
        "inverse_dynamics": kernel("inverse_dynamics", INVERSE),
        "inverse_dynamics_theta": kernel("inverse_dynamics", INVERSE_THETA, theta=True),
    }


def pendulum_references() -> ReferenceStates:
    """At rest at 90 degrees: tau = 0.25 qdd + 4.905, and as much with theta_b = (0.25, 0.5)."""
    given = {name: np.array([[np.pi / 2]]) for name in ("q", "qd", "qd_r", "qdd_r")}
    given |= {"qdd": np.array([[2.0]]), "tau": np.array([[5.405]]), "tau_theta": np.array([[5.405]])}
    expected = {"inverse_dynamics": given["tau"], "inverse_dynamics_theta": given["tau"]}
    return ReferenceStates(given, expected | {"forward_dynamics": given["qdd"]}, np.array([0.25, 0.5]))


def pendulum_info(name: str = "pendulum", joint: str = "hinge") -> PackageInfo:
    return PackageInfo(
        name=name,
        joints=(JointInfo(joint, "revolute", -3.1, 3.1, 4.0),),
        gravity=(0.0, -9.81, 0.0),
        base="wall",
        tip="bob",
        parameters=(
            BaseParameter("Izz1 + m1 0.5^2", "kg m^2", 0.25),
            BaseParameter("mx1", "kg m", 0.5),
        ),
        model_hash="00ff",
        psdmc_version="0.1.0",
        options={"lowering": "auto"},
    )


def pendulum(
    info: PackageInfo | None = None,
    options: EmitOptions | None = None,
    references: ReferenceStates | None = None,
) -> PackageView:
    return package_view(info or pendulum_info(), pendulum_kernels(), options or EmitOptions(), references)
