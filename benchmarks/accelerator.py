"""Compare the functions of two robots on an NVIDIA GPU with those of the CPU, then time them.

`make bench-accelerator` runs this. First, each function computes the same random states on the GPU and on the CPU, where
psdmc.compile is tested against Pinocchio. Then a table gives states per second and the share of the bandwidth: the bytes
of a function's inputs and outputs per second, divided by those that a copy within the GPU's memory reads and writes in the
same run. Each figure is the median of several trials, each of which lasts long enough for the clock of the CPU. A call of
the method, which the table times too, contains the work of Python.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import math
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import psdmc
from psdmc.backends.cuda.back_end import BLOCK, symbol_of
from psdmc.backends.info import EmitOptions
from psdmc.bench.cases import LEGGED, robot_data
from psdmc.emission import EmitRequest, cuda_source
from psdmc.errors import InputError, exit_status_of
from psdmc.files import write_whole
from psdmc.functions import DEFAULT, SIGNATURES
from psdmc.lower.admitted import wanted
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import on_joints
from psdmc.program.signature import Quantity, Signature, Sizes
from psdmc.progress import silent
from psdmc.toolchain.cuda_libraries import DEFAULT_STREAM, Driver, machine_code
from psdmc.toolchain.cuda_robot import DeviceArray

KR6 = Path(__file__).resolve().parents[1] / "examples" / "robots" / "kr6.toml"
FUNCTIONS = (*DEFAULT, "inverse_dynamics_derivatives", "forward_dynamics_derivatives", "forward_dynamics_vjp")
TIMED = ("inverse_dynamics", "forward_dynamics", "mass_matrix", *FUNCTIONS[-3:])
GOALS = {
    ("kr6", "inverse_dynamics"): 0.6,
    ("kr6", "forward_dynamics"): 0.6,
    ("kr6", "inverse_dynamics_derivatives"): 0.5,
    ("kr6", "forward_dynamics_derivatives"): 0.5,
    ("hyq", "inverse_dynamics"): 0.3,
    ("hyq", "forward_dynamics"): 0.3,
}
"""Share of the bandwidth in float32, of the layout `states` at its best batch."""
BATCHES = (1024, 16_384, 131_072, 1_048_576)
COMPARED, SEED, TRIALS, SHORTEST = 1000, 4, 7, 0.02
"""States that are compared, seed of all states, trials of a time, and s that a trial lasts at least."""
EXACT = {"float64": 1e-9, "float32": 1e-2}
"""Differences, as shares of a function's largest value, from which the command fails. The CPU computes in float64."""


def models(names: Sequence[str]) -> Iterator[tuple[str, DynamicsModel]]:
    """An arm, and a quadruped on a floating base."""
    if unknown := set(names) - {"kr6", "hyq"}:
        raise InputError(f"there is no robot {min(unknown)!r}", "choose from kr6, hyq")
    if "kr6" in names:
        yield "kr6", psdmc.derive(KR6)
    if "hyq" in names:
        yield "hyq", psdmc.derive(robot_data() / LEGGED["hyq"], floating=True)


def drawn(model: DynamicsModel, inputs: Sequence[Quantity], count: int, real: str) -> list[np.ndarray]:
    """Random states, with quaternions of length one."""
    chain, rng = model.mechanism, np.random.default_rng(SEED)
    sizes = Sizes.of(model.mechanism, model.l)
    found = []
    for quantity in inputs:
        values = quantity.drawn(rng.uniform(-1.0, 1.0, (count, *sizes.shape(quantity.axes))))
        found.append((on_joints(chain, values) if quantity.axes == ("nq",) else values).astype(real))
    return found


def differences(
    driver: Driver, model: DynamicsModel, real: Any, names: Sequence[str], device: str
) -> dict[str, float]:
    """Largest difference of each function between GPU and CPU, as a share of its largest value."""
    gpu: Any = psdmc.compile(model, functions=names, real=real, target=device)
    cpu: Any = psdmc.compile(model, functions=names)
    found = {}
    for name in names:
        given = drawn(model, SIGNATURES[name].inputs, COMPARED, real)
        ours = getattr(gpu, name)(*(DeviceArray.of(driver, each) for each in given))
        theirs = getattr(cpu, name)(*(np.asarray(each, np.float64) for each in given))
        pairs = zip(*((each if isinstance(each, tuple) else (each,)) for each in (ours, theirs)), strict=True)
        errors = [
            np.abs(own.numpy() - other).max() / max(np.abs(other).max(), 1e-300) for own, other in pairs
        ]
        found[name] = float(np.max(errors))  # NaN counts, other than for max
    return found


def seconds(driver: Driver, start: Callable[[], Any]) -> float:
    """Median time of one of many launches."""
    start()
    driver.wait(DEFAULT_STREAM)
    count, trials = 1, []
    while len(trials) < TRIALS:
        begin = time.perf_counter()
        for _ in range(count):
            start()
        driver.wait(DEFAULT_STREAM)
        lasted = time.perf_counter() - begin
        if lasted < SHORTEST:
            count, trials = math.ceil(count * min(2.0 * SHORTEST / lasted, 100.0)), []
        else:
            trials.append(lasted / count)
    return statistics.median(trials)


