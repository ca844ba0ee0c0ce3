"""What is wrong with a log is named, and nothing where nothing is wrong."""

from __future__ import annotations

from dataclasses import replace

import pytest

from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.logs.low_pass import FilterOptions
from psdmc.calibration.plant.spoiled import ALL, MOVED, noise_only, scaled, swapped, turned
from psdmc.calibration.verdict.evidence import Motion, evidence_of
from psdmc.calibration.verdict.suspects import suspect
from psdmc.model.grounds import cycles, exchanges, in_words

WRONG = {
    "the effort of every joint has the opposite sign": lambda log: scaled(log, -1.0),
    "effort of elbow has the opposite sign": lambda log: turned(log, 1, ["effort"]),
    "effort of shoulder has the opposite sign": lambda log: turned(log, 0, ["effort"]),
    "position of shoulder has the opposite sign": lambda log: turned(log, 0, MOVED),
    "position of elbow has the opposite sign": lambda log: turned(log, 1, MOVED),
    "position and effort of shoulder have the opposite sign": lambda log: turned(log, 0, ALL),
    "shoulder and elbow look swapped (effort)": lambda log: swapped(log, 0, 1, ["effort"]),
    "shoulder and elbow look swapped (position)": lambda log: swapped(log, 0, 1, MOVED),
    "shoulder and elbow look swapped (position and effort)": lambda log: swapped(log, 0, 1, ALL),
}


def suspected(arm, log, known: bool = True) -> str | None:
    model = arm.model if known else replace(arm.model, theta_b=None)
    found = suspect(
        evidence_of(model, arm.regressor, [Motion(log)], Motors.torques(2), FilterOptions(cutoff=8.0))
    )
    assert found is None or found.code == "columns"
    return None if found is None else found.words


@pytest.mark.parametrize("words", WRONG)
def test_what_is_wrong_is_named(arm, log, words: str):
    found = suspected(arm, WRONG[words](log))

    assert found is not None
    assert found.startswith(words)


@pytest.mark.parametrize("words", [text for text in WRONG if text.startswith(("the effort", "effort"))])
def test_friction_tells_signs_where_the_file_states_no_parameters(arm, log, words: str):
    found = suspected(arm, WRONG[words](log), known=False)

    assert found is not None
    assert words in found


@pytest.mark.parametrize("known", [True, False])
def test_a_good_log_is_not_suspected(arm, log, known: bool):
    assert suspected(arm, log, known) is None


@pytest.mark.parametrize("factor", [1e-3, 0.08, 1e3])
def test_a_unit_is_no_matter_of_signs_and_order(arm, log, factor: float):
    assert suspected(arm, scaled(log, factor)) is None


def test_noise_is_explained_by_nothing(arm, log):
    assert suspected(arm, noise_only(log)) is None


def test_permutations_fall_into_cycles():
    assert cycles((0, 2, 1, 4, 5, 3)) == [[1, 2], [3, 4, 5]]
    assert exchanges((0, 2, 1, 4, 5, 3)) == 3
    assert exchanges((0, 1, 2)) == 0


def test_hypotheses_in_words():
    names, here, plus = ("a", "b", "c"), (0, 1, 2), (1, 1, 1)

    assert in_words(names, here, plus, (1, 2, 0), plus) == "a, b and c look permuted (effort)"
    assert in_words(names, here, plus, here, (-1, 1, -1)) == "effort of a and c have the opposite sign"
    assert (
        in_words(names, (0, 2, 1), (-1, 1, 1), here, plus)
        == "b and c look swapped (position), and position of a has the opposite sign"
    )
