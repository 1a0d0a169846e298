import numpy as np
from scipy.signal import lfilter

from islands.estimation.linear.noise import WHITE, fit_noises, limit_zeros

NOISE = np.array([[1.6, -0.81], [-0.9, 0.5]])


def make(samples=4000, noise=NOISE):
    white = np.random.default_rng(1).normal(size=samples)
    return lfilter(np.r_[1.0, noise[1]], np.r_[1.0, -noise[0]], white)


def whiten(v, noise):
    return lfilter(np.r_[1.0, -noise[0]], np.r_[1.0, noise[1]], v)


def test_noise_that_is_added_has_its_order_and_leaves_white_noise():
    added, _ = fit_noises(make(), [1500, 2500], np.array([0.5]))
    assert added.shape == NOISE.shape
    assert whiten(make(), added)[50:].std() < 1.02


def test_noise_that_drives_the_states_has_the_poles_of_the_system():
    poles = np.roots([1.0, *-NOISE[0]])
    _, driving = fit_noises(make(), [4000], poles)
    np.testing.assert_allclose(driving[0], NOISE[0])
    np.testing.assert_allclose(driving[1], NOISE[1], atol=0.1)


def test_white_noise_has_no_state():
    assert fit_noises(make(noise=WHITE), [4000], np.zeros(0))[0].shape == (2, 0)


def test_zeros_stay_inside_of_the_circle_that_a_record_shows():
    differences = np.diff(np.random.default_rng(2).normal(size=301))  # a zero at 1
    added = fit_noises(differences, [300], np.zeros(0))[0]
    assert np.abs(np.roots([1.0, *added[1]])).max() < limit_zeros(300)
