"""Certainty of a name that a further record may refute: a coloured remainder, or values that are open."""

from dataclasses import replace

import numpy as np
import pytest

import islands
from islands.diagnosis.calibration.preparation import make_target
from islands.diagnosis.confidence_limits import (
    MAX_CONFIDENCE,
    MAX_CONFIDENCE_WITHOUT_GAIN,
    limit_confidences,
)

LAG, STICTION = (
    tuple(each for each in islands.EFFECTS if each.name == name) for name in ("sensor-lag", "stiction")
)
DT, PROCESS, SENSOR = 0.1, 2.0, 0.6


def make_sensor_record(growth, samples=800):
    """Return a process behind a sensor whose lag grows with its error, with white noise."""
    rng = np.random.default_rng(3)
    u = np.repeat(rng.standard_normal(samples // 10), 10)
    y, level, shown = np.zeros(samples), 0.0, 0.0
    for k in range(samples):
        y[k] = shown
        for _ in range(10):
            error = level - shown
            level += DT / 10.0 * (u[k] - level) / PROCESS
            shown += DT / 10.0 * error / (SENSOR * (1.0 + growth * abs(error)))
    return islands.Dataset(u, y + 0.002 * rng.standard_normal(samples), DT)


@pytest.mark.ci
def test_a_name_that_leaves_a_coloured_error_is_no_more_than_probable():
    right, near = (
        islands.diagnose(make_sensor_record(growth), "linear:1", effects=LAG) for growth in (0.0, 8.0)
    )
    assert [each.claimed_names for each in (right, near)] == [("sensor-lag",)] * 2
    assert right.causes[0].confidence > 0.95
    assert near.causes[0].confidence <= MAX_CONFIDENCE
    assert near.noise_claim.correlation_time > 0.0
    assert right.refusal is near.refusal is None
    unstable = replace(right, trial=replace(right.trial, is_unstable=True))
    limited = limit_confidences(unstable, make_target(right.record, right.estimation_samples, {}))
    assert [each.confidence for each in limited.causes] == [MAX_CONFIDENCE_WITHOUT_GAIN]


@pytest.mark.nightly
def test_a_valve_that_sticks_behind_a_held_input_is_no_more_than_probable():
    rng = np.random.default_rng(4)
    held = np.repeat(rng.standard_normal(40), 25)
    valve = np.zeros(held.size)
    for k in range(1, held.size):
        valve[k] = held[k] if abs(held[k] - valve[k - 1]) > 0.9 else valve[k - 1]
    y = np.zeros(held.size)
    for k in range(1, held.size):
        y[k] = y[k - 1] + DT / PROCESS * (valve[k - 1] - y[k - 1])
    record = islands.Dataset(held, y + 0.005 * rng.standard_normal(y.size), DT)
    found = islands.diagnose(record, "linear:1", effects=STICTION)
    assert found.claimed_names == ("stiction",)
    assert found.causes[0].confidence == MAX_CONFIDENCE
    interval = found.causes[0].parameters["breakaway"].ci95
    assert interval is not None
    assert interval[0] < 0.9 < interval[1]
