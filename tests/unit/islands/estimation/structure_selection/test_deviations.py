"""Deviations from large offsets: the same law is found at every operating point of the signals."""

import numpy as np
import pytest

import islands
from islands.estimation.structure_selection.deviations import (
    LARGE_OFFSET,
    find_offsets,
    subtract_offsets,
)
from islands.expressions.printing import plain
from islands.records.dataset import Dataset

STEPS = np.random.default_rng(3)
U = np.repeat(STEPS.uniform(-1, 1, 100), 8) + 0.1 * STEPS.normal(size=800)
NOISE = np.random.default_rng(9).normal(size=800)

OFFSETS = [(1e3, 1e3), (1e5, 0.0), (0.0, 1e5), (1e6, -1e6)]


def simulate(law):
    y = np.zeros(len(U))
    for k in range(2, len(U)):
        y[k] = law(y, U, k)
    return y


LAWS = {
    "linear": (
        simulate(lambda y, u, k: 0.7 * y[k - 1] - 0.2 * y[k - 2] + 0.4 * u[k - 1]),
        ["y(k-1)", "y(k-2)", "u(k-1)"],
    ),
    "cubic": (
        simulate(lambda y, u, k: 0.6 * y[k - 1] + 0.5 * u[k - 1] - 0.3 * u[k - 1] ** 3),
        ["y(k-1)", "u(k-1)", "u(k-1)^3"],
    ),
}


def texts(model):
    return {plain(item.expression) for item in model.regressors}


def error(result, size):
    """Return the error of the model of a size, as a fraction of the output's standard deviation."""
    sized = next(entry for entry in result.models if entry.model.size == size)
    return sized.metrics["validation"]["free_run"].rmse / np.std(result.search_result.record.y)


@pytest.mark.ci
@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("law", LAWS)
def test_fit_finds_one_law_at_every_offset(law, noise):
    """A cubic law about zero has a square about another point, so that it has one more term."""
    y, expected = LAWS[law]
    found = []
    for output, source in [(1e3, 1e3), (1e5, -200.0), (-50.0, 1e5), (1e6, -1e6)]:
        record = Dataset(U + source, y + output + noise * y.std() * NOISE, 0.1)
        fit = islands.fit(record, library="polynomial", degree=3, lags=2, max_terms=6)
        found.append([error(fit, size) for size in range(2, 7)])
        assert error(fit, len(expected) + 2) < (0.015 if noise else 1e-8)
    assert np.allclose(found[1:], found[0], rtol=1e-3, atol=1e-7)


@pytest.mark.ci
def test_law_in_absolute_units_keeps_its_terms():
    steps = np.random.default_rng(5)
    u = 10.0 + np.repeat(steps.uniform(-1.7, 1.7, 150), 8) + 0.1 * steps.normal(size=1200)
    y = np.full(len(u), 10.0)
    for k in range(2, len(u)):
        y[k] = 0.6 * y[k - 1] + 0.7 * u[k - 1] - 0.03 * y[k - 1] * u[k - 2]
    found = islands.fit(Dataset(u, y, 0.1), library="polynomial", degree=3, lags=3, max_terms=5)
    assert error(found, 3) < 1e-10
    assert {"y(k-1)", "u(k-1)", "y(k-1)*u(k-2)"} <= texts(found.best.model)


@pytest.mark.parametrize(("output", "source"), OFFSETS)
def test_constraint_holds_exactly_at_every_offset(output, source):
    y = np.zeros(len(U))
    for k in range(2, len(U)):
        step = U[k - 1] - U[k - 2]
        y[k] = y[k - 1] + 0.8 * step - 0.3 * y[k - 1] * abs(step)
    record = Dataset(U + source, y + output, 0.1)
    found = islands.fit(record, library="phi-polynomial", degree=2, lags=2, max_terms=4)
    assert all(entry.physics.property_1 for entry in found.models)
    assert error(found, 4) < 1e-8


def test_the_operating_point_is_a_value_of_the_record():
    rng = np.random.default_rng(4)
    u, y = 20.0 + rng.uniform(-1, 1, 101), 5.0 + rng.normal(size=101)
    there, elsewhere = (np.array(find_offsets(Dataset(u + by, y - 2 * by, 0.1))) for by in (0.0, 273.15))
    assert there[0] in y
    assert there[1] in u
    assert elsewhere - there == pytest.approx([-2 * 273.15, 273.15])
    assert find_offsets(Dataset(u, y, 0.1), least=LARGE_OFFSET) == (0.0, there[1])


def test_a_signal_that_reaches_zero_has_no_operating_point():
    """A valve that is closed at times; noise of 1e-9 does not open it."""
    valve = np.maximum(0.0, np.sin(0.1 * np.arange(200)))
    shut = Dataset(valve + 1e-9, np.full(200, 7.0), 0.1)
    assert find_offsets(shut) == (0.0, 0.0)
    assert subtract_offsets(shut, (0.0, 0.0)) is shut


def test_a_statement_about_the_signals_is_one_about_their_zero():
    record = Dataset(U + 50.0, LAWS["linear"][0] + 50.0, 0.1)
    assert all(find_offsets(record, "hysteresis"))
    assert not any(find_offsets(record, "odd"))


@pytest.mark.ci
def test_the_constant_of_an_offset_is_no_term_of_the_law():
    """A law of two terms has two terms in every unit: the zero of the unit adds the constant."""
    y = simulate(lambda y, u, k: 0.8 * y[k - 1] + 0.3 * u[k - 1])
    found = islands.fit(Dataset(U + 1e4, y - 1e4, 0.1), library="polynomial", degree=1, lags=2, max_terms=2)
    assert set(found.best.model.parameter_names) == {"1", "y(k-1)", "u1(k-1)"}
    assert found.best.metrics["validation"]["free_run"].rmse < 1e-8
