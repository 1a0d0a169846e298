"""Refinement: Levenberg-Marquardt on the shooting error, where the constraints leave room."""

from dataclasses import replace

import numpy as np
import pytest

from islands.data.dataset import Dataset, join
from islands.errors import ModelError, RecordError, SettingsError
from islands.estimation.estimate import estimate
from islands.estimation.refinement import RefinedModel, _Residual, refine
from islands.model.model import make_model
from islands.model.parsing import parse
from islands.simulation.outcome import EvaluationOutcome, Status
from islands.simulation.predictors import free_run, multiple_shooting
from islands.validation.physics import cluster_sums

HYSTERESIS = {
    "y(k-1)": 1.0,
    "phi1(u(k-1), u(k-2))": 0.8,
    "y(k-1)*phi2(u(k-1), u(k-2))*phi1(u(k-1), u(k-2))": -0.3,
    "u(k-1)*phi1(u(k-1), u(k-2))": 0.1,
}
#: Two terms of y and two of y u: their sums are 1 and 0.
CLUSTERED = {
    "y(k-1)": 0.7,
    "y(k-2)": 0.3,
    "u(k-1)*y(k-1)": 0.2,
    "u(k-2)*y(k-2)": -0.2,
    "phi1(u(k-1), u(k-2))": 0.5,
}


def model(terms):
    return make_model((parse(text), theta) for text, theta in terms.items())


def driven(terms, samples=600, seed=0, noise=0.0):
    """The free run of a model from rest on a slow input that goes both ways, and noise on it."""
    rng = np.random.default_rng(seed)
    u = np.cumsum(rng.normal(size=samples)) / 10
    blank = Dataset(u, np.where(np.arange(samples) < 2, 0.0, np.nan), 0.1)
    y = free_run(model(terms), blank).y
    y[:2] = 0.0
    return Dataset(u, y + noise * rng.normal(size=samples), 0.1)


def perturbed(terms, by=0.05):
    """Parameters off by some per cent; the linear y stays, so that the model does not run away."""
    return model(
        {
            text: theta * (1 + by * (-1) ** place * (text != "y(k-1)"))
            for place, (text, theta) in enumerate(terms.items())
        }
    )


def refined(*arguments, **options):
    found = refine(*arguments, **options)
    assert isinstance(found, RefinedModel), found
    return found


@pytest.mark.parametrize("interval", [1, 50, None])
def test_it_finds_the_true_parameters_from_perturbed_ones_on_noise_free_data(interval):
    record = driven(HYSTERESIS)
    found = refined(perturbed(HYSTERESIS), record, interval)
    assert found.before > 1e-8
    assert found.model.parameters == pytest.approx(model(HYSTERESIS).parameters, rel=1e-6)
    assert found.after < 1e-10 * found.before
    assert 2 <= found.steps <= 30


def test_within_the_constraints_it_finds_them_too():
    record = driven(CLUSTERED)
    start = model({**CLUSTERED, "y(k-1)": 0.65, "y(k-2)": 0.35, "u(k-1)*y(k-1)": 0.1, "u(k-2)*y(k-2)": -0.1})
    found = refined(start, record, 60, "hysteresis")
    assert found.model.parameters == pytest.approx(model(CLUSTERED).parameters, rel=1e-5)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("interval", [1, 40, None])
@pytest.mark.parametrize("constraints", ["none", "hysteresis"])
def test_the_shooting_error_never_grows_and_the_constraints_keep_holding(seed, interval, constraints):
    record = driven(CLUSTERED, seed=seed, noise=0.02)
    start = estimate(model(CLUSTERED).regressors, record, constraints).model
    found = refine(start, record, interval, constraints)
    simulated = multiple_shooting(start, record, interval)
    if isinstance(found, EvaluationOutcome):
        assert found == simulated.outcome
        assert not found
        return
    assert found.before == pytest.approx(simulated.mean_squared_error, rel=1e-12)
    assert found.after <= found.before
    after = multiple_shooting(found.model, record, interval)
    assert found.after == pytest.approx(after.mean_squared_error, rel=1e-12)
    if constraints == "hysteresis":
        assert all(abs(entry.sum - entry.target) < 1e-9 for entry in cluster_sums(found.model))
        assert found.model.parameters[0] != start.parameters[0] or interval == 1


