import numpy as np
from scipy.signal import lfilter

from islands.estimation.linear.sections import Signals
from islands.estimation.linear.starts import fit_high_order


def test_hankel_matrix_has_the_poles_and_the_dead_time():
    random = np.random.default_rng(1)
    u = random.normal(size=1500)
    poles = [0.9, 0.6 + 0.6j, 0.6 - 0.6j]
    y = lfilter([0.0] * 6 + [1.0, 0.3], np.poly(poles).real, u) + random.normal(0.0, 0.05, 1500)
    found = fit_high_order(Signals(u[None], y[None], np.array([1500])), 20)
    assert found.delays.tolist() == [[5]]
    np.testing.assert_allclose(np.sort_complex(found.find_poles(3)), np.sort_complex(poles), atol=0.02)
