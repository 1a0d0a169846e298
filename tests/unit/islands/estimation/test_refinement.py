"""Refinement: Levenberg-Marquardt on the multiple-shooting error under constraints."""

import math
from dataclasses import replace

import numpy as np
import pytest

import islands
from islands.errors import ModelError, RecordError, SettingsError
from islands.estimation.damped_least_squares import approximate_jacobian, normal_equations
from islands.estimation.estimate import estimate
from islands.estimation.refinement import RefinedModel, begin_refinement, refine
from islands.estimation.shooting_residual import ShootingResidual
from islands.expressions.parsing import parse
from islands.expressions.tree import Apply, Lagged
from islands.models.coupled_narx import CoupledModel
from islands.models.narx import make_model
from islands.records.dataset import Dataset
from islands.simulation.outcome import EvaluationOutcome, Status
from islands.simulation.predictors import free_run, multiple_shooting
from islands.validation.physics import cluster_sums
from support.coupled_systems import PREY, TWO_MASSES, equation, make_coupled_record

HYSTERESIS = {
    "y(k-1)": 1.0,
    "phi1(u(k-1), u(k-2))": 0.8,
    "y(k-1)*phi2(u(k-1), u(k-2))*phi1(u(k-1), u(k-2))": -0.3,
    "u(k-1)*phi1(u(k-1), u(k-2))": 0.1,
}
#: Two terms with steady state y and two with y u; their sums are 1 and 0.
CLUSTERED = {
    "y(k-1)": 0.7,
    "y(k-2)": 0.3,
    "u(k-1)*y(k-1)": 0.2,
    "u(k-2)*y(k-2)": -0.2,
    "phi1(u(k-1), u(k-2))": 0.5,
}


def model(terms):
    return make_model((parse(text), theta) for text, theta in terms.items())


def make_record(terms, samples=600, seed=0, noise=0.0):
    """Return a noisy free run of a model from rest with a random-walk input."""
    rng = np.random.default_rng(seed)
    u = np.cumsum(rng.normal(size=samples)) / 10
    blank = Dataset(u, np.where(np.arange(samples) < 2, 0.0, np.nan), 0.1)
    y = free_run(model(terms), blank).y
    y[:2] = 0.0
    return Dataset(u, y + noise * rng.normal(size=samples), 0.1)


def perturb(terms, by=0.05):
    """Return a model with perturbed parameters; y(k-1) is unchanged, so that the model does not diverge."""
    return model(
        {
            text: theta * (1 + by * (-1) ** position * (text != "y(k-1)"))
            for position, (text, theta) in enumerate(terms.items())
        }
    )


def refine_model(*arguments, **options):
    found = refine(*arguments, **options)
    assert isinstance(found, RefinedModel), found
    return found


@pytest.mark.parametrize("interval", [1, 50, None])
def test_refinement_recovers_true_parameters_from_noise_free_data(interval):
    record = make_record(HYSTERESIS)
    found = refine_model(perturb(HYSTERESIS), record, interval)
    assert found.before > 1e-8
    assert found.model.parameters == pytest.approx(model(HYSTERESIS).parameters, rel=1e-6)
    assert found.after < 1e-10 * found.before
    assert 2 <= found.steps <= 30


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("interval", [1, 40, None])
@pytest.mark.parametrize("constraints", ["none", "hysteresis"])
def test_refinement_never_increases_the_error_and_keeps_constraints(seed, interval, constraints):
    record = make_record(CLUSTERED, seed=seed, noise=0.02)
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
    if interval is None:
        # The least error from any initial outputs is not larger than that from the measured ones.
        assert found.after <= after.mean_squared_error * (1.0 + 1e-6)
    else:
        assert found.after == pytest.approx(after.mean_squared_error, rel=1e-12)
    if constraints == "hysteresis":
        assert all(abs(entry.sum - entry.target) < 1e-9 for entry in cluster_sums(found.model))
        assert found.model.parameters[0] != start.parameters[0] or interval == 1


def test_model_without_free_directions_is_unchanged():
    record = make_record(HYSTERESIS)
    only = model({"y(k-1)": 1.0})
    found = refine_model(only, record, 50, "hysteresis")
    assert (found.model.parameters, found.steps) == ((1.0,), 0)
    assert found.model.standard_errors == (0.0,)
    assert found.before == found.after


