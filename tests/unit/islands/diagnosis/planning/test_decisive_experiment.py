"""Decisive experiment: it separates more than the given input, within limits, and is reproducible."""

import numpy as np
import pytest

from islands.diagnosis.planning.decisive_experiment import DecisiveExperiment, design_experiment
from islands.diagnosis.planning.planned_input import InputLimits, find_rate
from support.planned import DT, amplifier_experiment, make_pair, wave

LIMITS = InputLimits(-1.0, 1.0, 30.0)


def design(seed: int = 0) -> DecisiveExperiment:
    experiment = amplifier_experiment(wave((0.25,), 400))
    pair = make_pair(experiment, "delay", "sensor-lag")
    return design_experiment(experiment, [pair], LIMITS, 400, seed)


@pytest.mark.ci
def test_the_input_separates_a_pair_that_the_given_one_does_not() -> None:
    found = design()
    assert found.before[0].sufficiency < 1.0 < found.after[0].sufficiency
    assert found.u.shape == (400,)
    assert LIMITS.contains(found.u, DT)
    assert find_rate(found.u, DT) <= 30.0 * (1 + 1e-9)
    assert np.array_equal(found.u, design().u)
