"""Certainty of a name next to a coloured remainder, which may have another cause."""

from dataclasses import replace

import numpy as np
import pytest

import islands
from islands.diagnosis.calibration.preparation import make_target
from islands.diagnosis.coloured_remainder import (
    MAX_CONFIDENCE,
    MAX_CONFIDENCE_WITHOUT_GAIN,
    limit_confidences,
)

LAG = tuple(each for each in islands.EFFECTS if each.name == "sensor-lag")
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
    assert "probably lacks" in near.summary
    assert right.refusal is near.refusal is None


@pytest.mark.ci
def test_an_extension_without_gain_and_with_coloured_rest_is_not_offered():
    found = islands.diagnose(make_sensor_record(8.0), "linear:1", effects=LAG)
    lost = replace(found, gain=replace(found.gain, ci95=(-5.0, 20.0)))
    limited = limit_confidences(lost, make_target(lost.record, lost.estimation_samples, {}))
    assert [each.confidence for each in limited.causes] == [MAX_CONFIDENCE_WITHOUT_GAIN]
    assert "not reduce the error on the hold-out part" in limited.refusal
