from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from islands.estimation.linear.regression import (
    linearise,
    make_structure,
    minimise,
    move,
    project,
    restrict,
)
from islands.estimation.linear.sections import Signals


@pytest.fixture
def signals():
    random = np.random.default_rng(1)
    u, ends = random.normal(size=(2, 300)), np.array([140, 300])
    return Signals(u, random.normal(size=(1, 300)), ends)


@pytest.fixture(params=["free", "mapped"])
def structure(request, signals):
    """Return free numerators, or fewer zeros, a mode that one input does not drive, and a start at rest."""
    found = make_free_structure(signals)
    if request.param == "free":
        return found
    drives = np.array([[[True, True, True], [True, False, True]]])
    return replace(found, excess=np.array([[3, 2]]), drives=drives, rests=True)


def make_free_structure(signals):
    sections = np.array([-1.5, 0.8]), np.array([-0.9])
    leads = np.array([[True, False]])
    noise = (np.array([[0.5], [0.3]]),)
    return make_structure(sections, 1, np.array([[2, 0]]), leads, noise, signals.first)


def test_squares_are_those_of_the_white_noise_and_of_its_state_before_a_recording(signals, structure):
    fit, (d, c) = project(signals, structure), structure.noise[0][:, 0]
    deviation = (d + c) / np.sqrt(1.0 - d**2)  # of the state of noise that is stationary
    squares = 0.0
    for (begin, end), (state, *_) in zip(signals.bounds, fit.states[0], strict=True):
        driven = lfilter([1.0, -d], [1.0, c], fit.residual[0, begin:end])
        free = lfilter([1.0], [1.0, c], np.eye(1, end - begin)[0])
        squares += np.sum((driven - state * free) ** 2) + (state / deviation) ** 2
    assert squares == pytest.approx(fit.squares[0])


def test_error_is_orthogonal_to_the_coefficients_of_the_best_fit(signals, structure):
    fit = project(signals, structure)
    columns, count = linearise(signals, fit)[0].factor, fit.parameters[0].size
    moments = columns[:, :count].T @ columns[:, -1]
    np.testing.assert_allclose(moments / np.linalg.norm(columns[:, :count], axis=0), 0.0, atol=1e-10)


def test_outputs_that_read_inputs_before_a_recording_are_not_counted(signals, structure):
    structure = replace(structure, before=None, rests=False)
    fit = project(signals, structure)
    assert (fit.residual[0, [0, 1, 140, 141]] == 0.0).all()
    signals.y[0, [0, 1, 140, 141]] = 1e3
    assert project(signals, structure).squares == pytest.approx(fit.squares)


def test_steps_never_raise_the_deviance_and_end_at_a_minimum(signals, structure):
    start = project(signals, structure)
    found = minimise(signals, start, 60, 1e-9)
    assert found.deviance <= start.deviance
    change, (noise,) = 1e-4 * np.ones(structure.free), found.structure.noise
    for moved in (
        replace(found.structure, sections=move(found.structure.sections, change)),
        replace(found.structure, noise=(noise + 1e-4,)),
    ):
        assert project(signals, moved).deviance >= found.deviance - 1e-6


def test_restricted_noise_is_nearer_to_the_true_one_than_that_of_the_largest_likelihood():
    random, delays, poles = np.random.default_rng(1), np.zeros((1, 1), np.int64), []
    start = make_structure(
        (np.array([-0.9]),), 0, delays, delays > 0, (np.array([[0.9], [0.0]]),), np.zeros((1, 1))
    )
    for _ in range(20):
        u = np.repeat(random.normal(size=8), 25)
        u[0] = 0.0
        y = lfilter([0.0, 0.1], [1.0, -0.9], u) + lfilter([1.0], [1.0, -0.9], random.normal(0.0, 0.1, 200))
        signals = Signals(u[None], y[None], np.array([200]))
        fit = minimise(signals, project(signals, start), 20)
        poles.append([each.structure.noise[0][0, 0] for each in (fit, restrict(signals, fit))])
    likeliest, restricted = np.abs(np.mean(poles, axis=0) - 0.9)
    assert restricted < 0.7 * likeliest