def test_steps_do_not_depend_on_the_zeros_of_the_units():
    record = make_record({"y(k-1)": 0.7, "u(k-1)": 0.5, "u(k-2)": 0.2}, noise=0.05)
    found = []
    for offset in (50.0, 3000.0):
        shifted = replace(record, y=record.y + offset, u=record.u + 10.0 * offset)
        # The constant of the unit: y rests where 0.8 (y - offset) = 0.6 (u - 10 offset).
        terms = {"y(k-1)": 0.2, "u(k-1)": 0.6, "1": 0.8 * offset - 6.0 * offset}
        found.append(refine(model(terms), shifted, None, max_steps=2, standard_errors=False))
    assert found[0].after == pytest.approx(found[1].after, rel=1e-6)
    assert found[0].model.parameters[0] == pytest.approx(found[1].model.parameters[0], rel=1e-6)


def test_standard_errors_match_a_monte_carlo():
    """With measurement noise only, compare the standard errors with the spread over 60 records."""
    clean = make_record(HYSTERESIS, samples=400)
    rng = np.random.default_rng(12)
    found = []
    for _ in range(60):
        # The first two samples, the initial values of a run, are free of noise.
        noise = np.where(np.arange(400) < 2, 0.0, 0.02 * rng.normal(size=400))
        found.append(refine_model(model(HYSTERESIS), replace(clean, y=clean.y + noise), None).model)
    spread = np.std([each.parameters for each in found], axis=0)
    predicted = np.mean([each.standard_errors for each in found], axis=0)
    # The standard deviation of 60 draws has a relative error of 9 %; allow three times that.
    assert predicted == pytest.approx(spread, rel=0.28)
    mean = np.mean([each.parameters for each in found], axis=0)
    assert np.all(np.abs(mean - model(HYSTERESIS).parameters) < 4 * predicted / np.sqrt(60))


@pytest.mark.parametrize("constraints", ["none", "hysteresis"])
def test_one_step_ahead_refinement_equals_least_squares(constraints):
    """The one-step-ahead error is linear in the parameters; the record has only 14 samples."""
    record = make_record(CLUSTERED, samples=14, noise=0.05)
    start = estimate(model(CLUSTERED).regressors, record, constraints).model
    found = refine_model(start, record, 1, constraints)
    assert found.model.parameters == pytest.approx(start.parameters, rel=1e-6)
    assert found.model.standard_errors == pytest.approx(start.standard_errors, rel=1e-6)


def test_standard_errors_account_for_the_constraint():
    """Two parameters with a fixed sum have equal standard errors."""
    record = make_record(CLUSTERED, noise=0.02)
    found = refine_model(
        estimate(model(CLUSTERED).regressors, record, "hysteresis").model, record, None, "hysteresis"
    )
    errors = dict(
        zip((item.text for item in found.model.regressors), found.model.standard_errors, strict=True)
    )
    assert errors["y(k-1)"] == pytest.approx(errors["y(k-2)"], rel=1e-6)
    assert errors["y(k-1)*u1(k-1)"] == pytest.approx(errors["y(k-2)*u1(k-2)"], rel=1e-6)
    assert min(errors.values()) > 0


@pytest.mark.parametrize("interval", [30, None])
def test_jacobian_matches_higher_order_finite_differences(interval):
    record = make_record(HYSTERESIS, noise=0.02)
    start = perturb(HYSTERESIS)
    theta = np.array(start.parameters)
    residual = ShootingResidual(start, record, interval, None)
    error = residual(theta)
    directions = np.diag(np.abs(theta))
    normal, gradient = normal_equations(residual, theta, error, directions)
    columns = []
    for direction in directions.T:
        # Fourth-order differences with a step 100 times larger.
        ahead = [residual(theta + factor * 1e-3 * direction) for factor in (-2, -1, 1, 2)]
        columns.append((ahead[0] - 8 * ahead[1] + 8 * ahead[2] - ahead[3]) / 12e-3)
    jacobian = np.array(columns)
    length = np.linalg.norm(jacobian, axis=1)
    assert np.all(np.abs(normal - jacobian @ jacobian.T) < 1e-5 * length[:, None] * length)
    assert np.all(np.abs(gradient - jacobian @ error) < 1e-5 * length * np.linalg.norm(error))


def test_diverging_steps_are_rejected(monkeypatch):
    """From a distant start the first steps overshoot; the damping increases until a step succeeds."""
    diverged = []
    original = ShootingResidual.__call__

    def record_divergence(self, theta):
        error = original(self, theta)
        diverged.append(error is None)
        return error

    monkeypatch.setattr(ShootingResidual, "__call__", record_divergence)
    start = model(dict(zip(HYSTERESIS, (0.93, 0.46, -0.28, 0.39), strict=True)))
    found = refine_model(start, make_record(HYSTERESIS), None)
    assert sum(diverged) >= 1
    assert found.model.parameters == pytest.approx(model(HYSTERESIS).parameters, rel=1e-6)


