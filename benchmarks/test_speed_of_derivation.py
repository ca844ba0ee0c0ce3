"""A warm derivation with E, P and certificate; its peak of memory, from a process of its own, stands in extra_info."""

from __future__ import annotations

from pathlib import Path

import pytest

from psdmc.bench.__main__ import SEED, eight_joints
from psdmc.bench.case import generic_chain
from psdmc.bench.cases import bundled_chain, derive_fresh
from psdmc.derivation.derive import derive_model
from psdmc.robot.load import load_robot
from psdmc.robot.mechanism import Mechanism

MIB = 2**20
STANDARD = ("KR6", "LBR7")
ROBOTS = Path(__file__).resolve().parents[1] / "examples" / "robots"

CASES = {
    "scara": {"size": (69, 8), "rounds": 5, "bound_s": 0.5, "bound_mib": 1536},
    "denso_wall": {"size": (1318, 32), "rounds": 5, "bound_s": 0.5, "bound_mib": 1536},
    "denso_floor": {"size": (1295, 30), "rounds": 5, "bound_s": 0.5, "bound_mib": 1536},
    "KR6": {"size": (6086, 36), "rounds": 5, "bound_s": 0.5, "bound_mib": 1536},
    "LBR7": {"size": (21295, 43), "rounds": 3, "bound_s": 3.0, "bound_mib": 1536},
    "LBR7 and a joint": {"size": (72039, 50), "rounds": 1, "bound_s": 20.0, "bound_mib": 6144},
}
"""Published sizes, and what the project asks of time and memory; time is reported, memory is held."""


def chain_of(name: str) -> Mechanism:
    if name == "LBR7 and a joint":
        return generic_chain(eight_joints(bundled_chain("LBR7")), SEED)
    return bundled_chain(name) if name in STANDARD else load_robot(ROBOTS / f"{name}.toml").chain


@pytest.mark.parametrize("name", CASES)
def test_derivation(benchmark, name):
    chain, case = chain_of(name), CASES[name]
    derive_model(chain, expand=False)

    model = benchmark.pedantic(derive_model, (chain,), rounds=case["rounds"])

    assert (model.p, model.l) == case["size"]
    benchmark.extra_info["bound_s"] = case["bound_s"]


@pytest.mark.parametrize("name", CASES)
def test_peak_of_memory(benchmark, name):
    found = benchmark.pedantic(derive_fresh, (chain_of(name),), rounds=1)

    if found.peak_bytes is not None:
        benchmark.extra_info["peak_mib"] = round(found.peak_bytes / MIB)
        assert found.peak_bytes <= CASES[name]["bound_mib"] * MIB
