"""Time forward dynamics with contacts, alone and with its derivatives, and of the palletiser, whose parallelograms are
closed loops: psdmc's C beside Pinocchio's C++.

`make bench-contacts` runs this on an idle machine. Pinocchio's functions `constraintDynamics` and
`computeConstraintDynamicsDerivatives` are compiled from headers, with the flags of psdmc's C. Their proximal method makes
one step without regularisation, which is exact. Results are compared first. Robots with surfaces are compared at rest,
where the spatial acceleration that Pinocchio prescribes is the classical one. A figure is the median time of a call with
one state, over blocks of 512 random states, on one thread.

For the palletiser, Pinocchio closes each loop by three rows, one of which is redundant. Its regularisation mu and its
number of proximal steps are the fastest whose accelerations are psdmc's to 1e-9.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from psdmc.backends.c.back_end import library_files
from psdmc.backends.c.package import PackageView, package_view
from psdmc.backends.info import EmitOptions, package_info
from psdmc.bench.case import robot_as_numbers
from psdmc.bench.cases import LEGGED, robot_data
from psdmc.bench.contestant import source
from psdmc.bench.machine import built, cxx, native_flags, this_machine, version_of
from psdmc.bench.rivals.pinocchio_cpp import DEFINES, includes, pinocchio_prefix
from psdmc.derivation.derive import derive_model
from psdmc.lower.admitted import wanted
from psdmc.lower.kernels import lower
from psdmc.model.random_states import states_of
from psdmc.robot.coordinates import MimicMap
from psdmc.robot.load import load_robot
from psdmc.robot.mechanism import Array, Placement
from psdmc.target.target import GCC_ONLY

CONTACTS = {
    "hyq": ("lf_foot", "rf_foot", "lh_foot", "rh_foot"),
    "solo12": ("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT"),
    "b1-z1": ("FL_foot", "FR_foot", "RL_foot", "RR_foot"),
    "talos_reduced": ("left_sole_link:6", "right_sole_link:6"),
}
"""The robots, paths in LEGGED, with points (3 rows each) or surfaces (6)."""

FUNCTIONS = ("constrained_forward_dynamics", "constrained_forward_dynamics_derivatives")
PALLETISER = Path(__file__).resolve().parents[1] / "examples" / "palletiser"
STATES, ROUNDS, SEED = 4096, 9, 4
MASKS = ("all contacts", "every second", "none")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "names", nargs="*", help=f"of {', '.join(CONTACTS)}, palletiser; all where none is named"
    )
    found = this_machine()
    print(f"{found.processor}, {found.compiler}, {found.flags}")
    print(
        "ns per call; x: Pinocchio's time over psdmc's; error: largest relative difference of qdd and dqdd_dq"
    )
    print(f"{'robot':<15}{'active':<15}{'values':>8}{'x':>7}{'derivatives':>13}{'x':>7}{'errors':>20}")
    names = parser.parse_args().names or [*CONTACTS, "palletiser"]
    for name in names:
        if name == "palletiser":
            ours, theirs, worst, mu, steps = _palletiser()
            print(
                f"{name:<15}{'3 loops':<15}{ours:>8.0f}{theirs / ours:>7.1f}{'':>20}{worst:>20.0e}"
                f"   Pinocchio: mu {mu:g}, {steps:g} steps"
            )
            continue
        for line in _measured(name):
            mask, worst, slope, ours, theirs, own, other = line
            errors = f"{worst:.0e}, {slope:.0e}"
            times = f"{ours:>8.0f}{theirs / ours:>7.1f}{own:>13.0f}{other / own:>7.1f}"
            print(f"{name:<15}{MASKS[int(mask)]:<15}{times}{errors:>20}", flush=True)
    return 0


def _measured(name: str) -> list[list[float]]:
    """Return a line of figures for each mask."""
    loaded = load_robot(robot_data() / LEGGED[name], floating=True, contacts=list(CONTACTS[name]))
    robot = loaded.mechanism
    model = derive_model(robot, expand=False)
    with tempfile.TemporaryDirectory() as folder:
        kernels = lower(model, functions=wanted(FUNCTIONS, robot), theta_variants=False)
        program = _compiled(package_view(package_info(model, "robot"), kernels, EmitOptions()))
        lines = [robot_as_numbers(robot), str(len(robot.contacts))]
        lines += [f"{each.joint + 1} {each.rows} {_place(each.placement)}" for each in robot.contacts]
        lines.append(f"{STATES} {ROUNDS}")
        states = states_of(robot, np.random.default_rng(SEED), STATES)
        lines += [_row(*row) for row in zip(*states, strict=True)]
        return _printed(program, lines, folder)


def _palletiser() -> list[float]:
    """Return times of psdmc and of Pinocchio, the largest difference, and Pinocchio's settings."""
    file, tables = PALLETISER / "palletiser.urdf", PALLETISER / "palletiser_loops.toml"
    robot = load_robot(file, loops=tables).mechanism
    loops = [table | {"follows": []} for table in tomllib.loads(tables.read_text(encoding="utf-8"))["loop"]]
    tree = load_robot(file, loops=loops).mechanism
    model = derive_model(robot, expand=False)
    with tempfile.TemporaryDirectory() as folder:
        kernels = lower(model, functions=("forward_dynamics",), theta_variants=False)
        program = _compiled(package_view(package_info(model, "robot"), kernels, EmitOptions()), "loops.cpp")
        ends = [
            f"{one.first.joint + 1} {one.second.joint + 1} {_place(one.first.placement)} {_place(one.second.placement)}"
            for one in tree.loops
        ]
        mimic_map = MimicMap.of(robot.coordinates, robot.types)
        lines = [robot_as_numbers(tree), str(len(ends)), *ends, f"{robot.nv} {STATES} {ROUNDS}"]
        lines.append(_row(mimic_map.ratios.ravel()))
        q, qd, tau = states_of(robot, np.random.default_rng(SEED), STATES)
        motors = np.zeros((STATES, tree.nv))
        motors[:, list(robot.own_joints)] = tau
        states = (q, qd, tau, mimic_map.positions(q), mimic_map.rates(qd), motors)
        lines += [_row(*row) for row in zip(*states, strict=True)]
        (found,) = _printed(program, lines, folder)
    return found


