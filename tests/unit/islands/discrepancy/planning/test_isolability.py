"""Isolability: causes with equal responses, expected ratios, and detectable strengths."""

from math import inf, isnan

import numpy as np
import pytest

from islands.discrepancy.effects import CATALOGUE
from islands.discrepancy.planning.isolability import MISFITS, find_isolability
from islands.discrepancy.planning.pair_separation import separate_pairs
from islands.discrepancy.planning.response_dictionary import ResponseDictionary
from islands.discrepancy.planning.separation import require_detection
from support.planned import amplifier_experiment, make_cause, make_pair, take_effects, wave

SLOW, FAST = wave((0.25,)), wave((0.5, 3.0, 7.0))

#: The gain of the amplifier is known within 1 %.
KNOWN = {"k": 0.01}


def test_gains_of_input_and_sensor_are_separable_at_no_strength() -> None:
    experiment = amplifier_experiment(FAST, prior_std=KNOWN)
    found = find_isolability(experiment, take_effects("input-gain", "sensor-gain", "offset"))
    assert found.misfits[0, 1] == found.misfits[1, 0] == inf
    assert found.rows[0].ratios[1] == pytest.approx(0.0, abs=1e-6)
    assert found.groups == (("input-gain", "sensor-gain"),)
    assert np.isfinite(found.misfits[:2, 2]).all()


def test_a_gain_is_not_detectable_if_calibration_absorbs_it() -> None:
    found = find_isolability(amplifier_experiment(FAST), take_effects("sensor-gain", "offset"))
    assert found.undetectable == ("sensor-gain",)
    assert all(isnan(misfit) for misfit in found.rows[0].misfits)


def test_delay_and_lag_are_separable_with_a_fast_input_only() -> None:
    slow = amplifier_experiment(SLOW)
    pair = make_pair(slow, "delay", "sensor-lag")
    before, after = (separate_pairs(each, [pair])[0] for each in (slow, slow.with_input(FAST)))
    assert before.sufficiency < 0.5
    assert after.sufficiency > 2.0
    assert after.expected_ratio > 10.0 * before.expected_ratio


def test_expected_ratio_is_the_mean_of_ratios_of_noisy_data() -> None:
    """An offset c against a drift through the origin of free slope, by least squares."""
    experiment = amplifier_experiment(wave((0.25, 0.5)))
    found = find_isolability(experiment, take_effects("offset", "linear-drift"))
    offset = make_cause(experiment, "offset")
    rng = np.random.default_rng(0)
    dictionary = ResponseDictionary(experiment)
    drift = dictionary.get_model(CATALOGUE["linear-drift"])
    slopes = [drift.simulate(drift.insert(CATALOGUE["linear-drift"], (1.0,))[None])[0] - dictionary.output]
    absorbed = np.column_stack([dictionary.output, *slopes])
    complete = np.column_stack([absorbed[:, 0], np.ones(len(absorbed))])
    ratios = []
    for _ in range(400):
        noisy = offset.observed + rng.standard_normal(offset.observed.size)
        squares = [np.linalg.lstsq(design, noisy, rcond=None)[1][0] for design in (absorbed, complete)]
        ratios.append(squares[0] - squares[1])
    mean, deviation = np.mean(ratios), 2 * np.sqrt(np.mean(ratios))
    assert found.rows[0].ratios[1] == pytest.approx(mean, abs=4 * deviation / np.sqrt(len(ratios)))


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


def test_causes_are_at_most_separable_where_they_are_detectable() -> None:
    found = find_isolability(
        amplifier_experiment(FAST), take_effects("delay", "backlash", "dead-zone", "jump")
    )
    for index, row in enumerate(found.rows):
        assert row.detectable is not None
        others = [misfit for place, misfit in enumerate(row.misfits) if place != index]
        assert min(others) >= row.detectable.misfit
        assert all(misfit <= MISFITS[-1] or misfit == inf for misfit in others)


def test_progress_counts_the_causes() -> None:
    messages: list[tuple[str, float | None]] = []
    find_isolability(
        amplifier_experiment(SLOW),
        take_effects("offset", "linear-drift"),
        progress=lambda message, fraction=None: messages.append((message, fraction)),
    )
    assert messages == [("1 of 2 causes", 0.5), ("2 of 2 causes", 1.0)]
