"""Block bootstrap of parameters: distribution, constraints, determinism."""

import numpy as np
import pytest

from islands.estimation.block_bootstrap import draw_parameters
from islands.estimation.estimate import estimate
from islands.expressions.parsing import parse
from islands.models.regressor import regressor
from islands.records.dataset import Dataset


def terms(*texts):
    return tuple(regressor(parse(text))[1] for text in texts)


LINEAR = terms("y(k-1)", "u(k-1)")
HYSTERESIS = terms("y(k-1)", "phi1(u(k-1), u(k-2))", "y(k-1)*phi1(u(k-1), u(k-2))", "y(k-1)*u(k-1)")


def record(samples=900, noise=0.1, seed=0, scale=1.0):
    """Return a record of a linear system with white equation noise."""
    rng = np.random.default_rng(seed)
    u, e = rng.standard_normal(samples), noise * rng.standard_normal(samples)
    y = np.zeros(samples)
    for k in range(1, samples):
        y[k] = 0.7 * y[k - 1] + 0.5 * u[k - 1] + e[k]
    return Dataset(u, scale * y, 0.1)


def draw(model, data, draws=200, constraints="none", interval=1, seed=3):
    return next(draw_parameters(model, data, interval, constraints, None, draws, np.random.default_rng(seed)))


def test_draws_scatter_like_the_estimate_under_white_noise():
    data = record()
    model = estimate(LINEAR, data).model
    drawn = draw(model, data, draws=600)
    psi = np.column_stack([data.y[:-1], data.u[:-1, 0]])
    variance = np.var(data.y[1:] - psi @ np.array(model.parameters))
    expected = np.sqrt(variance * np.diag(np.linalg.inv(psi.T @ psi)))
    assert np.std(drawn, axis=0) == pytest.approx(expected, rel=0.25)
    assert np.abs(drawn.mean(axis=0) - model.parameters) == pytest.approx(0.0, abs=0.2 * expected.max())


def test_a_draw_minimises_the_weighted_squares_of_the_blocks():
    """One Gauss-Newton step is exact for least squares."""
    data = record(samples=401)
    model = estimate(LINEAR, data).model
    found = draw(model, data, draws=1)[0]
    weights = np.repeat(np.random.default_rng(3).standard_exponential(20), 20)[:, None]
    psi = np.column_stack([data.y[:-1], data.u[:-1, 0]])
    expected = np.linalg.solve(psi.T @ (weights * psi), psi.T @ (weights[:, 0] * data.y[1:]))
    assert found == pytest.approx(expected, rel=1e-7)


def test_every_draw_meets_the_constraints():
    data = record()
    model = estimate(HYSTERESIS[:3], data, "hysteresis").model
    drawn = draw(model, data, constraints="hysteresis")
    assert np.ptp(drawn[:, 0]) == 0.0
    assert drawn[0, 0] == pytest.approx(1.0, abs=1e-15)
    assert (np.std(drawn[:, 1:], axis=0) > 0.0).all()


def test_a_seed_determines_the_draws():
    data = record(samples=300)
    model = estimate(LINEAR, data).model
    assert (draw(model, data) == draw(model, data)).all()
    assert (draw(model, data) != draw(model, data, seed=4)).all()


def test_no_draw_has_an_excluded_sign():
    """The law lacks the term: without the constraint, many draws have the other sign."""
    data = record(samples=300)
    structure = terms("y(k-1)", "u(k-1)", "u(k-2)")
    free = estimate(structure, data).model.parameters
    statement = f"[u(k-2)] {'>=' if free[2] > 0.0 else '<='} 0"
    model = estimate(structure, data, statement).model
    drawn = draw(model, data, constraints=statement)
    assert 0 < len(drawn) < 200
    assert (drawn[:, 2] * free[2] >= 0.0).all()


def test_later_draws_leave_out_directions_of_little_information():
    """Two inputs are almost equal: the data hardly tell the difference of their parameters."""
    rng = np.random.default_rng(1)
    u = rng.standard_normal(600)
    inputs = np.column_stack([u, u + 1e-3 * rng.standard_normal(600)])
    y = np.append(0.0, inputs.sum(axis=1)[:-1]) + 0.1 * rng.standard_normal(600)
    data = Dataset(inputs, y, 0.1)
    model = estimate(terms("u1(k-1)", "u2(k-1)"), data).model
    drawn = list(draw_parameters(model, data, 1, "none", None, 100, np.random.default_rng(3)))
    assert len(drawn) == 2
    sums, differences = ([np.std(each @ (1.0, sign)) for each in drawn] for sign in (1.0, -1.0))
    assert sums[1] == pytest.approx(sums[0], rel=0.1)
    assert differences[0] > 1.0
    assert differences[1] < 0.1