def test_what_is_gained_is_the_error_that_counts():
    """Least squares is the best one step ahead; over an interval its own parameters are not."""
    record = driven(CLUSTERED, noise=0.05)
    start = estimate(model(CLUSTERED).regressors, record, "hysteresis").model
    found = refined(start, record, 40, "hysteresis")
    assert found.after < 0.96 * found.before
    ahead = refined(start, record, 1, "hysteresis")
    assert ahead.after == pytest.approx(ahead.before, rel=1e-6)


def test_nothing_to_choose_leaves_the_model_as_it_is():
    record = driven(HYSTERESIS)
    only = model({"y(k-1)": 1.0})
    found = refined(only, record, 50, "hysteresis")
    assert (found.model.parameters, found.steps) == ((1.0,), 0)
    assert found.model.standard_errors == (0.0,)
    assert found.before == found.after


def test_steps_are_limited():
    record = driven(HYSTERESIS)
    start = perturbed(HYSTERESIS, 0.3)
    one = refined(start, record, 50, max_steps=1)
    assert one.steps == 1
    assert refined(start, record, 50, max_steps=0).model.parameters == start.parameters
    assert refined(start, record, 50).after < one.after


def test_standard_errors_match_a_monte_carlo():
    """Noise on the measurement alone is what a free run leaves over: 60 records tell the spread."""
    clean = driven(HYSTERESIS, samples=400)
    rng = np.random.default_rng(12)
    found = []
    for _ in range(60):
        # The first two samples, from which a run starts, are measured exactly.
        noise = np.where(np.arange(400) < 2, 0.0, 0.02 * rng.normal(size=400))
        found.append(refined(model(HYSTERESIS), replace(clean, y=clean.y + noise), None).model)
    spread = np.std([each.parameters for each in found], axis=0)
    said = np.mean([each.standard_errors for each in found], axis=0)
    # A standard deviation of 60 draws is known to 9 %: three of its own.
    assert said == pytest.approx(spread, rel=0.28)
    mean = np.mean([each.parameters for each in found], axis=0)
    assert np.all(np.abs(mean - model(HYSTERESIS).parameters) < 4 * said / np.sqrt(60))


@pytest.mark.parametrize("constraints", ["none", "hysteresis"])
def test_one_step_ahead_they_are_those_of_least_squares(constraints):
    """Where the error is linear in the parameters, few rows or many."""
    record = driven(CLUSTERED, samples=14, noise=0.05)
    start = estimate(model(CLUSTERED).regressors, record, constraints).model
    found = refined(start, record, 1, constraints)
    assert found.model.parameters == pytest.approx(start.parameters, rel=1e-6)
    assert found.model.standard_errors == pytest.approx(start.standard_errors, rel=1e-6)


def test_standard_errors_know_of_the_constraint():
    """Of two parameters that sum to one, both are known as well as either; one alone is known exactly."""
    record = driven(CLUSTERED, noise=0.02)
    found = refined(
        estimate(model(CLUSTERED).regressors, record, "hysteresis").model, record, None, "hysteresis"
    )
    errors = dict(
        zip((item.text for item in found.model.regressors), found.model.standard_errors, strict=True)
    )
    assert errors["y(k-1)"] == pytest.approx(errors["y(k-2)"], rel=1e-6)
    assert errors["y(k-1)*u1(k-1)"] == pytest.approx(errors["y(k-2)*u1(k-2)"], rel=1e-6)
    assert min(errors.values()) > 0


@pytest.mark.parametrize("interval", [30, None])
def test_its_jacobian_matches_finite_differences_of_another_step(interval):
    record = driven(HYSTERESIS, noise=0.02)
    start = perturbed(HYSTERESIS)
    theta = np.array(start.parameters)
    residual = _Residual(start, record, interval, None)
    error = residual(theta)
    directions = np.diag(np.abs(theta))
    normal, gradient = residual.normal_equations(theta, error, directions)
    columns = []
    for direction in directions.T:
        # Of fourth order, with a step a hundred times as long.
        ahead = [residual(theta + factor * 1e-3 * direction) for factor in (-2, -1, 1, 2)]
        columns.append((ahead[0] - 8 * ahead[1] + 8 * ahead[2] - ahead[3]) / 12e-3)
    jacobian = np.array(columns)
    length = np.linalg.norm(jacobian, axis=1)
    assert np.all(np.abs(normal - jacobian @ jacobian.T) < 1e-5 * length[:, None] * length)
    assert np.all(np.abs(gradient - jacobian @ error) < 1e-5 * length * np.linalg.norm(error))


def test_the_residual_is_prediction_minus_measurement_over_what_is_predicted():
    record = driven(HYSTERESIS, noise=0.02)
    start = perturbed(HYSTERESIS)
    expected = multiple_shooting(start, record, 30, 5)
    error = _Residual(start, record, 30, 5)(np.array(start.parameters))
    assert error == pytest.approx((expected.y - record.y)[5:], abs=1e-15)