def _place(placement: Placement) -> str:
    return _row(placement.rotation.ravel(), placement.translation)


def _row(*parts: Array) -> str:
    return " ".join(map(repr, np.concatenate(parts).tolist()))


def _printed(program: Path, lines: Sequence[str], folder: str) -> list[list[float]]:
    """Return the numbers that a program prints for an input of these lines, line by line."""
    given = Path(folder, "robot.txt")
    given.write_text("\n".join(lines))
    text = subprocess.run([program, given], check=True, capture_output=True, text=True).stdout
    return [list(map(float, line.split())) for line in text.splitlines()]


def _compiled(package: PackageView, rival_source: str = "contacts.cpp") -> Path:
    """The program: the package's sources by the C compiler, and Pinocchio's headers by the C++ compiler, once for all
    robots."""
    flags = native_flags()
    theirs = [flag for flag in flags if not flag.startswith(GCC_ONLY)]
    compile_theirs = [cxx(), "-std=c++17", *theirs, "-DNDEBUG", *DEFINES, *includes(pinocchio_prefix())]
    sources = {
        rival_source: Path(__file__).with_name(rival_source).read_text(encoding="utf-8"),
        "pinocchio_model.hpp": source("pinocchio_model.hpp"),
    }
    command = [*compile_theirs, "-c", rival_source, "-o", "rival.o"]
    rival = built("rival.o", command, sources, [version_of("pin")])
    compile_ours = ["cc", "-std=c99", *flags, "-Iinclude", "-c", *package.sources]
    link = [cxx(), "*.o", str(rival), "-o", "contacts", "-lm"]
    script = f"{' '.join(compile_ours)} && {' '.join(link)}"
    return built("contacts", ["sh", "-c", script], library_files(package), [version_of("pin")])


if __name__ == "__main__":
    sys.exit(main())
