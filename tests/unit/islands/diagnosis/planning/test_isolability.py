"""Isolability: causes with equal responses, expected ratios, and detectable strengths."""

import numpy as np
import pytest
import scipy

from islands.diagnosis.planning.isolability import find_isolability
from islands.diagnosis.planning.pair_separation import separate_pairs
from islands.diagnosis.planning.separation import require_detection
from support.planned import (
    amplifier_experiment,
    coloured_noise,
    make_pair,
    noise_covariance,
    take_effects,
    wave,
    with_noise,
)

SLOW, FAST = wave((0.25,)), wave((0.5, 3.0, 7.0))


def test_delay_and_lag_are_separable_with_a_fast_input_only() -> None:
    slow = amplifier_experiment(SLOW)
    pair = make_pair(slow, "delay", "sensor-lag")
    before, after = (separate_pairs(each, [pair])[0] for each in (slow, slow.with_input(FAST)))
    assert before.sufficiency < 0.5
    assert after.sufficiency > 2.0
    assert after.expected_ratio > 10.0 * before.expected_ratio


@pytest.mark.parametrize("coefficients", [(), (0.9,), (1.6, -0.7)])
def test_expected_ratio_is_the_quadratic_form_of_the_covariance(coefficients: tuple[float, ...]) -> None:
    """An offset against a drift through the origin of free slope, by generalised least squares."""
    experiment = with_noise(amplifier_experiment(wave((0.25, 0.5))), coloured_noise(0.2, *coefficients))
    found = find_isolability(experiment, take_effects("offset", "linear-drift"))
    reference = found.rows[0].reference
    assert reference is not None
    fitted = experiment.estimation_samples
    covariance = noise_covariance(0.2, coefficients, fitted)
    offset = np.full(fitted, reference.values[0])
    absorbed = np.column_stack([experiment.context.u[:fitted], np.arange(fitted)])
    precise = scipy.linalg.solve(covariance, absorbed, assume_a="pos")
    left = offset - absorbed @ np.linalg.solve(absorbed.T @ precise, precise.T @ offset)
    ratio = left @ scipy.linalg.solve(covariance, left, assume_a="pos")
    assert found.rows[0].ratios[1] == pytest.approx(ratio, rel=1e-3)


def test_detectable_strength_has_the_distance_that_detection_requires() -> None:
    experiment = amplifier_experiment(FAST, noise_std=0.02)
    effects = take_effects("offset", "backlash", "linear-drift")
    found = find_isolability(experiment, effects)
    for effect, row in zip(effects, found.rows, strict=True):
        assert row.detectable is not None
        required = require_detection(experiment, effect, 3) / experiment.estimation_samples**0.5
        assert row.detectable.misfit == pytest.approx(required, rel=0.1)
        assert row.detectable.misfit_in_output == pytest.approx(0.02 * row.detectable.misfit)
    # The offset of a calibrated amplifier is the misfit itself, apart from the part that the gain absorbs.
    offset = found.rows[0].detectable
    assert offset is not None
    assert offset.unit == "um"
    assert abs(offset.value) == pytest.approx(offset.misfit_in_output, rel=0.2)
