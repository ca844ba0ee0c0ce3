"""Condition numbers of exciting motions of the virtual Denso: the table of docs/calibration.md.

python docs/excitation.py [--seeds N] [--condition]

The same limits and period for all, and the criterion of `psdmc excite`, or the condition number alone. Condition numbers
are those of the scaled columns of the fit along one period; "less" says how many times the criterion is below
that of the best random motion. Last column: the condition number of the rows which the linear fit makes of such a
motion's log, six periods at 250 Hz with the plant's position sensors, filtered and differentiated.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from psdmc.calibration.identify.linear_problem import LinearOptions, linear_problem
from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.motions.allowed import Allowed
from psdmc.calibration.motions.criterion import FitColumns, all_columns, inertial_columns, scaled
from psdmc.calibration.motions.excite import Excitation, excite
from psdmc.calibration.motions.excite_options import ExciteOptions, chosen_objective
from psdmc.calibration.motions.limited_sines import LimitedSines, from_rest_to_rest
from psdmc.calibration.plant.virtual_robot import load_virtual_robot, simulate
from psdmc.compiler import compile as compile_model
from psdmc.compiler import derive
from psdmc.model.dynamics_model import DynamicsModel

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
HARMONICS = ((1, 2, 3), (1, 2, 3, 4, 5))


def in_the_fit(model: DynamicsModel, robot: Regressor, found: Excitation) -> float:
    """Condition number of the scaled rows of the linear fit of a log of the motion."""
    plant = load_virtual_robot(EXAMPLES / "plants" / "denso_virtual.toml")
    motion = from_rest_to_rest(found.motion, model.mechanism, 4e-3, 6, Allowed(model.mechanism).faults)
    log = simulate(plant, motion)
    motors = Motors.torques(model.n)
    problem, _ = linear_problem(
        model.mechanism, robot, model.l, [log], LinearOptions(), motors, lambda step: None
    )
    return scaled(np.concatenate([block.columns for block in problem.rows])).condition


def drawn_conditions(model: DynamicsModel, columns: FitColumns, options: ExciteOptions, count: int) -> float:
    """Best of the first `count` random motions."""
    space = LimitedSines(model.mechanism, options)
    points = space.drawn(count, np.random.default_rng(options.seed))
    states = (space.placed(point).states for point in points)
    return min(scaled(columns.at(*(part.T for part in each))).condition for each in states)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--condition", action="store_true")
    given = parser.parse_args()
    objective = chosen_objective(given.condition, False)
    model = derive(EXAMPLES / "robots" / "denso_wall.toml", drive_inertia=True)
    robot = compile_model(model, functions=["regressor"])
    fits = {
        "one log: all columns": all_columns(robot, model.l, LinearOptions()),
        "four steps: inertial columns": inertial_columns(model.mechanism, robot, model.l),
    }
    print(
        "| columns | harmonics | seed | found | best of 300 | best of 1000 | times | less | CPU s | in the fit |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    for what, columns in fits.items():
        for harmonics in HARMONICS:
            for seed in range(1, given.seeds + 1):
                options = ExciteOptions(harmonics=harmonics, seed=seed, objective=objective)
                begin = time.process_time()
                found = excite(model.mechanism, columns, options)
                spent = time.process_time() - begin
                few, many = (drawn_conditions(model, columns, options, count) for count in (300, 1000))
                rows = f"{in_the_fit(model, robot, found):.2f}" if columns.terms is not None else ""
                print(
                    f"| {what} | {len(harmonics)} | {seed} | {found.condition:.2f} | {few:.1f} |"
                    f" {many:.1f} | {many / found.condition:.2f} | {found.times:.2f} | {spent:.0f} | {rows} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