def test_differences_across_a_divergence_are_zero():
    record = make_record(HYSTERESIS)
    start = perturb(HYSTERESIS)
    theta = np.array(start.parameters)
    residual = ShootingResidual(start, record, 30, None)
    samples = residual(theta).size
    complete = approximate_jacobian(lambda moved: list(map(residual, moved)), theta, samples, np.eye(4))
    found = approximate_jacobian(
        lambda moved: [None if at[1] > theta[1] else residual(at) for at in moved], theta, samples, np.eye(4)
    )
    assert not found[1].any()
    others = [0, 2, 3]
    assert np.array_equal(found[others], complete[others])


def test_primitive_of_the_user_is_refined_by_differences():
    """The differences of a function without a known derivative give the parameters of the known one."""
    terms = {"y(k-1)": 0.8, "tanh(y(k-2))": 0.3, "u(k-1)": 0.5}
    record = make_record(terms, noise=0.01)
    own = islands.primitive("own_tanh", math.tanh)
    start = perturb(terms)
    same = make_model(
        (Apply(own, (Lagged(0, 2),)) if "tanh" in text else parse(text), theta)
        for text, theta in zip(terms, start.parameters, strict=True)
    )
    known, found = (refine_model(each, record, 30).model for each in (start, same))
    assert found.parameters == pytest.approx(known.parameters, rel=1e-6)
    assert found.standard_errors == pytest.approx(known.standard_errors, rel=1e-6)
    assert found.parameters != known.parameters


# Several outputs.


@pytest.mark.ci
@pytest.mark.parametrize("coupled", [TWO_MASSES, PREY], ids=["masses", "prey"])
def test_the_parameters_of_several_outputs_are_within_their_standard_errors(coupled):
    deviations = []
    for seed in range(20):
        record = make_coupled_record(coupled, samples=400, noise=0.05, seed=seed)
        found = refine(coupled, record, None, warm_up=2).model
        deviations.append((np.array(found.parameters) - coupled.parameters) / found.standard_errors)
    assert 0.88 < (np.abs(deviations) < 1.96).mean() < 0.99


def test_the_equations_of_several_outputs_keep_their_constraint():
    true = CoupledModel(
        (
            equation({"y(k-1)": 0.7, "y(k-2)": 0.3, "phi1(u1(k-1), u1(k-2))": 0.5}, ("u", "y2"), "y1"),
            equation({"y(k-1)": 0.6, "y(k-2)": 0.4, "phi1(u2(k-1), u2(k-2))": 0.3}, ("u", "y1"), "y2"),
        )
    )
    record = make_coupled_record(true, noise=0.02)
    start = true.with_parameters((0.6, 0.4, 0.4, 0.5, 0.5, 0.2))
    found = refine(start, record, None, "hysteresis")
    assert found.after < 0.1 * found.before
    for single in found.model.models:
        assert all(cluster.met for cluster in cluster_sums(single))


# Failures and invalid arguments.


def test_initially_diverging_model_returns_an_outcome():
    found = refine(model({**HYSTERESIS, "y(k-1)": 1.5}), make_record(HYSTERESIS), 200)
    assert isinstance(found, EvaluationOutcome)
    assert found.verdict is Status.DIVERGED
    assert "left" in found.reason
    assert "at sample" in found.reason


def test_model_that_cannot_meet_the_constraint_returns_an_outcome():
    record = make_record(HYSTERESIS)
    without_y = refine(model({"phi1(u(k-1), u(k-2))": 0.8}), record, 50, "hysteresis")
    assert isinstance(without_y, EvaluationOutcome)
    assert without_y.reason == "no regressor is y at rest: add y(k-1)"
    alone = refine(model({"y(k-1)": 1.0, "u(k-1)": 0.0}), record, 50, "hysteresis")
    assert isinstance(alone, EvaluationOutcome)
    assert alone.verdict is Status.INFEASIBLE
    assert "remove its term" in alone.reason


def test_invalid_arguments_of_refine_are_refused():
    record = make_record(HYSTERESIS)
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


def test_a_continued_refinement_equals_an_uninterrupted_one():
    record = make_record(CLUSTERED, noise=0.02)
    start = perturb(CLUSTERED)
    whole = refine_model(start, record, 50, standard_errors=False)
    begun = begin_refinement(start, record, 50)
    for steps in (1, 1, 2, 30):
        begun.minimisation.advance(steps)
    assert whole.steps == begun.minimisation.steps > 2
    assert whole.model == begun.model
