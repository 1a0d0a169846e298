"""Linear systems of large orders, which have modes only, and are tried as long as they gain much."""

import numpy as np
import pytest

from islands.data.dataset import Dataset
from islands.data.input_lead import advance_all_inputs
from islands.estimation.latent_data import make_latent_data
from islands.estimation.latent_models import MODAL_ORDERS, ORDERS, fit_linear_systems
from islands.progress import Steps
from support.latent_systems import spring_record

#: Frequencies of the resonances, as parts of the sampling rate.
FREQUENCIES = (0.05, 0.11, 0.18, 0.26, 0.35)


def resonances_record(samples):
    """Return a record of the sum of five resonances of white noise, with noise of 0.01."""
    u, x, y = np.random.default_rng(1).standard_normal(samples), np.zeros(5, complex), np.empty(samples)
    poles = 0.98 * np.exp(2j * np.pi * np.array(FREQUENCIES))
    for k in range(samples):
        y[k] = x.real.sum()
        x = poles * x + 0.2 * u[k]
    return Dataset(u, y + 0.01 * np.random.default_rng(2).standard_normal(samples), 0.1)


def fit(record):
    data = make_latent_data(advance_all_inputs(record))
    return fit_linear_systems(data, Steps())


@pytest.mark.ci
def test_a_system_with_many_resonances_has_modes():
    systems = fit(resonances_record(3000))
    assert [each.order for each in systems] == [*ORDERS, 8, 12, 16]
    found = systems[-2]
    assert found.fitness**0.5 == pytest.approx(0.01, rel=0.2)
    # Two states of a resonance have four entries of A, and each state has one of B and one of C.
    assert found.size <= 4 * 6 + 12 + 12 + 2
    poles = np.linalg.eigvals(found.layout.split(np.array(found.theta))["A"])
    for frequency in FREQUENCIES:
        assert np.abs(np.angle(poles) / (2 * np.pi) - frequency).min() < 1e-3


@pytest.mark.ci
def test_no_large_order_is_tried_if_the_last_one_does_not_gain_much():
    assert not {each.order for each in fit(spring_record(1200, noise=0.02))} & set(MODAL_ORDERS)
