"""Assessment of a model: metrics, outcomes and tests of every part and mode."""

import math
from dataclasses import astuple

import numpy as np
import pytest

import islands
from islands.errors import RecordError
from islands.records.dataset import Dataset, join
from islands.records.split import Split
from islands.simulation.predictors import free_run, multiple_shooting, one_step_ahead
from islands.validation.assessment import MODES, PARTS, assess
from islands.validation.metrics import metrics

SHOOTING = 7


def model(terms, names=("u",)):
    return islands.make_model([(islands.parse(text), theta) for text, theta in terms.items()], names)


LINEAR = model({"y(k-1)": 0.7, "u(k-1)": 0.5, "u(k-2)": 0.2})
#: Stable for small outputs. It diverges for outputs above 1.0, and in a single step for very large outputs.
EXPLOSIVE = model({"y(k-1)": 0.5, "y(k-1)^3": 0.5, "u(k-1)": 0.3})


def record(samples, seed=0, size=1.0, noise=0.1):
    rng = np.random.default_rng(seed)
    u, y = size * rng.uniform(-1, 1, samples), np.zeros(samples)
    for k in range(2, samples):
        y[k] = 0.7 * y[k - 1] + 0.5 * u[k - 1] + 0.2 * u[k - 2] + noise * size * rng.normal()
    return Dataset(u, y, 0.1)


PARTS_OF_DATA = Split(record(200), record(90, seed=1))


def runs(data, warm_up=None):
    return dict(
        zip(
            MODES,
            (
                one_step_ahead(LINEAR, data, warm_up),
                multiple_shooting(LINEAR, data, SHOOTING, warm_up),
                free_run(LINEAR, data, warm_up),
            ),
            strict=True,
        )
    )


@pytest.mark.parametrize("warm_up", [None, 10])
def test_metrics_of_every_part_and_mode_are_those_of_its_simulation(warm_up):
    found = assess(LINEAR, PARTS_OF_DATA, SHOOTING, warm_up)
    assert list(found.metrics) == list(found.outcomes) == list(PARTS) == ["estimation", "validation"]
    for part, data in zip(PARTS, (PARTS_OF_DATA.estimation, PARTS_OF_DATA.validation), strict=True):
        assert list(found.metrics[part]) == list(found.outcomes[part]) == list(MODES)
        for mode, run in runs(data, warm_up).items():
            assert found.metrics[part][mode] == metrics(data.y, run.y)
            assert found.outcomes[part][mode] == run.outcome
    errors = [found.metrics["estimation"][mode].rmse for mode in MODES]
    assert errors == sorted(errors)
    assert len(set(errors)) == 3


@pytest.mark.parametrize(("constraints", "free"), [("none", 6), ("hysteresis", 4)])
def test_information_criteria_count_only_free_parameters(constraints, free):
    # Two clusters, {y(k-1), y(k-2)} and {u(k-1), u(k-2)}, impose one constraint each.
    terms = {
        "y(k-1)": 0.9,
        "y(k-2)": 0.1,
        "u(k-1)": 0.5,
        "u(k-2)": -0.5,
        "phi2(u(k-1), u(k-2))": 0.1,
        "u(k-1)*phi1(u(k-1), u(k-2))": 0.1,
    }
    data = PARTS_OF_DATA.estimation
    residual = data.y - one_step_ahead(model(terms), data).y
    squares = float(np.nansum(residual**2))
    found = assess(model(terms), PARTS_OF_DATA, SHOOTING, constraints=constraints).information
    assert found.aic == pytest.approx(198 * math.log(squares / 198) + 2 * free, rel=1e-12)
    assert found.bic == pytest.approx(198 * math.log(squares / 198) + free * math.log(198), rel=1e-12)
    assert found.fpe == pytest.approx(squares / 198 * (198 + free) / (198 - free), rel=1e-12)


# Divergence.


