"""Noise of a measured output: its colour from repeated periods, and a bound from a residual."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from islands.diagnosis.inference import noise_floor
from islands.diagnosis.planning.channel_noise import ChannelNoise, NoiseOrigin
from islands.diagnosis.planning.experiment_setup import make_experiment
from islands.effects.interface.context import Signal
from islands.errors import RecordError
from islands.records.dataset import Dataset
from lab.diagnosis.injection.noise import NOISES
from support.planned import amplifier, input_record, wave

#: Four periods of 2.5 s, of which the first three are used for estimation.
SAMPLES, PERIODIC = 1600, wave((0.4, 2.0), 1600)

APERIODIC = scipy.signal.lfilter([0.4], [1.0, -0.9], np.random.default_rng(3).standard_normal(1600))


def measure(u: Signal, kind: str, error: float = 0.0) -> Dataset:
    """Return a record of an amplifier with noise of standard deviation 0.05 and an even error."""
    noise = NOISES[kind](np.random.default_rng(7), u)
    return replace(input_record(u), y=2.0 * u + error * u**2 + 0.05 * noise)


def estimate(record: Dataset) -> ChannelNoise:
    return make_experiment(record, amplifier(), None, {})[0].noise


@pytest.mark.parametrize(
    ("u", "origin"), [(PERIODIC, NoiseOrigin.PERIODS), (APERIODIC, NoiseOrigin.RESIDUAL)]
)
@pytest.mark.parametrize(("kind", "pole"), [("white", 0.0), ("ar", 0.9)])
def test_the_colour_of_the_noise_is_found(
    u: Signal, origin: NoiseOrigin, kind: str, pole: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(noise_floor, "RANDOM_FEATURES", 20)
    found = estimate(measure(u, kind))
    assert found.origin == origin
    assert found.model.largest_pole == pytest.approx(pole, abs=0.03)
    assert found.std == pytest.approx(0.05, rel=0.15)


def test_a_drift_is_noise_with_at_most_the_duration_as_time_constant() -> None:
    drifting = replace(input_record(PERIODIC), y=2.0 * PERIODIC + 0.01 * np.arange(SAMPLES))
    found = estimate(drifting)
    assert 20.0 < found.time_constant <= SAMPLES


@pytest.mark.parametrize("u", [PERIODIC, APERIODIC])
def test_an_output_without_noise_is_refused(u: Signal) -> None:
    with pytest.raises(RecordError, match="no noise"):
        estimate(replace(input_record(u), y=2.0 * u))
