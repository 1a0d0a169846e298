"""Choice of a sampling rate: an oversampled record with noise is averaged, any other is not."""

import json

import numpy as np
import pytest
from scipy.signal import lfilter

import islands
from islands.facade.trials.rate_selection import TrialLibrary, select_rate
from islands.records.averaging import average_samples
from islands.records.dataset import Dataset, join
from islands.records.split import split
from islands.report.documents.result_folder import write_result

LIBRARY = {"library": "polynomial", "degree": 2, "max_terms": 4}
TRIAL = TrialLibrary("polynomial", 2, 3, "none")


def lag(noise=0.05, samples=8000, seed=0):
    """Return a lag of 60 samples behind a static nonlinearity, with slow inputs and measurement noise.

    Linear models of the free run do not need averages.
    """
    t, rng = np.arange(samples), np.random.default_rng(seed)
    u = sum(np.sin(2 * np.pi * t / period + period) for period in (400, 730, 1170))
    y = lfilter([0.0, 1 - np.exp(-1 / 60)], [1.0, -np.exp(-1 / 60)], u + 0.2 * u**2)
    return Dataset(u + noise * rng.normal(size=samples), y + noise * rng.normal(size=samples), 0.001)


@pytest.fixture(scope="module")
def averaged():
    return islands.fit(lag(), **LIBRARY)


def true_error(result, seed=1):
    """Return the RMSE of the free run on a new noisy record, relative to the output without noise."""
    count = result.search_result.average
    run = result.best.simulate(lag(seed=seed))
    error = run.y - average_samples(lag(noise=0.0), count).y
    return np.sqrt(np.nanmean(error**2))


@pytest.mark.ci
def test_averaging_a_noisy_oversampled_record_reduces_the_error(averaged):
    assert averaged.search_result.average > 1
    noisy = islands.fit(lag(), average=1, estimator="least-squares", **LIBRARY)
    assert true_error(averaged) < true_error(noisy) / 3


def white(samples=8000):
    """Return a record whose input changes completely from sample to sample."""
    u = np.random.default_rng(0).normal(size=samples)
    return Dataset(u, lfilter([0.0, 0.5], [1.0, -0.5], u), 1.0)


@pytest.mark.parametrize(
    ("record", "least"),
    [
        (white(), 6),
        (lag(samples=1000), 6),
        (join(tuple(lag(samples=100, seed=seed) for seed in range(40))), 60),
        (Dataset(lag().u, lag().y, 0.001, input_names=("u+1",)), 6),
        (Dataset(np.zeros(8000), np.zeros(8000), 1.0), 6),
    ],
    ids=["not oversampled", "short", "short recordings", "read early", "constant"],
)
def test_a_record_that_permits_no_means_keeps_its_sampling_time(record, least):
    data = split(record)
    assert select_rate(data, "auto", TRIAL, least) == (data, 1)


@pytest.mark.ci
@pytest.mark.parametrize("noise", [0.01, 0.05, 0.3])
def test_a_record_with_little_or_much_noise_is_averaged(noise):
    assert select_rate(split(lag(noise)), "auto", TRIAL, 6)[1] > 1


# A shooting interval lasts the same time at every rate.

SHORT = lag(samples=2000)


def fit_with_shooting(record, validation=0.25, **changes):
    return islands.fit(record, validation=validation, estimator="shooting", **LIBRARY, **changes)


def identify_in_two_epochs(record, validation=0.25, **changes):
    budget = {"generations": 2, "migrate_every": 1, "population": 10, "max_terms": 3, "library_degree": 1}
    small = {"max_height": 1, "shifts": (1,), "from_library": 0.0, "feedthrough": "no"}
    return islands.identify(record, validation=validation, preset="narx", **budget, **small, **changes)


def measurements(result):
    return [(each.model.parameters, each.metrics) for each in result.models]


@pytest.mark.ci
def test_a_resumed_run_on_means_equals_an_uninterrupted_one():
    states = []
    found = identify_in_two_epochs(SHORT, average=5, on_epoch=lambda state, _: states.append(state))
    resumed = identify_in_two_epochs(SHORT, average=5, start=states[0])
    assert measurements(resumed) == measurements(found)


def test_a_simulation_over_shooting_intervals_has_the_reported_error(tmp_path):
    found = fit_with_shooting(SHORT, average=5, shooting=52)
    run = found.best.simulate(split(SHORT).validation, "shooting")
    rmse = found.best.metrics["validation"]["multiple_shooting"].rmse
    assert run.mean_squared_error**0.5 == pytest.approx(rmse)
    write_result(found.search_result, tmp_path)
    document = json.loads((tmp_path / "result.json").read_text())
    assert document["settings"]["shooting"] == 52
    assert document["preprocessing"]["shooting_interval"] == 10
    assert islands.load(tmp_path / "models/01.json").shooting_interval == 10