def test_segments_are_refined_together_and_none_reaches_into_another():
    parts = driven(HYSTERESIS, 300, seed=1), driven(HYSTERESIS, 200, seed=2)
    found = refined(perturbed(HYSTERESIS), join(parts), None)
    assert found.model.parameters == pytest.approx(model(HYSTERESIS).parameters, rel=1e-6)


def test_steps_that_diverge_are_failed_steps(monkeypatch):
    """From far away the first steps overshoot: the damping grows until one does not."""
    diverged = []
    original = _Residual.__call__

    def watched(self, theta):
        error = original(self, theta)
        diverged.append(error is None)
        return error

    monkeypatch.setattr(_Residual, "__call__", watched)
    start = model(dict(zip(HYSTERESIS, (0.93, 0.46, -0.28, 0.39), strict=True)))
    found = refined(start, driven(HYSTERESIS), None)
    assert sum(diverged) >= 1
    assert found.model.parameters == pytest.approx(model(HYSTERESIS).parameters, rel=1e-6)


def test_a_direction_in_which_the_model_diverges_stands_still(monkeypatch):
    record = driven(HYSTERESIS)
    start = perturbed(HYSTERESIS)
    theta = np.array(start.parameters)
    residual = _Residual(start, record, 30, None)
    error = residual(theta)
    whole, _ = residual.normal_equations(theta, error, np.eye(4))
    original = _Residual.__call__
    monkeypatch.setattr(
        _Residual, "__call__", lambda self, at: None if at[1] > theta[1] else original(self, at)
    )
    normal, gradient = residual.normal_equations(theta, error, np.eye(4))
    assert not normal[1].any()
    assert not normal[:, 1].any()
    assert gradient[1] == 0.0
    others = np.ix_([0, 2, 3], [0, 2, 3])
    assert np.array_equal(normal[others], whole[others])


def test_a_parameter_that_starts_at_zero_is_moved():
    start = model({**HYSTERESIS, "u(k-1)*phi1(u(k-1), u(k-2))": 0.0})
    found = refined(start, driven(HYSTERESIS), 50)
    assert found.model.parameters == pytest.approx(model(HYSTERESIS).parameters, rel=1e-6)


# Outcomes and mistakes.


def test_a_model_that_diverges_as_it_is_is_an_outcome():
    found = refine(model({**HYSTERESIS, "y(k-1)": 1.5}), driven(HYSTERESIS), 200)
    assert isinstance(found, EvaluationOutcome)
    assert found.verdict is Status.DIVERGED
    assert "left" in found.reason
    assert "at sample" in found.reason


def test_a_model_that_the_constraint_refuses_is_an_outcome():
    record = driven(HYSTERESIS)
    without_y = refine(model({"phi1(u(k-1), u(k-2))": 0.8}), record, 50, "hysteresis")
    assert isinstance(without_y, EvaluationOutcome)
    assert without_y.reason == "no regressor is y at rest: add y(k-1)"
    alone = refine(model({"y(k-1)": 1.0, "u(k-1)": 0.0}), record, 50, "hysteresis")
    assert isinstance(alone, EvaluationOutcome)
    assert alone.verdict is Status.INFEASIBLE
    assert "leave its term out" in alone.reason


def test_what_the_kernel_would_not_check_is_refused():
    record = driven(HYSTERESIS)
    with pytest.raises(ModelError, match="no parameters yet"):
        refine(replace(model(HYSTERESIS), theta=None), record, 50)
    two_inputs = make_model([(parse("y(k-1)"), 1.0), (parse("u2(k-1)"), 0.1)], ("u1", "u2"))
    with pytest.raises(RecordError, match="the model has 2 inputs"):
        refine(two_inputs, record, 50)
    with pytest.raises(SettingsError, match="reads 2 samples back, the warm-up has 1"):
        refine(model(HYSTERESIS), record, 50, warm_up=1)
    with pytest.raises(SettingsError, match="at least 1 sample, got 0"):
        refine(model(HYSTERESIS), record, 0)
    with pytest.raises(SettingsError, match="unknown constraints 'physics'"):
        refine(model(HYSTERESIS), record, 50, "physics")
    gap = np.array(record.y)
    gap[300] = np.nan
    with pytest.raises(RecordError, match="refinement needs every sample"):
        refine(model(HYSTERESIS), replace(record, y=gap), None)
