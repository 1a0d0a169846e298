"""Prediction bands: order of levels, coverage, units, exact laws."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import islands
from islands.errors import ModelError, SettingsError
from islands.systems.signals import filtered_noise


@cache
def record(noise=0.02, samples=600, seed=0, scale=1.0):
    rng = np.random.default_rng(seed)
    u = filtered_noise(1.0, samples, 0.1, seed)
    y = np.zeros(samples)
    for k in range(1, samples):
        y[k] = 0.6 * y[k - 1] + 0.3 * u[k - 1] + 0.2 * y[k - 1] * u[k - 1]
    return islands.Dataset(u, scale * (y + noise * rng.standard_normal(samples)), 1.0)


@cache
def result(noise=0.02, scale=1.0):
    return islands.fit(record(noise, scale=scale), library="polynomial", degree=2, lags=2, max_terms=4)


@pytest.mark.ci
def test_a_band_contains_its_free_run():
    data = record(seed=1)
    for model in result().models:
        band = model.bands(data)
        assert band.y == pytest.approx(model.simulate(data).y, nan_ok=True)
        known = ~np.isnan(band.y)
        assert known.sum() == data.samples - model.warm_up
        assert (band.lower < band.y)[known].all()
        assert (band.y < band.upper)[known].all()


def test_the_coverage_of_new_records_is_near_the_level():
    inside = []
    for seed in range(1, 6):
        data = record(seed=seed)
        band = result().best.bands(data)
        inside.append(np.mean(((band.lower <= data.y) & (data.y <= band.upper))[2:]))
    assert np.mean(inside) == pytest.approx(0.9, abs=0.04)


def drive(samples, seed, amplitude):
    """A lag behind a saturation, which no polynomial of the second degree describes outside of the data."""
    u, x = amplitude * filtered_noise(1.0, samples, 0.1, seed), np.zeros(samples)
    for k in range(1, samples):
        x[k] = 0.8 * x[k - 1] + 0.2 * np.tanh(3.0 * u[k - 1])
    return islands.Dataset(u, x + 0.002 * np.random.default_rng(seed).standard_normal(samples), 1.0)


@pytest.mark.ci
def test_a_band_allows_for_the_error_of_the_structure_outside_of_the_data():
    best = islands.fit(drive(600, 0, 1.0), library="polynomial", degree=2, lags=2, max_terms=4).best
    new = drive(600, 1, 2.0)

    def cover(bands):
        band = bands.predict(best.model, new)
        return np.mean(((band.lower <= new.y) & (new.y <= band.upper))[2:])

    bands = best.prediction_bands
    assert bands.data_range.predictable > 0.5
    assert cover(replace(bands, data_range=None)) < 0.8
    assert cover(bands) > 0.85


@pytest.mark.parametrize("level", [0.0, 0.49, 0.995, 1.0, float("nan")])
def test_a_level_without_a_band_is_refused(level):
    with pytest.raises(SettingsError, match=r"between 0\.5 and 0\.99"):
        result().best.bands(record(), level)


def test_a_model_without_bands_says_why():
    best = result().best
    unknown = replace(best, prediction_bands=None)
    with pytest.raises(ModelError, match="no prediction bands"):
        unknown.bands(record())
    without = replace(best, _search_result=replace(best.search_result, ensemble=None))
    with pytest.raises(ModelError, match="no ensemble"):
        _ = without.inclusion