def test_diverged_simulation_has_no_metrics_and_names_the_sample():
    found = assess(EXPLOSIVE, Split(record(200), record(90, seed=1, size=3.0)), 200)
    for mode in ("multiple_shooting", "free_run"):
        assert all(math.isnan(value) for value in astuple(found.metrics["validation"][mode]))
        assert not found.outcomes["validation"][mode]
        assert "at sample" in found.outcomes["validation"][mode].reason
    assert found.outcomes["validation"]["one_step_ahead"]
    assert math.isfinite(found.metrics["validation"]["one_step_ahead"].rmse)
    assert all(found.outcomes["estimation"].values())
    assert math.isfinite(found.metrics["estimation"]["free_run"].rmse)
    assert found.residual_tests.ljung_box > 0.0


def record_with_spike(samples, seed=1):
    """Return a record whose output has one very large sample."""
    data = record(samples, seed)
    y = data.y.copy()
    y[40] = 1e6
    return Dataset(data.u, y, 0.1)


def test_one_step_ahead_divergence_fails_every_residual_test():
    found = assess(EXPLOSIVE, Split(record(200), record_with_spike(90)), SHOOTING)
    assert found.outcomes["validation"]["one_step_ahead"].reason.endswith("at sample 41")
    assert math.isnan(found.metrics["validation"]["one_step_ahead"].rmse)
    tests = found.residual_tests
    assert not tests.passed
    assert math.isnan(tests.whiteness_p)
    assert math.isnan(tests.ljung_box)
    assert len(tests.tests) == 5
    for test in tests.tests:
        assert not test.passed
        assert test.note.startswith("diverged: |y| left ")
        assert test.note.endswith(" at sample 41")
    assert math.isfinite(found.information.aic)


def test_estimation_divergence_makes_information_criteria_nan():
    found = assess(EXPLOSIVE, Split(record_with_spike(200), record(90)), SHOOTING)
    assert not found.outcomes["estimation"]["one_step_ahead"]
    assert all(math.isnan(value) for value in astuple(found.information))
    assert math.isfinite(found.metrics["validation"]["one_step_ahead"].rmse)
    assert found.residual_tests.ljung_box > 0.0


# Several recordings and short recordings.


def test_errors_of_the_recordings_add_up_to_those_of_the_part():
    recordings = [record(80, 1), record(60, 2)]
    found = assess(LINEAR, Split(record(200), join(tuple(recordings))), SHOOTING)
    whole = found.metrics["validation"]["free_run"]
    first, second = found.recordings["validation"].values()
    assert whole.mape == pytest.approx((78 * first.mape + 58 * second.mape) / 136, rel=1e-12)
    assert 136 * whole.rmse**2 == pytest.approx(78 * first.rmse**2 + 58 * second.rmse**2, rel=1e-12)
    assert found.recordings["estimation"] == {}


@pytest.mark.parametrize(("residuals", "lag"), [(3, 1), (4, 1), (7, 2), (20, 9), (52, 25), (80, 25)])
def test_short_validation_part_is_tested_at_fewer_lags(residuals, lag):
    found = assess(LINEAR, Split(record(200), record(residuals + 2)), SHOOTING)
    assert found.residual_tests.tests[0].lags.tolist() == list(range(lag + 1))


@pytest.mark.parametrize(("samples", "warm_up"), [(3, 2), (4, 2), (12, 10)])
def test_validation_part_with_too_few_residuals_is_refused(samples, warm_up):
    with pytest.raises(RecordError) as caught:
        assess(LINEAR, Split(record(200), record(samples)), SHOOTING, warm_up)
    assert str(caught.value) == (
        f"the longest recording of the validation data has {samples} samples, of which the warm-up takes "
        f"{warm_up}: testing the residual takes 3 more; give a longer recording"
    )


def test_validation_part_without_a_prediction_is_refused():
    with pytest.raises(RecordError, match="the longest recording has 2 samples and the warm-up takes 2"):
        assess(LINEAR, Split(record(200), record(2)), SHOOTING)


# Errors of every sample.


def test_the_errors_of_a_diverged_free_run_are_infinite():
    found = assess(EXPLOSIVE, Split(record(200), record(90, seed=1, size=3.0)), 200)
    assert np.isinf(found.errors[200:]).all()