def bandwidth(driver: Driver, size: int) -> float:
    """Bytes per second that a copy reads and writes."""
    one, other = (DeviceArray(driver, (size,), np.dtype(np.uint8)) for _ in range(2))
    return 2 * size / seconds(driver, lambda: driver.copy(other.place, one.place, size, DEFAULT_STREAM))


def timed(
    driver: Driver, model: DynamicsModel, real: Any, device: str, batches: Sequence[int]
) -> Iterator[tuple[str, str, int, float, int]]:
    """Function, layout, states, seconds of a launch, and bytes of one state."""
    source = cuda_source(model, EmitRequest("auto", TIMED, EmitOptions(real)), silent)
    code = machine_code(source.text, f"{source.robot}_KERNELS", driver.arch)
    robot: Any = psdmc.compile(model, functions=TIMED, real=real, target=device)
    for name in TIMED:
        function: Signature = SIGNATURES[name]
        tails = source.interface.kernels[name]
        symbols = [f"{symbol_of(source.robot, name)}_{layout}" for layout in ("rows", "states")]
        for count in batches:
            given = [
                DeviceArray.of(driver, each) for each in drawn(model, function.inputs, count, real)
            ]  # values do not change the time, so arrays of rows serve both layouts
            outs = [DeviceArray(driver, (count, *tail), given[0].dtype) for tail in tails]
            size = sum(math.prod(each.shape) * each.dtype.itemsize for each in (*given, *outs)) // count
            words: list[Any] = [ctypes.c_uint64(each.place) for each in (*given, *outs)]
            words += [ctypes.c_uint64(0)] if name in source.failing else []
            words.append(ctypes.c_longlong(count))
            for layout, kernel in zip(("rows", "states"), driver.kernels(code, symbols), strict=True):
                blocks = -(-count // BLOCK)
                lasts = seconds(
                    driver,
                    lambda kernel=kernel, blocks=blocks, words=words: driver.launch(
                        kernel, blocks, BLOCK, DEFAULT_STREAM, words
                    ),
                )
                yield name, layout, count, lasts, size
            method, out = getattr(robot, name), outs[0] if len(outs) == 1 else tuple(outs)
            lasts = seconds(driver, lambda method=method, given=given, out=out: method(*given, out=out))
            yield name, "method", count, lasts, size


def measure(options: argparse.Namespace) -> int:
    """Print both tables, and return the exit status."""
    driver, failed = Driver(int(options.device.partition(":")[2] or 0)), False
    copied = bandwidth(driver, options.copy)
    print(f"GPU {driver.name}; a copy reads and writes {copied / 1e9:.0f} GB/s")
    rows: list[dict[str, Any]] = []
    for robot, model in models(options.names):
        names = wanted(FUNCTIONS, model.mechanism)
        for real in ("float32", "float64"):
            print(f"\n{robot}, {real}: largest difference from the CPU, as a share of the largest value")
            for name, error in differences(driver, model, real, names, options.device).items():
                is_wrong = not error <= EXACT[real]
                failed = failed or is_wrong
                print(f"  {name:<32}{error:8.1e}{'  WRONG' if is_wrong else ''}")
            print(
                f"\n  {'function':<32}{'layout':<8}{'states':>9}{'ns/state':>10}{'states/s':>10}{'share':>7}"
            )
            for name, layout, count, lasts, size in timed(
                driver, model, real, options.device, options.batches
            ):
                share = size * count / lasts / copied
                goal = GOALS.get((robot, name)) if real == "float32" and layout == "states" else None
                said = "" if goal is None else f"  goal {goal:.0%}"
                print(
                    f"  {name:<32}{layout:<8}{count:>9,}{lasts / count * 1e9:10.3f}{count / lasts:10.2e}"
                    f"{share:7.0%}{said}"
                )
                rows.append(
                    {"robot": robot, "real": real, "function": name, "layout": layout, "states": count}
                    | {"seconds": lasts, "bytes per state": size, "share": share}
                )
    if options.json:
        write_whole(options.json, json.dumps({"gpu": driver.name, "copied": copied, "rows": rows}, indent=1))
    return 1 if failed else 0


def main(words: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", default=["kr6", "hyq"], help="of kr6, hyq; both if none is named")
    parser.add_argument("--device", default="cuda", help="cuda, or cuda:1 for the second GPU")
    parser.add_argument("--batches", nargs="*", type=int, default=BATCHES, help="numbers of states")
    parser.add_argument("--copy", type=int, default=1 << 29, help="bytes of the copy (default %(default)s)")
    parser.add_argument("--json", type=Path, help="write everything measured there")
    options = parser.parse_args(words)
    return exit_status_of(lambda: measure(options))


if __name__ == "__main__":
    sys.exit(main())
