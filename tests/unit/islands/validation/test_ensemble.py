"""Ensemble: weights of structures, inclusion probabilities, spread of the free runs."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from islands.estimation.estimate import estimate
from islands.estimation.estimator_table import LEAST_SQUARES, refinement_criterion
from islands.expressions.parsing import parse
from islands.facade.fit import fit_record
from islands.models.narx import make_model
from islands.models.regressor import regressor
from islands.records.dataset import Dataset
from islands.records.split import split
from islands.simulation.initial_outputs import simulate_freely
from islands.simulation.predictors import free_run
from islands.validation import ensemble as ensemble_module
from islands.validation.ensemble import ValidatedModel, make_ensemble, measure_square

TRUE = ("y(k-1)", "u(k-1)", "y(k-1)*u(k-1)")
STRUCTURES = (TRUE, TRUE[:2], (*TRUE, "u(k-2)"), (*TRUE, "y(k-2)", "u(k-1)*u(k-1)"))


def term(text):
    return regressor(parse(text))[1]


@cache
def parts(noise=0.0, samples=500, seed=0):
    rng = np.random.default_rng(seed)
    u = rng.uniform(-1.0, 1.0, samples)
    y = np.zeros(samples)
    for k in range(1, samples):
        y[k] = 0.6 * y[k - 1] + 0.3 * u[k - 1] + 0.2 * y[k - 1] * u[k - 1]
    return split(Dataset(u, y + noise * rng.standard_normal(samples), 0.1), 0.3)


def candidate(texts, data):
    model = estimate([term(text) for text in texts], data.estimation, "none", 2).model
    return ValidatedModel(model, LEAST_SQUARES, measure_square(model, data, 2))


def ensemble(data, structures=STRUCTURES, seed=0):
    return make_ensemble([candidate(texts, data) for texts in structures], data, "none", 2, seed)


def members(found):
    return [(each.model, each.weight, each.parameters.tolist()) for each in found.structures]


def test_the_terms_of_an_exact_law_have_an_inclusion_probability_of_one():
    found = ensemble(parts())
    assert [found.inclusion(term(text).text) for text in TRUE] == pytest.approx([1.0, 1.0, 1.0], abs=1e-12)


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_term_that_the_law_lacks_has_a_small_inclusion_probability(noise):
    found = ensemble(parts(noise))
    assert found.inclusion(term("u(k-2)").text) < 0.3
    assert found.inclusion(term("u(k-9)").text) == 0.0


def test_the_order_of_the_candidates_and_bad_candidates_have_no_effect():
    data = parts(0.02)
    worse = replace(candidate(TRUE, data), error=1e3)
    diverged = replace(candidate(STRUCTURES[2], data), error=np.inf)
    entries = [candidate(texts, data) for texts in STRUCTURES]
    reordered = make_ensemble([worse, diverged, *reversed(entries)], data, "none", 2, 0)
    assert members(reordered) == members(make_ensemble(entries, data, "none", 2, 0))


def test_there_is_no_ensemble_without_a_bounded_free_run():
    data = parts()
    assert make_ensemble([replace(candidate(TRUE, data), error=np.inf)], data, "none", 2, 0) is None


def test_implausible_members_are_left_out():
    """A structure near instability: some replicates diverge, and no member does."""
    data = parts(0.02)
    found = ensemble(data, [("y(k-1)", "y(k-2)", "y(k-1)*y(k-1)", "u(k-1)")])
    errors = np.mean((found.simulate(data.validation, 2) - data.validation.y)[:, 2:] ** 2, axis=1)
    assert errors.max() <= 4.01 * candidate(("y(k-1)", "y(k-2)", "y(k-1)*y(k-1)", "u(k-1)"), data).error


@pytest.mark.parametrize("plausible", [0, 2, 4])
def test_members_are_of_the_first_draws_half_of_which_are_plausible(monkeypatch, plausible):
    """The first draws have all but one an implausible error; the next ones are drawn in fewer directions."""
    data = parts(0.02)
    model = candidate(TRUE, data).model
    theta = np.array(model.parameters)
    near, far = 1.001 * theta, 2.0 * theta
    drawn = [np.array([near, far, far, far]), np.array([near] * plausible + [far] * (4 - plausible))]
    monkeypatch.setattr(ensemble_module, "draw_parameters", lambda *_: iter(drawn))
    (structure,) = ensemble(data, [TRUE]).structures
    expected = [near] * plausible or [theta]
    assert structure.parameters == pytest.approx(np.array(expected))


def test_the_spread_is_infinite_if_a_tenth_of_the_members_has_diverged():
    found = ensemble(parts(0.02), [TRUE])
    runs = np.zeros((len(found.weights), 2))
    runs[: len(runs) // 20, 0] = np.nan
    runs[: len(runs) // 4, 1] = np.nan
    assert found.spread(runs, np.zeros(2)).tolist() == [0.0, np.inf]
    assert np.isnan(found.spread(runs, np.array([np.nan, 0.0]))[0])


def first_order(noise, seed, samples=1200):
    """Return a record of ``y(k) = 0.9 y(k-1) + 0.2 u(k-1)`` with white noise of the measurement."""
    rng = np.random.default_rng(seed)
    u = rng.uniform(-1.0, 1.0, samples)
    y = np.zeros(samples)
    for k in range(1, samples):
        y[k] = 0.9 * y[k - 1] + 0.2 * u[k - 1]
    return Dataset(u, y + noise * rng.standard_normal(samples), 0.1)


LAW = ("y(k-1)", "u(k-1)")
SUBSTITUTED = ("y(k-2)", "u(k-1)", "u(k-2)")


@pytest.mark.parametrize("noise", [1e-6, 1e-3, 0.02])
def test_a_longer_form_of_a_law_counts_as_the_law(noise):
    """The law substituted in itself, y(k) = 0.81 y(k-2) + ..., lacks y(k-1), and was a rival of it."""
    data = split(first_order(noise, 1), 0.3)
    law, form = candidate(LAW, data), candidate(SUBSTITUTED, data)
    a, b = law.model.parameters
    model = form.model.with_parameters([a**2, b, a * b])
    error = measure_square(model, data, 2)
    # Equal errors: only the number of terms and chance decide between the two forms.
    forms = law, replace(form, model=model, error=0.99 * error)
    # Least squares one step ahead would be biased by output noise, and by different amounts.
    fitted = [replace(each, criterion=refinement_criterion(None)) for each in forms]
    found = make_ensemble(fitted, data, "none", 2, 0)
    assert len(found.structures) == 2
    assert [found.inclusion(term(text).text) for text in LAW] == pytest.approx([1.0, 1.0])
    assert found.inclusion(term("y(k-2)").text) == 0.0


def test_noise_of_initial_outputs_does_not_exclude_the_law_of_a_slow_process():
    """A form with two past outputs averages that noise, and took all weight."""
    law = make_model([(parse("y(k-1)"), 0.99), (parse("u(k-1)"), 0.01)], ("u",), "y")
    # The law substituted in itself once and twice, half each.
    terms = {
        "y(k-2)": 0.5 * 0.99**2,
        "y(k-3)": 0.5 * 0.99**3,
        "u(k-1)": 0.01,
        "u(k-2)": 0.0099,
        "u(k-3)": 0.005 * 0.99**2,
    }
    rival = make_model([(parse(text), value) for text, value in terms.items()], ("u",), "y")
    lost = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        u = np.repeat(rng.choice([0.0, 1.0], 30), 50)
        record = free_run(law, Dataset(u, np.zeros(1500), 1.0), 3).y
        record[:3] = 0.0
        data = split(Dataset(u, record + 0.05 * rng.standard_normal(1500), 1.0), 0.5)
        errors = [simulate_freely(each, data.validation, 3).mean_squared_error for each in (law, rival)]
        entries = [
            ValidatedModel(each, LEAST_SQUARES, measure_square(each, data, 3)) for each in (law, rival)
        ]
        lost.append(errors[0] > 1.05 * errors[1])
        assert make_ensemble(entries, data, "none", 3, 0).structures[0].model.size == 2
    # In a part of the records, the noise makes a difference that exceeds the penalty of the size.
    assert sum(lost) >= 3


@pytest.mark.nightly
def test_the_terms_of_a_recommended_law_are_certain():
    """y(k-1) had a probability of 0.50, because y(k) = 0.73 y(k-3) + ... is the same law."""
    found = fit_record(first_order(0.02, 1), library="polynomial", equations_only=True)
    assert found.best.model.parameter_names == ("y(k-1)", "u1(k-1)")
    assert min(found.best.inclusion) > 0.95
    assert "doubtful" not in str(found)


def test_a_term_that_only_the_estimation_data_excite_is_included():
    """A second input rests in the validation data, where the structure without it is as good and smaller."""
    rng = np.random.default_rng(0)
    u = rng.uniform(-1.0, 1.0, (500, 2))
    u[350:, 1] = 0.0
    y = np.zeros(500)
    for k in range(1, 500):
        y[k] = 0.6 * y[k - 1] + 0.3 * u[k - 1, 0] + 0.2 * u[k - 1, 1]
    data = split(Dataset(u, y + 0.02 * rng.standard_normal(500), 0.1), 0.3)
    law = ("y(k-1)", "u1(k-1)", "u2(k-1)")
    entries = [candidate(texts, data) for texts in (law, law[:2])]
    found = make_ensemble(entries, data, "none", 2, 0)
    assert [each.model.size for each in found.structures] == [3]
    assert (found.structures[0].weight, found.inclusion(term("u2(k-1)").text)) == (1.0, 1.0)
    kept = make_ensemble(entries, data, "none", 2, 0, recommended=entries[1].model)
    assert sorted(each.model.size for each in kept.structures) == [2, 3]
    assert sum(each.weight for each in kept.structures) == pytest.approx(1.0)
