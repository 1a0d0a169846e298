"""Laws of modes that inputs have of their own, that they share, and that are a dead time."""

import numpy as np
import pytest
from scipy.signal import lfilter

from islands.estimation.linear.identify import Search, identify_linear, scale_signals
from islands.estimation.linear.noise import WHITE
from islands.estimation.linear.regression import make_structure, minimise, project
from islands.progress import Steps


def respond(u, pole, gain, delay):
    return lfilter(np.r_[np.zeros(delay + 1), gain * (1.0 - pole)], [1.0, -pole], u)


def steps(random, samples, inputs):
    return np.repeat(random.uniform(-1.0, 1.0, (samples // 20, inputs)), 20, axis=0)


def count_inputs(model):
    """Return the number of inputs that drive each mode."""
    return np.count_nonzero(model.b[0], axis=1).tolist()


@pytest.mark.parametrize(
    ("poles", "driven"), [((0.9, 0.7), [1, 1]), ((0.85, 0.85), [2])], ids=["own", "shared"]
)
def test_inputs_share_a_mode_only_if_the_process_does(poles, driven):
    random = np.random.default_rng(1)
    u = steps(random, 400, 2)
    y = respond(u[:, 0], poles[0], 1.0, 0) + respond(u[:, 1], poles[1], -1.0, 0)
    model = identify_linear(u, y + random.normal(0.0, 0.02, 400), max_order=2, max_dead_time=2)
    assert count_inputs(model) == driven
    np.testing.assert_allclose(np.sort(model.poles.real), np.unique(poles), atol=0.02)


def improve(u, y, poles, delay):
    """Return the structure after changes of one where every mode is in the responses to all inputs."""
    signals, _ = scale_signals(u, y, 1.0)
    delays = np.full((1, u.shape[1]), delay)
    sections = tuple(np.array([-pole]) for pole in poles)
    start = make_structure(sections, 0, delays, delays < 0, (WHITE,), signals.first)
    search = Search(signals, 8, 2, False, Steps())
    fit, _ = search.improve(minimise(signals, project(signals, start), 20))
    return fit.structure


def test_a_mode_that_follows_a_dead_time_becomes_one():
    random = np.random.default_rng(2)
    u = steps(random, 400, 1)
    y = respond(u[:, 0], 0.9, 1.0, 5) + random.normal(0.0, 0.01, 400)
    found = improve(u, y, (0.9, np.exp(-1.0 / 3.0)), 2)
    assert (found.order, found.delays.tolist()) == (1, [[5]])


def test_a_shared_mode_is_divided_where_inputs_have_their_own():
    random = np.random.default_rng(3)
    u = steps(random, 400, 2)
    y = respond(u[:, 0], 0.9, 1.0, 0) + respond(u[:, 1], 0.7, -1.0, 0) + random.normal(0.0, 0.01, 400)
    found = improve(u, y, (0.8,), 0)
    assert (found.order, found.drives.sum(axis=(0, 1)).tolist()) == (2, [1, 1])
