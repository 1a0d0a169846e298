import numpy as np
import pytest
from scipy.signal import lfilter

from islands.estimation.linear.sections import Signals
from islands.estimation.linear.starts import fit_high_order


def test_dead_time_ends_before_the_first_significant_coefficient():
    random = np.random.default_rng(1)
    u = random.normal(size=1500)
    poles = [0.9, 0.6 + 0.6j, 0.6 - 0.6j]
    y = lfilter([0.0] * 6 + [1.0, 0.3], np.poly(poles).real, u) + random.normal(0.0, 0.05, 1500)
    found = fit_high_order(Signals(u[None], y[None], np.array([1500])), 20)
    assert found.delays.tolist() == [[5]]


@pytest.mark.parametrize("direct", [0.0, 5.0])
def test_direct_path_is_the_coefficient_of_the_same_sample(direct):
    random = np.random.default_rng(2)
    u = np.repeat(random.uniform(-1.0, 1.0, 100), 20)
    y = direct * u + np.cumsum(np.append(0.0, 0.02 * u[:-1])) + lfilter([0.0, 0.2], [1.0, -0.9], u)
    y += random.normal(0.0, 1e-3, u.size)
    found = fit_high_order(Signals(u[None], y[None], np.array([2000])), 20, feedthrough=True)
    assert found.leads.tolist() == [[direct > 0.0]]
    assert found.delays.tolist() == [[0]]
    assert found.polynomials[0][1][0, 0] == pytest.approx(direct, abs=1e-3)
