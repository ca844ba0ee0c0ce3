"""Models and compiled robots go to other processes: a worker opens the library that is there, or builds it once."""

from __future__ import annotations

import copy
import multiprocessing
import os
import pickle
import shlex
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model
from traced import arm_package

import psdmc
from psdmc.errors import InputError
from psdmc.toolchain.call import CompiledRobot
from psdmc.toolchain.compile import compile_library
from psdmc.toolchain.compiler_command import find_compiler
from psdmc.toolchain.interface import interface_of

STATES = np.random.default_rng(5).uniform(-1.0, 1.0, (8, 2))


@pytest.fixture(scope="module")
def robot() -> CompiledRobot:
    return psdmc.compile(bundled_model("two_link"), functions=["gravity", "inverse_dynamics"])


@pytest.mark.parametrize("name", ["two_link", "scara", "rounded_arm"])
def test_a_model_arrives_whole_and_read_only(name: str) -> None:
    model = bundled_model(name)
    for found in (pickle.loads(pickle.dumps(model)), copy.deepcopy(model), copy.copy(model)):
        assert found.content_hash == model.content_hash
        for array in (found.B, found.theta_b, found.E, found.mechanism.parameters, found.certificate):
            assert not array.flags.writeable
        assert not found.mechanism.joints[0].placement.rotation.flags.writeable
        assert found.mechanism.types == model.mechanism.types


def test_in_its_own_process_a_robot_is_itself(robot: CompiledRobot) -> None:
    assert copy.copy(robot) is robot
    assert copy.deepcopy({"robot": robot})["robot"] is robot
    assert pickle.loads(pickle.dumps(robot)) is robot
    assert pickle.loads(pickle.dumps(robot.gravity))(STATES[0]).tolist() == robot.gravity(STATES[0]).tolist()


def test_a_pickle_holds_no_machine_code(robot: CompiledRobot) -> None:
    data = pickle.dumps(robot)
    assert b"\x7fELF" not in data
    assert len(data) < 20_000


def test_a_robot_of_its_functions_alone_stays_one(robot: CompiledRobot) -> None:
    with pytest.raises(InputError, match="mass_matrix was not compiled"):
        pickle.loads(pickle.dumps(robot)).mass_matrix(STATES)


def test_a_package_without_its_model_cannot_be_pickled() -> None:
    package = arm_package(names=["gravity"])
    with pytest.raises(TypeError, match=r"only robots from psdmc\.compile can be pickled"):
        pickle.dumps(CompiledRobot(interface_of(package), compile_library(package)))


@pytest.mark.parametrize("start", ["fork", "spawn", "forkserver"])
def test_pools_of_processes_call_it(robot: CompiledRobot, start: str) -> None:
    with multiprocessing.get_context(start).Pool(2) as pool:
        found = pool.map(robot.gravity, list(STATES))
    assert np.array_equal(found, robot.gravity(STATES))


def test_joblib_calls_it(robot: CompiledRobot) -> None:
    joblib = pytest.importorskip("joblib")
    calls = (joblib.delayed(robot.inverse_dynamics)(q, q, q) for q in STATES)
    found = joblib.Parallel(n_jobs=2)(calls)
    assert np.array_equal(found, robot.inverse_dynamics(STATES, STATES, STATES))


def test_threads_call_it(robot: CompiledRobot) -> None:
    wrong: list[int] = []
    expected = robot.gravity(STATES)

    def calls() -> None:
        wrong.extend(k for k in range(2000) if not np.array_equal(robot.gravity(STATES), expected))

    threads = [threading.Thread(target=calls) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


WORKER = """
import pickle, sys
from pathlib import Path
robot = pickle.loads(Path(sys.argv[1]).read_bytes())
print(robot.gravity([0.1, 0.2]).tolist())
"""


def noting_compiler(folder: Path) -> tuple[Path, Path]:
    """A compiler that notes each library that it links, and the file of its notes."""
    script, notes = folder / "cc", folder / "notes"
    text = f'#!/bin/sh\ncase "$*" in *-shared*) echo "$*" >> {notes};; esac\n'
    script.write_text(f'{text}exec {shlex.join(find_compiler().command)} "$@"\n', encoding="utf-8")
    script.chmod(0o755)
    notes.touch()
    return script, notes


def linked(notes: Path) -> int:
    """Libraries of robots that were linked."""
    return sum("library.so" in line for line in notes.read_text().splitlines())


def test_workers_that_start_together_build_once_and_later_ones_never(
    robot: CompiledRobot, tmp_path: Path
) -> None:
    """On a machine whose cache is empty."""
    script, notes = noting_compiler(tmp_path)
    (tmp_path / "robot").write_bytes(pickle.dumps(robot))
    here = {**os.environ, "CC": str(script), "PSDMC_CACHE_DIR": str(tmp_path / "cache")}
    words = [sys.executable, "-c", WORKER, str(tmp_path / "robot")]

    workers = [subprocess.Popen(words, env=here, stdout=subprocess.PIPE, text=True) for _ in range(3)]
    said = {worker.communicate(timeout=300)[0] for worker in workers}

    assert said == {f"{robot.gravity([0.1, 0.2]).tolist()}\n"}
    assert linked(notes) == 1
    assert subprocess.run(words, env=here, capture_output=True, text=True, check=True).stdout in said
    assert linked(notes) == 1
