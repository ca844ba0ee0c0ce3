"""Time forward dynamics, alone and with its gradient, in JAX and PyTorch: psdmc beside frax, adam, jaxsim and MJX.

`make bench-learning` runs this on an idle machine. The robot is a UR5 on a fixed base, on one CPU thread. Each library
computes in its own process, after its own check against Pinocchio. A figure is the best mean over one batch, per state, of
the batches that fit into the time. The gradient is that of a weighted sum of the accelerations, by q, qd and tau.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

BATCHES = (1024, 4096, 16384)
SECONDS = float(os.environ.get("LEARNING_SECONDS", "2"))
"""Time of one measurement, which repeats calls until then."""

LONGEST = 60.0
"""Seconds after which a contestant measures no larger batch."""

CHECKED = 64
"""States that are compared with Pinocchio."""

URDF = Path(os.environ.get("LEARNING_URDF", ""))
"""The robot file that a child reads."""

JOINTS = [
    f"{name}_joint" for name in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
]

Arrays = tuple[Any, ...]
Made = tuple[Callable[..., Any], Callable[..., Any]]
"""The forward dynamics of a batch (q, qd, tau), and (sum, gradients) for weights as well."""


def with_jax(forward: Callable[..., Any]) -> Made:
    """From a function of a batch of states."""
    import jax

    def cost(q: Any, qd: Any, tau: Any, weights: Any) -> Any:
        return (weights * forward(q, qd, tau)).sum()

    return jax.jit(forward), jax.jit(jax.value_and_grad(cost, (0, 1, 2)))


def with_torch(forward: Callable[..., Any]) -> Made:
    """From a function of a batch of states."""
    import torch

    def slopes(q: Any, qd: Any, tau: Any, weights: Any) -> Any:
        given = [x.detach().requires_grad_() for x in (q, qd, tau)]
        cost = (weights * forward(*given)).sum()
        return cost, torch.autograd.grad(cost, given)

    return lambda *given: torch.no_grad()(forward)(*given), slopes


def psdmc_jax(real: str) -> Made:
    import psdmc

    return with_jax(psdmc.jax(psdmc.derive(URDF), real=real).forward_dynamics)  # type: ignore[arg-type]


def psdmc_torch(real: str) -> Made:
    import psdmc

    return with_torch(psdmc.torch(psdmc.derive(URDF)).forward_dynamics)


def frax(real: str) -> Made:
    import jax
    from frax.core.manipulator import Manipulator

    robot = Manipulator(str(URDF))
    return with_jax(jax.vmap(lambda q, qd, tau: robot.forward_dynamics(q, qd, tau, None)))


def adam_jax(real: str) -> Made:
    """adam's base is floating: the fixed base's accelerations follow from its mass matrix and bias forces."""
    import jax
    import jax.numpy as jnp
    from adam.jax import KinDynComputations

    robot, base = KinDynComputations(str(URDF), JOINTS), jnp.eye(4)

    def one(q: Any, qd: Any, tau: Any) -> Any:
        mass = robot.mass_matrix(base, q)[6:, 6:]
        return jnp.linalg.solve(mass, tau - robot.bias_force(base, q, jnp.zeros(6), qd)[6:])

    return with_jax(jax.vmap(one))


def adam_torch(real: str) -> Made:
    import torch
    from adam.pytorch import KinDynComputationsBatch

    robot = KinDynComputationsBatch(str(URDF), JOINTS)

    def forward(q: Any, qd: Any, tau: Any) -> Any:
        base = torch.eye(4, dtype=q.dtype).expand(len(q), 4, 4)
        still = torch.zeros(len(q), 6, dtype=q.dtype)
        mass = robot.mass_matrix(base, q)[:, 6:, 6:]
        return torch.linalg.solve(mass, tau - robot.bias_force(base, q, still, qd)[:, 6:])

    return with_torch(forward)


def jaxsim(real: str) -> Made:
    import jax
    import jaxsim.api as js

    model = js.model.JaxSimModel.build_from_model_description(URDF, considered_joints=JOINTS, gravity=9.81)

    def one(q: Any, qd: Any, tau: Any) -> Any:
        data = js.data.JaxSimModelData.build(model, joint_positions=q, joint_velocities=qd)
        return js.model.forward_dynamics_aba(model, data, joint_forces=tau)[1]

    return with_jax(jax.vmap(one))


def mjx(real: str) -> Made:
    """MJX with contacts, limits and all other constraints off."""
    import jax
    import mujoco
    from mujoco import mjx as library

    own = mujoco.MjSpec.from_string(URDF.read_text()).compile()
    own.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_CONTACT
    model, data = library.put_model(own), library.make_data(own)

    def one(q: Any, qd: Any, tau: Any) -> Any:
        return library.forward(model, data.replace(qpos=q, qvel=qd, qfrc_applied=tau)).qacc

    return with_jax(jax.vmap(one))


def bare(text: str) -> str:
    """The URDF without visuals, collisions, and the friction and damping that the others do not have."""
    text = re.sub(r"(?s)<(visual|collision)\b.*?</\1>", "", text)
    return re.sub(r"<dynamics[^>]*/>", "", text)


CONTESTANTS: dict[str, Callable[[str], Made]] = {
    "psdmc in JAX": psdmc_jax,
    "psdmc in PyTorch": psdmc_torch,
    "frax": frax,
    "adam (JAX)": adam_jax,
    "adam (PyTorch)": adam_torch,
    "jaxsim": jaxsim,
    "MJX": mjx,
}

PACKAGES = {
    "jax": "jax",
    "torch": "torch",
    "psdmc": "psdmc",
    "frax": "frax",
    "adam": "adam-robotics",
    "jaxsim": "jaxsim",
    "MJX": "mujoco-mjx",
}


def states(count: int, seed: int) -> Arrays:
    """q, qd, tau and weights."""
    rng = np.random.default_rng(seed)
    return tuple(rng.uniform(-1.0, 1.0, (count, 6)) * size for size in (3.0, 2.0, 20.0, 1.0))


def reference(given: Arrays, urdf: Path) -> dict[str, Any]:
    """Accelerations (rows, 6) and gradients (3, rows, 6) by Pinocchio."""
    import pinocchio

    model = pinocchio.buildModelFromUrdf(str(urdf))
    data, accelerations, slopes = model.createData(), [], []
    for q, qd, tau, weights in zip(*given, strict=True):
        by_q, by_qd, by_tau = pinocchio.computeABADerivatives(model, data, q, qd, tau)
        accelerations.append(pinocchio.aba(model, data, q, qd, tau))
        full = np.triu(by_tau) + np.triu(by_tau, 1).T
        slopes.append([weights @ by_q, weights @ by_qd, weights @ full])
    return {"accelerations": np.array(accelerations), "slopes": np.moveaxis(np.array(slopes), 1, 0)}


def per_state(call: Callable[[Arrays], Any], fresh: Callable[[int], Arrays], batch: int) -> float:
    """Nanoseconds per state, the best of calls with other states each."""
    call(fresh(0))
    best, end, seed = np.inf, time.perf_counter() + SECONDS, 0
    while time.perf_counter() < end or seed < 2:
        given = fresh(seed % 8)
        start = time.perf_counter()
        call(given)
        best, seed = min(best, (time.perf_counter() - start) / batch * 1e9), seed + 1
    return float(best)


def library(name: str, real: str) -> tuple[Callable[[Any], Any], Callable[[Any], Any]]:
    """How a NumPy array becomes one of the contestant's library, and how one waits for a result."""
    if "PyTorch" in name:
        import torch

        torch.set_num_threads(1)
        torch.set_default_dtype(getattr(torch, real))
        return lambda x: torch.tensor(x, dtype=getattr(torch, real)), lambda found: found
    import jax

    jax.config.update("jax_enable_x64", real == "float64")
    return lambda x: jax.numpy.asarray(x, real), jax.block_until_ready


