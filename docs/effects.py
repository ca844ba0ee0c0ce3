"""What each choice of the factored lowering, and each pass, saves: the tables of docs/factored.md, docs/passes.md
and docs/derivatives.md.

python docs/effects.py choices [ROBOT ...]    mul + add of inverse dynamics, choice by choice
python docs/effects.py passes [ROBOT ...]     operations per function with all passes, and with one left out
python docs/effects.py orders [ROBOT ...]     longest dependency chain and values alive, with and without the last passes
python docs/effects.py derivatives [ROBOT ...]  mul + add of derivatives by recursion and by differentiating programs
python docs/effects.py directions [ROBOT ...]  mul + add of gradients, derivatives along directions, integrator steps

ROBOT is one of `psdmc.bench.cases` (KR6, LBR7, Denso, UR5, Panda, "generic 6R" ...): its geometry standing on the floor,
with generic physical inertias.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Literal
from unittest.mock import patch

from psdmc.bench.cases import standard_chains
from psdmc.derivation.derive import derive_model
from psdmc.dynamics.choices import Choices
from psdmc.dynamics.frames import Frame, base_acceleration, frames_of
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.dynamics.parameters import bodies_of, joint_frame_map
from psdmc.dynamics.spatial import body_from_parameters
from psdmc.functions import RECIPES
from psdmc.lower.expanded import lowering as expanded
from psdmc.lower.factored import Arrangement, trace_dynamics, trace_geometry
from psdmc.lower.kernels import lower
from psdmc.lower.reframe import reframe
from psdmc.lower.search import Search, all_feet
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.program.cost import SINGLE, cost
from psdmc.program.passes.fuse_sums import cycles, fuse_sums
from psdmc.program.passes.schedule import live_values, schedule
from psdmc.program.pipeline import LAST, LONGEST, ROUND, Pass, optimize
from psdmc.program.program import Op, Program, Slot
from psdmc.program.slopes import Block, TurnedPairs, jacobians
from psdmc.program.trace import Tracer
from psdmc.robot.mechanism import Mechanism
from psdmc.target.presets import COSTS

LAST_FOR_ONE_STATE: tuple[Pass, ...] = (fuse_sums, schedule)
TEN = slice(0, 10)
PREVIOUS: Literal["previous"] = "previous"
INVERSE = RECIPES["inverse_dynamics"]
Row = tuple[str, Sequence[int | str]]


def model_of(robot: str) -> DynamicsModel:
    return derive_model(standard_chains()[robot](), expand=False)


def operations(program: Program) -> int:
    """mul + add after all passes."""
    return cost(optimize(program)).total


def choices(robot: str) -> Iterator[Row]:
    """Each line adds one choice to those above it."""
    model = model_of(robot)
    chain = model.mechanism
    plain = reframe(chain, (PREVIOUS,) * len(chain))
    search = Search(chain, model.representative, model.theta_b)

    def best(candidates: Iterator[Arrangement]) -> int:
        return min(operations(trace_dynamics(INVERSE, one, search.robot)) for one in candidates)

    first = next(search.starts((PREVIOUS,) * len(chain)))
    compound, fold = Choices(compound=True), Choices(compound=True, fold=True)
    yield "the file's frames, all link parameters", [operations(in_file_frames(chain))]
    yield (
        "link frames by the modified DH convention",
        [operations(in_frames(chain, plain.frames, plain.base_acceleration, plain))],
    )
    yield "as many link parameters zero as possible", [best(iter([first]))]
    yield "one rotation for parallel neighbouring axes", [best(iter([replace(first, choices=compound)]))]
    yield "last body in the frame before its joint", [best(iter([replace(first, choices=fold)]))]
    yield "cheapest combination of these ideas", [best(search.starts((PREVIOUS,) * len(chain)))]
    yield (
        "cheapest place of each frame on its axis",
        [best(one for feet in all_feet(chain) for one in search.starts(feet))],
    )
    found = search.best(INVERSE, SINGLE)
    yield (
        "a length of the robot as unit of length",
        [operations(trace_dynamics(INVERSE, found, search.robot))],
    )


def in_file_frames(chain: Mechanism) -> Program:
    """Newton-Euler over the chain as it stands, all ten parameters of every link."""
    bodies = bodies_of(chain, chain.parameters)
    return _traced(frames_of(chain), bodies, base_acceleration(chain))


def in_frames(chain: Mechanism, frames: Sequence[Frame], base, reframed) -> Program:  # type: ignore[no-untyped-def]
    """The same over the re-framed chain, its links' parameters moved to the new frames."""
    bodies = [
        body_from_parameters((joint_frame_map(place) @ x[TEN]).tolist())
        for place, x in zip(reframed.link_frames, chain.parameters, strict=True)
    ]
    return _traced(frames, bodies, base)


