"""Inputs to which an output responds within the sample, also where the response depends on another input."""

import numpy as np
import pytest

import islands
from islands.estimation.structure_selection.direct_feedthrough import find_direct_inputs
from islands.records.dataset import Dataset


def static(force, samples=2000, noise=0.02):
    rng = np.random.default_rng(1)
    i, x = rng.uniform(0, 2, samples), rng.uniform(0, 3, samples)
    return Dataset(np.column_stack([i, x]), force(i, x) + rng.normal(0, noise, samples), 0.01)


@pytest.mark.parametrize(
    ("force", "found"),
    [
        (lambda i, x: 2 * i**2 + 0.5 * i * x, (0, 1)),
        (lambda i, x: i * x, (0, 1)),
        (lambda i, x: 2 * i**2 + 0.5 * np.roll(x, 1), (0,)),
        (lambda i, x: np.roll(2 * i**2 + 0.5 * i * x, 1), ()),
    ],
    ids=["second depends on first", "product", "second late", "both late"],
)
def test_inputs_are_found_together_with_those_found_before(force, found):
    assert find_direct_inputs(static(force)) == found


@pytest.mark.nightly
def test_a_static_law_of_two_inputs_is_found_exactly():
    result = islands.fit(static(lambda i, x: 2 * i**2 + 0.5 * i * x))
    assert sorted(item.text for item in result.best.model.regressors) == ["u1(k-1)*u2(k-1)", "u1(k-1)^2"]
    assert sorted(result.best.model.parameters) == pytest.approx([0.5, 2.0], abs=0.005)
    assert result.best.metrics["validation"]["free_run"].rmse < 0.021
