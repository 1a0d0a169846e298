"""Error metrics and information criteria: hand calculations, edge cases and errors."""

import dataclasses
import math

import numpy as np
import pytest

from islands.errors import IslandsError, SettingsError
from islands.validation.metrics import information_criteria, metrics

Y = np.array([0.0, 1.0, 4.0, 3.0])
YHAT = np.array([0.0, 2.0, 4.0, 1.0])


def test_metrics_match_a_hand_calculation():
    # Errors 0, -1, 0, 2 on a range of 4; the mean is 2, the squared deviations 4 + 1 + 4 + 1.
    found = metrics(Y, YHAT)
    assert found.mape == pytest.approx(100 * 3 / (4 * 4))
    assert found.r2 == pytest.approx(1 - 5 / 10)
    assert found.rmse == pytest.approx(math.sqrt(5 / 4))
    assert found.fit_percent == pytest.approx(100 * (1 - math.sqrt(5 / 10)))


def test_metrics_except_rmse_do_not_depend_on_unit_and_offset():
    here, there = metrics(Y, YHAT), metrics(1e-6 * Y + 3e-6, 1e-6 * YHAT + 3e-6)
    assert (there.mape, there.r2, there.fit_percent) == pytest.approx((here.mape, here.r2, here.fit_percent))
    assert there.rmse == pytest.approx(1e-6 * here.rmse)


def test_samples_with_a_nan_on_either_side_are_ignored():
    measured = np.concatenate(([100.0, 5.0], Y, [math.nan]))
    predicted = np.concatenate(([math.nan, math.nan], YHAT, [7.0]))
    assert metrics(measured, predicted) == metrics(Y, YHAT)


@pytest.mark.parametrize("samples", [0, 3])
def test_metrics_without_a_common_sample_are_nan(samples):
    found = metrics(np.ones(samples), np.full(samples, math.nan))
    assert all(math.isnan(value) for value in dataclasses.astuple(found))


def test_constant_output_only_has_an_rmse():
    # 0.1 is not a binary fraction: the rounding of the mean must not count as variation.
    found = metrics(np.full(7, 0.1), np.full(7, 0.4))
    assert found.rmse == pytest.approx(0.3)
    assert math.isnan(found.mape)
    assert math.isnan(found.r2)
    assert math.isnan(found.fit_percent)


@pytest.mark.parametrize(
    ("measured", "predicted"), [(np.ones(3), np.ones(4)), (np.ones((3, 1)), np.ones((3, 1)))]
)
def test_arrays_of_different_shape_are_refused(measured, predicted):
    with pytest.raises(SettingsError, match=r"two \(samples,\) arrays of one length, got \(3,"):
        metrics(measured, predicted)


def test_information_criteria_match_a_hand_calculation():
    # rss / N = 0.5, N = 100, p = 4.
    found = information_criteria(50.0, 100, 4)
    assert found.aic == pytest.approx(100 * math.log(0.5) + 8)
    assert found.bic == pytest.approx(100 * math.log(0.5) + 4 * math.log(100))
    assert found.fpe == pytest.approx(0.5 * 104 / 96)


@pytest.mark.parametrize("samples", [0, 4, 5])
def test_more_parameters_than_samples_are_refused(samples):
    with pytest.raises(IslandsError, match=f"{samples} samples are too few for 5 parameters"):
        information_criteria(1.0, samples, 5)


@pytest.mark.parametrize(("rss", "parameters"), [(-1.0, 2), (1.0, -2)])
def test_negative_sums_and_counts_are_refused(rss, parameters):
    with pytest.raises(SettingsError, match="never negative"):
        information_criteria(rss, 10, parameters)