def child(name: str, real: str, known: Path) -> None:
    """Print one contestant's figures as a line of JSON."""
    start = time.perf_counter()
    arrays, done = library(name, real)
    forward, gradient = CONTESTANTS[name](real)
    own = tuple(map(arrays, states(CHECKED, 99)))
    found = np.asarray(done(forward(*own[:3])))
    by = np.array([np.asarray(x) for x in done(gradient(*own))[1]])
    wanted = np.load(known)
    pairs = (found, wanted["accelerations"]), (by, wanted["slopes"])
    errors = [float(abs(a - b).max() / abs(b).max()) for a, b in pairs]
    result: dict[str, Any] = {"errors": errors, "forward": {}, "gradient": {}}
    for batch in BATCHES:
        kept = [tuple(map(arrays, states(batch, seed))) for seed in range(8)]
        result["forward"][batch] = per_state(lambda x: done(forward(*x[:3])), kept.__getitem__, batch)
        result["gradient"][batch] = per_state(lambda x: done(gradient(*x)), kept.__getitem__, batch)
        if time.perf_counter() - start > LONGEST:
            break
    print(json.dumps(result))


def run(name: str, real: str, options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """One contestant in its own process, on one core; its error's last line if it fails."""
    environment = os.environ | {
        "LEARNING_URDF": str(folder / "robot.urdf"),
        "JAX_PLATFORMS": "cpu",
        "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
        "JAX_ENABLE_X64": str(int(real == "float64")),
    }
    python = str(options.adam) if name == "adam (JAX)" and options.adam else sys.executable
    command = ["taskset", "-c", str(options.core), python, str(Path(__file__).resolve())]
    command += ["--child", name, "--real", real, "--known", str(folder / "known.npz")]
    try:
        ran = subprocess.run(
            command, capture_output=True, text=True, env=environment, cwd=folder, timeout=10 * LONGEST
        )
    except subprocess.TimeoutExpired:
        return {"failed": f"took more than {10 * LONGEST:.0f} s"}
    if ran.returncode:
        told = [line for line in ran.stderr.splitlines() if "Error" in line] or [f"status {ran.returncode}"]
        return {"failed": told[-1].strip()[:200]}
    return dict(json.loads(ran.stdout.strip().splitlines()[-1]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--child", choices=CONTESTANTS, help=argparse.SUPPRESS)
    parser.add_argument("--real", help=argparse.SUPPRESS)
    parser.add_argument("--known", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--only", default="", help="names of contestants, separated by commas")
    parser.add_argument(
        "--adam",
        type=lambda text: Path(text).absolute(),
        help="the Python that has adam and the JAX that adam asks for",
    )
    parser.add_argument("--core", type=int, default=max(os.sched_getaffinity(0)))
    options = parser.parse_args()
    if options.child:
        child(options.child, options.real, options.known)
        return
    from psdmc.bench.cases import robot_data

    robot = robot_data() / "ur_description/urdf/ur5_robot.urdf"
    print("UR5, ns per state (best batch); errors against Pinocchio, of the largest entry\n")
    print("| library | reals | forward dynamics | with gradient | errors |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        (here / "robot.urdf").write_text(bare(robot.read_text()))
        np.savez(here / "known.npz", **reference(states(CHECKED, 99), here / "robot.urdf"))
        for real in ("float32", "float64"):
            for name in [name for name in CONTESTANTS if not options.only or name in options.only.split(",")]:
                print(row(name, real, run(name, real, options, here)), flush=True)
    print("\n" + ", ".join(f"{name} {version(package)}" for name, package in PACKAGES.items()))


def row(name: str, real: str, result: dict[str, Any]) -> str:
    """A line of the table."""
    if "failed" in result:
        return f"| {name} | {real} | {result['failed']} | | |"
    best = [min((ns, int(batch)) for batch, ns in result[kind].items()) for kind in ("forward", "gradient")]
    cells = " | ".join(f"{ns:,.1f} ({batch})" for ns, batch in best)
    return f"| {name} | {real} | {cells} | {', '.join(f'{error:.0e}' for error in result['errors'])} |"


def version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "is not installed"


if __name__ == "__main__":
    main()