def _traced(frames, bodies, base) -> Program:  # type: ignore[no-untyped-def]
    tracer, n = Tracer(), len(frames)
    q, qd, qdd = (tracer.symbols(name, n) for name in ("q", "qd", "qdd"))
    tau = inverse_dynamics(frames, bodies, [0.0] * n, q, qd, qdd, base)
    return tracer.finish([(Slot("tau", i), value) for i, value in enumerate(tau)])


EXPANDED_LIMIT = 7000
"""The expanded lowering of inverse dynamics is shown up to this many functions; beyond, it takes minutes."""


def programs_of(robot: str) -> dict[str, Program]:
    """Programs as lowering makes them, before any pass."""
    model = derive_model(standard_chains()[robot]())
    assert model.theta_b is not None
    search = Search(model.mechanism, model.representative, model.theta_b)
    found = search.best(INVERSE, SINGLE)
    programs = {
        "inverse": trace_dynamics(RECIPES["inverse_dynamics"], found, search.robot),
        "with theta": trace_dynamics(INVERSE, found, replace(search.robot, theta_b=None)),
        "forward": trace_dynamics(RECIPES["forward_dynamics"], found, search.robot),
        "mass": trace_dynamics(RECIPES["mass_matrix"], found, search.robot),
        "regressor": trace_geometry(RECIPES["regressor"], found.reframed, search.robot),
    }
    if model.p is not None and model.p <= EXPANDED_LIMIT:
        with patch.object(expanded, "optimize", lambda program, costs: program):
            programs["expanded"] = expanded.lower_expanded(model, INVERSE, False)
    return programs


def passes(robot: str) -> Iterator[Row]:
    """Operations of all kinds: what the pipeline minimizes."""
    found = programs_of(robot)
    programs = list(found.values())
    yield "", list(found)
    yield "as lowered", [_weight(program) for program in programs]
    yield "all passes", [_weight(optimize(program)) for program in programs]
    for left_out in dict.fromkeys((*ROUND, *LAST_FOR_ONE_STATE)):
        kept = [_weight(optimized_without((left_out,), program)) for program in programs]
        yield f"without {left_out.__name__}", kept


def optimized_without(left_out: Sequence[Pass], program: Program) -> Program:
    """As pipeline.optimize, some passes missing."""
    for _ in range(LONGEST):
        shorter = _applied([one for one in ROUND if one not in left_out], program)
        if _weight(shorter) >= _weight(program):
            break
        program = shorter
    return _applied([one for one in (*LAST, *LAST_FOR_ONE_STATE) if one not in left_out], program)


def _applied(some: Sequence[Pass], program: Program) -> Program:
    for one in some:
        program = one(program)
    return program


def _weight(program: Program) -> int:
    counted = cost(program)
    return counted.total + counted.div + counted.neg


def orders(robot: str) -> Iterator[Row]:
    """Cycles of the longest dependency chain (latencies of the default target, sines apart), and values alive per
    instruction, of one state's inverse dynamics."""
    program = programs_of(robot)["inverse"]
    variants = {
        "neither fuse_sums nor schedule": optimized_without((fuse_sums, schedule), program),
        "fuse_sums": optimized_without((schedule,), program),
        "schedule": optimized_without((fuse_sums,), program),
        "both": optimize(program),
    }
    for name, one in variants.items():
        yield name, [longest_chain(one), round(live_values(one) / len(one))]


