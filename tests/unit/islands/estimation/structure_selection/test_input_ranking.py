"""Screening of inputs: a library of many inputs is small and contains the terms of the law."""

import numpy as np
import pytest

from islands.errors import SettingsError
from islands.estimation.forward_selection import forward_selection
from islands.estimation.structure_selection.input_ranking import rank_inputs, screen_candidates
from islands.expressions.printing import plain
from islands.models import candidate_library
from islands.models.candidate_library import candidates
from islands.records.dataset import Dataset

#: Inputs of the records, of which the laws read two or one.
INPUTS = 20


@pytest.fixture(autouse=True)
def limit(monkeypatch):
    """Make libraries of twenty inputs too large that take little time."""
    monkeypatch.setattr(candidate_library, "MAX_CANDIDATES", 1000)
    return 1000


def inputs(samples, walk):
    """Return inputs of which the fifth is correlated with the seventh."""
    generator = np.random.default_rng(0)
    u = 0.1 * np.cumsum(generator.normal(size=(samples, INPUTS)), axis=0)
    u = u if walk else generator.uniform(-1, 1, (samples, INPUTS))
    u[:, 4] = 0.9 * u[:, 6] + 0.3 * u[:, 4]
    return u


def bilinear(samples=300):
    u, y = inputs(samples, walk=False), np.zeros(samples)
    for k in range(2, samples):
        y[k] = 0.6 * y[k - 1] + 0.5 * u[k - 1, 6] * u[k - 1, 12]
    return Dataset(u, y + 0.001 * np.random.default_rng(1).normal(size=samples), 0.1)


def hysteresis(samples=300):
    u, y = inputs(samples, walk=True), np.zeros(samples)
    for k in range(2, samples):
        step = u[k - 1, 6] - u[k - 2, 6]
        y[k] = y[k - 1] + 0.8 * step - 0.3 * y[k - 1] * abs(step)
    return Dataset(u, y + 0.001 * np.random.default_rng(1).normal(size=samples), 0.1)


LAWS = {
    "polynomial": (bilinear, 2, "none", {"y(k-1)", "u7(k-1)*u13(k-1)"}),
    "phi-polynomial": (
        hysteresis,
        3,
        "hysteresis",
        {"y(k-1)", "u7(k-1) - u7(k-2)", "y(k-1)*sign(u7(k-1) - u7(k-2))*(u7(k-1) - u7(k-2))"},
    ),
}


@pytest.mark.parametrize("name", LAWS)
def test_forward_selection_finds_the_law_of_few_among_many_inputs(name, limit):
    make, degree, constraints, expected = LAWS[name]
    record = make()
    library = screen_candidates(name, degree + 1, 2, record, constraints)
    assert len(library) <= limit
    found = forward_selection(library, record, constraints, len(expected))
    assert {plain(item.expression, INPUTS) for item in found[-1]} == expected


@pytest.mark.parametrize("samples", [300, 20_000])
def test_ranking_has_the_inputs_of_the_law_only(samples):
    assert set(rank_inputs("polynomial", 3, 1, bilinear(samples))) == {7, 13}


def test_ranking_of_noise_is_empty_and_its_library_has_one_input_in_products():
    record = bilinear()
    noise = Dataset(record.u, np.random.default_rng(2).normal(size=300), 0.1)
    assert rank_inputs("polynomial", 3, 2, noise) == ()
    assert len(screen_candidates("polynomial", 3, 2, noise)) == 35 + 2 * (INPUTS - 1)


def test_screened_library_has_all_inputs_linearly_and_some_in_products():
    record = bilinear()
    library = set(screen_candidates("polynomial", 4, 2, record))
    assert set(candidates("polynomial", 1, 2, INPUTS)) <= library
    in_products = {channel for item in library if item.degree == 4 for channel, _ in item.lags} - {0}
    assert in_products == {7, 13}


def test_library_too_large_for_one_input_is_refused():
    with pytest.raises(SettingsError, match="80730 candidates are more than a library may have"):
        screen_candidates("polynomial", 5, 11, bilinear())
