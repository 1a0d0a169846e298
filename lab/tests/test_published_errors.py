"""Error and coverage on a test: of the free run after the initial samples, from no later output."""

from dataclasses import replace

import numpy as np
import pytest

from islands.errors import ModelError
from islands.expressions.parsing import parse
from islands.models.narx import make_model
from islands.records.coupled import CoupledRecord
from islands.records.dataset import Dataset
from islands.validation.ensemble import Ensemble, EnsembleStructure
from islands.validation.prediction_bands import LEVELS, PredictionBands
from lab.published_sets.definition import BenchmarkTest
from lab.published_sets.scoring import measure_coverage, measure_rmse
from support.coupled_systems import TWO_MASSES, make_coupled_record
from support.latent_systems import make_model as make_latent
from support.latent_systems import spring_record


def narx(terms, **changes):
    model = make_model([(parse(text), value) for text, value in terms.items()], ("u",), "y", 0.1)
    return replace(model, **changes)


def lag_record(samples, offset=0.0):
    """Return a record of ``y(k) = 0.8 y(k-1) + u(k-1)``; from sample 20 on, the outputs have an offset."""
    u, y = np.random.default_rng(samples).standard_normal(samples), np.zeros(samples)
    for k in range(1, samples):
        y[k] = 0.8 * y[k - 1] + u[k - 1]
    y[20:] += offset
    return Dataset(u, y, 0.1)


def test_the_error_is_that_of_the_scored_samples():
    """The offset is an error of each scored sample, and does not reach the simulation."""
    model = narx({"y(k-1)": 0.8, "u(k-1)": 1.0})
    assert measure_rmse(model, BenchmarkTest(lag_record(60), 10, 10)) == pytest.approx(0.0, abs=1e-12)
    shifted = BenchmarkTest(lag_record(60, 3.0), 10, 10)
    assert measure_rmse(model, shifted) == pytest.approx(3.0 * (40 / 50) ** 0.5)
    assert measure_rmse(model, replace(shifted, unscored=30)) == pytest.approx(3.0)


def test_a_latent_model_takes_the_initial_samples_only():
    """Its memory is 20 samples, the benchmark allows 9."""
    record = spring_record(400)
    assert make_latent().maximum_lag > 9
    assert measure_rmse(make_latent(), BenchmarkTest(record, 9, 9)) == pytest.approx(0.0, abs=1e-3)
    noisy = replace(record, y=np.concatenate([record.y[:9], record.y[9:] + 1.0]))
    assert measure_rmse(make_latent(), BenchmarkTest(noisy, 9, 9)) == pytest.approx(1.0, rel=1e-3)


def test_predictions_of_means_are_held():
    """A model of means of three samples predicts a constant; the last sample of the segment is in no mean."""
    record = replace(lag_record(61), y=np.full(61, 2.0), dt=0.1 / 3)
    model = narx({"y(k-1)": 1.0}, average=3)
    assert measure_rmse(model, BenchmarkTest(record, 10, 10)) == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(ModelError, match="needs 3 initial samples"):
        measure_rmse(model, BenchmarkTest(record, 2, 2))


def test_the_error_of_several_outputs_is_that_of_all():
    record = make_coupled_record(TWO_MASSES, 200)
    assert measure_rmse(TWO_MASSES, BenchmarkTest(record, 10, 10)) == pytest.approx(0.0, abs=1e-9)
    one, other = record.records
    shifted = CoupledRecord((one, replace(other, y=np.concatenate([other.y[:10], other.y[10:] + 2.0]))))
    assert measure_rmse(TWO_MASSES, BenchmarkTest(shifted, 10, 10)) == pytest.approx(2.0**0.5)


def bands(model, half_width):
    """Return bands of one half-width at all levels, whose ensemble is the model alone."""
    ensemble = Ensemble((EnsembleStructure(model, 1.0, np.array([model.parameters])),))
    return PredictionBands(ensemble, half_width, half_width, dict.fromkeys(LEVELS, 1.0))


def test_the_coverage_is_the_fraction_of_the_scored_samples_inside_of_the_band():
    """From sample 20 on, the outputs have an offset of 3."""
    model = narx({"y(k-1)": 0.8, "u(k-1)": 1.0})
    test = BenchmarkTest(lag_record(60, 3.0), 10, 10)
    assert measure_coverage(model, (bands(model, 2.0),), test) == pytest.approx(10 / 50)
    assert measure_coverage(model, (bands(model, 4.0),), test) == 1.0
    assert measure_coverage(model, (bands(model, 2.0),), replace(test, unscored=30)) == 0.0
    assert measure_coverage(model, (), test) is None


def test_the_coverage_of_several_outputs_is_that_of_all():
    one, other = make_coupled_record(TWO_MASSES, 200).records
    shifted = CoupledRecord((one, replace(other, y=np.concatenate([other.y[:10], other.y[10:] + 2.0]))))
    found = bands(TWO_MASSES, 1.0)
    assert measure_coverage(TWO_MASSES, (found, found), BenchmarkTest(shifted, 10, 10)) == 0.5