def longest_chain(program: Program) -> int:
    """Cycles from sines and cosines to the last output on a machine that is never short of ports."""
    uses = program.uses()
    ready: list[int] = []
    for instr in program.body:
        start = max((ready[a] for a in instr.args), default=0)
        if instr.op in (Op.LOAD, Op.CONST, Op.SIN, Op.COS):
            ready.append(0)
            continue
        products = [a for a in instr.args if program.body[a].op is Op.MUL and uses[a] == 1]
        if instr.op in (Op.ADD, Op.SUB) and products:
            fused = max(products, key=lambda a: ready[a])
            others = [ready[a] for a in instr.args if a != fused]
            start = max([*others, *(ready[a] for a in program.body[fused].args)])
            ready.append(start + COSTS.latency.fused)
        else:
            ready.append(start + cycles(COSTS.latency)[instr.op])
    return max(ready[i] for _, i in program.outputs)


def derivatives(robot: str) -> Iterator[Row]:
    """d tau / d q, d tau / d qd and M, without tau; of forward dynamics with qdd."""
    model = model_of(robot)
    names = ("inverse_dynamics", "inverse_dynamics_derivatives", "forward_dynamics_derivatives")
    kernels = lower(model, "factored", names, theta_variants=False)
    n, inverse = model.n, kernels["inverse_dynamics"].single
    blocks = [Block(f"by_{name}", "tau", name, n, n) for name in ("q", "qd", "qdd")]
    for mode in ("forward", "reverse"):
        whole = jacobians(inverse, blocks, mode)
        only = Program(whole.body, tuple(out for out in whole.outputs if out[0].vector != "tau"))
        yield f"inverse dynamics, {mode} mode over its PROGRAM", [operations(only)]
    yield "inverse dynamics, by recursion", [cost(kernels[names[1]].single).total]
    yield "forward dynamics", [cost(kernels[names[2]].single).total]


DIRECTIONS = (
    "inverse_dynamics_vjp",
    "inverse_dynamics_vjp_parameters",
    "inverse_dynamics_jvp",
    "forward_dynamics_vjp",
    "forward_dynamics_vjp_parameters",
    "forward_dynamics_jvp",
)
REST = (
    "inverse_dynamics",
    "forward_dynamics",
    "mass_matrix_inverse",
    "gravity_derivatives",
    "semi_implicit_euler",
    "semi_implicit_euler_derivatives",
    "rk4_step",
    "inverse_dynamics_second_derivatives",
    "forward_dynamics_second_derivatives",
)


def directions(robot: str) -> Iterator[Row]:
    """Gradients and directional derivatives: with sines and cosines differentiated, with turned vectors as each other's
    slopes, and that without the value; then functions that lean on the same."""
    model = model_of(robot)

    def singles(names: Sequence[str]) -> dict[str, Program]:
        found = lower(model, "factored", names, theta_variants=False)
        return {name: found[name].single for name in names}

    programs = singles(DIRECTIONS)
    with patch.object(TurnedPairs, "of", lambda self, index: None):
        plain = singles(DIRECTIONS)
    for name in DIRECTIONS:
        value = RECIPES[name].signature.outputs[0].name
        whole = programs[name]
        alone = Program(whole.body, tuple(out for out in whole.outputs if out[0].vector != value))
        yield name, [cost(plain[name]).total, cost(whole).total, operations(alone)]
    for name, program in singles(REST).items():
        yield name, ["", cost(program).total]


TABLES: dict[str, Callable[[str], Iterator[Row]]] = {
    "choices": choices,
    "passes": passes,
    "orders": orders,
    "derivatives": derivatives,
    "directions": directions,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("table", choices=TABLES)
    parser.add_argument("robots", nargs="*", default=["KR6", "LBR7"])
    options = parser.parse_args()
    for robot in options.robots:
        print(robot)
        for label, figures in TABLES[options.table](robot):
            print(f"  {label:<44}" + "".join(f"{figure:>11}" for figure in figures))


if __name__ == "__main__":
    main()
