"""Structures with equal free runs: terms that are one function of the data, and terms that describe noise."""

from functools import cache

import numpy as np
import pytest

from islands.estimation.estimate import estimate
from islands.estimation.estimator_table import LEAST_SQUARES
from islands.expressions.parsing import parse
from islands.facade.identify import identify
from islands.models.regressor import regressor
from islands.records.dataset import Dataset
from islands.records.split import split
from islands.simulation.predictors import free_run
from islands.systems.example_records import EXAMPLE_RECORDS
from islands.validation.ensemble import ValidatedModel, make_ensemble
from islands.validation.equal_laws import find_laws

LAW = ("y(k-1)", "u(k-1)", "sign(y(k-1))")

#: Forms of the sign of y(k-1), if the input is never 0.
SIGNS = ("sign(y(k-1))*sign(y(k-1)^2)", "sign(y(k-1)^3)", "sign(y(k-1)*u(k-1)^2)")


SEEDS = pytest.mark.parametrize("seed", range(4))


@cache
def motor(seed, samples=900, noise=0.05):
    """Return the parts of a record of a motor with dry friction, as that of the documentation."""
    rng = np.random.default_rng(seed)
    u, y = np.repeat(rng.uniform(-6.0, 6.0, samples // 15), 15), np.zeros(samples)
    for k in range(1, samples):
        y[k] = 0.95 * y[k - 1] + 0.8 * u[k - 1] - 0.9 * np.sign(y[k - 1])
    return split(Dataset(u, y + noise * rng.standard_normal(samples), 0.02), 0.3)


def model(texts, data):
    terms = [regressor(parse(text))[1] for text in texts]
    return estimate(terms, data.estimation, "none", 4).model


def laws(structures, data, preferred=None):
    models = [model(texts, data) for texts in structures]
    chosen = None if preferred is None else models[preferred]
    return find_laws(models, data.validation, 4, chosen)


@SEEDS
@pytest.mark.parametrize("form", SIGNS)
def test_a_term_that_is_another_form_of_one_is_the_same_law(form, seed):
    other = (*LAW[:2], form)
    assert laws([LAW, other], motor(seed)) == [None, 0]
    assert laws([other, LAW], motor(seed)) == [None, 0]
    assert laws([LAW, other], motor(seed), preferred=1) == [1, None]


@SEEDS
def test_a_term_that_another_one_replaces_in_part_is_another_law(seed):
    for text in ("sign(y(k-2))", "tanh(y(k-1))"):
        assert laws([LAW, (*LAW[:2], text)], motor(seed, noise=0.005)) == [None, None]
    assert laws([LAW, LAW[:2]], motor(seed)) == [None, None]


def inclusion(structures, data):
    candidates = [model(texts, data) for texts in structures]
    errors = [free_run(each, data.validation, 4).mean_squared_error for each in candidates]
    # Equal errors: the structures differ in the number of their terms alone.
    entries = [ValidatedModel(each, LEAST_SQUARES, errors[0]) for each in candidates]
    found = make_ensemble(entries, data, "none", 4, 0, recommended=candidates[0])
    weights = {each.model.parameter_names: each.weight for each in found.structures}
    return found, [weights.get(each.parameter_names, 0.0) for each in candidates]


@SEEDS
def test_every_form_of_a_term_counts_as_the_recommended_one(seed):
    rivals = [(*LAW[:2], form) for form in SIGNS]
    found, weights = inclusion([LAW, *rivals], motor(seed))
    assert weights == pytest.approx([0.25] * 4)
    assert found.inclusion(LAW[2].replace("u(", "u1(")) == pytest.approx(1.0)
    assert [found.inclusion(form.replace("u(", "u1(")) for form in SIGNS] == [0.0] * 3


@pytest.mark.nightly
def test_no_true_term_of_the_motor_of_the_documentation_is_doubtful():
    """sign(y(k-1)) had a probability of 0.36, since sign(y(k-1)) sign(y(k-1)^2) was a rival."""
    found = identify(EXAMPLE_RECORDS["motor"].make())
    assert found.best.model.parameter_names == ("y(k-1)", "u1(k-1)", "sign(y(k-1))")
    assert min(found.best.inclusion) > 0.95
    assert "doubtful" not in str(found)
