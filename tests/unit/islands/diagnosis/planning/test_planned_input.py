"""Inputs of experiments: limits of amplitude and rate, and reproducibility."""

import numpy as np
import pytest

from islands.diagnosis.planning.planned_input import (
    InputForm,
    InputLimits,
    PlannedInput,
    find_limits,
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


def test_impossible_limits_are_refused() -> None:
    with pytest.raises(SettingsError, match="positive amplitude"):
        find_limits(wave((1.0,)), DT, amplitude=-1.0)
    with pytest.raises(SettingsError, match="positive rate"):
        find_limits(wave((1.0,)), DT, rate=0.0)
