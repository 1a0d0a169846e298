import numpy as np
import pytest

from islands.estimation.linear.regression import Structure, linearise, minimise, move, project
from islands.estimation.linear.sections import Signals


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


def whiten(signals, fit):
    parts = [fit.residual[0, begin:end] for begin, end in fit.structure.find_intervals(signals)]
    return np.concatenate([part[1:] - fit.structure.noise[0] * part[:-1] for part in parts])


def test_squares_are_those_of_the_whitened_residual(signals, structure):
    fit = project(signals, structure)
    error = whiten(signals, fit)
    assert error @ error == pytest.approx(fit.squares[0])
    assert error.size == fit.counts[0]


def test_error_is_orthogonal_to_the_coefficients_of_the_best_fit(signals, structure):
    (found,) = linearise(signals, project(signals, structure))
    columns, count = found.factor, found.own - 1
    moments = columns[:, :count].T @ columns[:, -1]
    np.testing.assert_allclose(moments / np.linalg.norm(columns[:, :count], axis=0), 0.0, atol=1e-10)


def test_outputs_that_read_inputs_before_a_recording_are_not_counted(signals, structure):
    signals.u[0, 1] += 1.0
    fit = project(signals, structure)
    assert fit.skipped == 2
    assert (fit.residual[0, [0, 1, 140, 141]] == 0.0).all()
    signals.y[0, [0, 1, 140, 141]] = 1e3
    assert project(signals, structure).squares == pytest.approx(fit.squares)


def test_steps_never_raise_the_deviance_and_end_at_a_minimum(signals, structure):
    start = project(signals, structure)
    found = minimise(signals, start, 60, 1e-9)
    assert found.deviance <= start.deviance
    change = 1e-4 * np.ones(structure.free)
    moved = Structure(
        move(found.structure.sections, change), 1, structure.delays, structure.leads, found.structure.noise
    )
    assert project(signals, moved).deviance >= found.deviance - 1e-6
