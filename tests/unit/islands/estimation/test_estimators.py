"""The table of estimators, and the measured bias of least squares."""

import pytest

from islands.errors import SettingsError
from islands.estimation.estimate import estimate
from islands.estimation.estimator_table import ESTIMATORS
from islands.estimation.estimators import estimate_with, least_squares_bias
from islands.evolution.settings import Settings
from islands.expressions.parsing import parse
from islands.models.narx import make_model
from islands.models.regressor import regressor
from islands.simulation.outcome import EvaluationOutcome, Status
from support.noisy_records import TERMS, coverage, make_noisy_record

STRUCTURE = [regressor(parse(text))[1] for text in TERMS]

#: The estimator that is recommended for every kind of noise.
RECOMMENDED = {"equation": "least-squares", "output": "free-run", "arma": "extended-least-squares"}


def start(record):
    return estimate(STRUCTURE, record)


@pytest.mark.ci
@pytest.mark.parametrize(("noise", "estimator"), RECOMMENDED.items())
def test_intervals_of_the_recommended_estimator_contain_the_true_parameters(noise, estimator):
    records = [make_noisy_record(noise, seed, 1000) for seed in range(30)]
    found = coverage([estimate_with(estimator, start(record), record).model for record in records])
    # Of 30 intervals with a probability of 0.95, fewer than 24 contain the parameter with probability 1e-4.
    assert (found >= 24 / 30).all()
    assert found.mean() > 0.88


@pytest.mark.parametrize("noise", ["output", "arma"])
def test_intervals_of_least_squares_miss_the_true_pole_under_coloured_noise(noise):
    records = [make_noisy_record(noise, seed, 3000) for seed in range(5)]
    assert coverage([start(record).model for record in records])[0] == 0.0
    assert min(least_squares_bias(start(record).model, record) for record in records) > 4.0


def test_every_estimator_recovers_the_parameters_of_noise_free_data():
    record = make_noisy_record("equation", 0, 400, 0.0)
    first = start(record)
    for name in ESTIMATORS:
        found = estimate_with(name, first, record, shooting=50)
        assert found.model.theta == pytest.approx((0.9, 0.3, -0.1), abs=1e-9), name
        assert (found.least_squares_bias is None) == (name == "least-squares")


def test_extended_least_squares_meets_the_constraints_of_hysteresis():
    texts = ("y(k-1)", "y(k-2)", "u(k-1) - u(k-2)")
    structure = [regressor(parse(text))[1] for text in texts]
    record = make_noisy_record("output", 2, 1000)
    first = estimate(structure, record, "hysteresis")
    found = estimate_with("extended-least-squares", first, record, "hysteresis")
    assert found.noise
    assert sum(found.model.theta[:2]) == pytest.approx(1.0, abs=1e-12)
    free = make_model([(parse("y(k-1)"), 0.5), (parse("u(k-1)"), 1.0)])
    bad = estimate_with("extended-least-squares", estimate(free.regressors, record), record, "hysteresis")
    assert isinstance(bad, EvaluationOutcome)
    assert bad.verdict is Status.INFEASIBLE


def test_failed_estimate_of_the_bias_is_an_outcome():
    record = make_noisy_record("equation", 0, 100)
    without_y = make_model([(parse("u(k-1)"), 1.0)])
    assert isinstance(least_squares_bias(without_y, record, "hysteresis"), EvaluationOutcome)


def test_unknown_estimator_is_refused():
    record = make_noisy_record("equation", 0, 100)
    with pytest.raises(SettingsError, match="unknown estimator 'kalman'"):
        estimate_with("kalman", start(record), record)
    with pytest.raises(SettingsError, match=r"estimator is one of .* got 'kalman'"):
        Settings(estimator="kalman")
