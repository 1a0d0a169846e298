import numpy as np
import pytest

from islands.estimation.linear.regression import (
    Structure,
    differentiate,
    make_columns,
    minimise,
    move,
    project,
    triangulate,
)
from islands.estimation.linear.sections import Signals, respond_freely


@pytest.fixture
def signals():
    random = np.random.default_rng(1)
    u, ends = random.normal(size=(2, 300)), np.array([140, 300])
    for begin in (0, 140):
        u[:, begin : begin + 3] = u[:, begin, None]  # at rest
    return Signals(u, random.normal(size=(1, 300)), ends)


@pytest.fixture
def structure():
    sections = np.array([-1.5, 0.8]), np.array([-0.9])
    leads = np.array([[True, False]])
    return Structure(sections, 1, np.array([[2, 0]]), leads, (np.array([0.5]),))


def simulate(signals, structure, fit):
    y = fit.coefficients[0] @ make_columns(signals, structure, 0)
    for (begin, end), start in zip(signals.bounds, fit.starts[0], strict=True):
        y[begin:end] += start @ respond_freely(structure.parts, end - begin)
    return y


def test_sensitivities_are_derivatives_of_the_free_run(signals, structure):
    fit = project(signals, structure)
    for place, exact in enumerate(differentiate(signals, fit, 0)):
        change = 1e-6 * np.eye(structure.free)[place]
        sides = [
            simulate(signals, Structure(move(structure.sections, sign * change), 1, *rest), fit)
            for sign, rest in ((s, (structure.delays, structure.leads, structure.noise)) for s in (1.0, -1.0))
        ]
        np.testing.assert_allclose((sides[0] - sides[1]) / 2e-6, exact, atol=1e-6 * np.abs(exact).max())


def test_residual_is_the_output_less_the_free_run(signals, structure):
    fit = project(signals, structure)
    np.testing.assert_allclose(fit.residual[0], signals.y[0] - simulate(signals, structure, fit), atol=1e-10)


def test_outputs_that_read_inputs_before_a_recording_are_not_counted(signals, structure):
    signals.u[0, 1] += 1.0
    fit = project(signals, structure)
    assert fit.skipped == 2
    assert (fit.residual[0, [0, 1, 140, 141]] == 0.0).all()
    signals.y[0, [0, 1, 140, 141]] = 1e3
    assert project(signals, structure).squares == pytest.approx(fit.squares)


def test_blocks_have_the_products_of_all_samples():
    rows = np.random.default_rng(2).normal(size=(3, 20_000))
    factor = triangulate(rows, np.zeros(0))
    np.testing.assert_allclose(factor.T @ factor, rows @ rows.T, atol=1e-8)


def test_steps_never_raise_the_deviance_and_end_at_a_minimum(signals, structure):
    start = project(signals, structure)
    found = minimise(signals, start, 60, 1e-9)
    assert found.deviance <= start.deviance
    change = 1e-4 * np.ones(structure.free)
    moved = Structure(
        move(found.structure.sections, change), 1, structure.delays, structure.leads, found.structure.noise
    )
    assert project(signals, moved).deviance >= found.deviance - 1e-6
