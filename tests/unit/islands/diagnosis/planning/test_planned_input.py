"""Inputs of experiments: limits of amplitude and rate, and reproducibility."""

import numpy as np
import pytest

from islands.diagnosis.planning.planned_input import (
    InputForm,
    InputLimits,
    PlannedInput,
    find_limits,
    find_rate,
)
from islands.errors import SettingsError
from support.planned import DT, wave

SAMPLES = 500


@pytest.mark.parametrize("form", InputForm)
@pytest.mark.parametrize("frequency", [0.8, 4.0, 11.0])
@pytest.mark.parametrize("rate", [3.0, 40.0, np.inf])
def test_an_input_stays_within_its_limits(form: InputForm, frequency: float, rate: float) -> None:
    limits = InputLimits(1.0, 4.0, rate)
    u = PlannedInput(form, 1.0, frequency, 0.4, seed=3).make(limits, DT, SAMPLES)
    assert u.shape == (SAMPLES,)
    assert limits.contains(u, DT)
    assert np.ptp(u) > 0.0


def test_an_input_depends_on_its_seed_alone() -> None:
    limits = InputLimits(-1.0, 1.0)
    for form in (InputForm.MULTISINE, InputForm.STEPS):
        one, again, other = (
            PlannedInput(form, 0.5, 4.0, 0.4, seed).make(limits, DT, SAMPLES) for seed in (1, 1, 2)
        )
        assert np.array_equal(one, again)
        assert not np.array_equal(one, other)


def test_steps_hold_their_levels() -> None:
    u = PlannedInput(InputForm.STEPS, 1.0, 2.0).make(InputLimits(-1.0, 1.0, 20.0), DT, SAMPLES)
    resting = np.diff(u) == 0.0
    assert 0.7 < np.mean(resting) < 1.0
    assert np.max(u) == pytest.approx(1.0)
    assert np.min(u) == pytest.approx(-1.0)


def test_limits_are_those_of_the_input_by_default() -> None:
    u = 3.0 + wave((1.0,))
    limits = find_limits(u, DT)
    assert (limits.lower, limits.upper) == (np.min(u), np.max(u))
    assert limits.rate == find_rate(u, DT)
    wider = find_limits(u, DT, amplitude=5.0, rate=2.0)
    assert wider.amplitude == pytest.approx(5.0)
    assert wider.middle == pytest.approx(limits.middle)
    assert not limits.contains(u * 1.1, DT)


def test_impossible_limits_are_refused() -> None:
    with pytest.raises(SettingsError, match="positive amplitude"):
        find_limits(wave((1.0,)), DT, amplitude=-1.0)
    with pytest.raises(SettingsError, match="positive rate"):
        find_limits(wave((1.0,)), DT, rate=0.0)
