"""Interpolation through six neighbours."""

import numpy as np
from numpy.polynomial import Polynomial

from islands.kernels.lagrange import interpolate_at


def test_a_polynomial_of_degree_five_is_exact_between_its_samples():
    polynomial = Polynomial([0.3, -1.0, 0.5, 0.2, -0.1, 0.02])
    places = np.linspace(2.0, 7.0, 101)
    found = interpolate_at(polynomial(np.arange(10.0) / 4.0), places)
    np.testing.assert_allclose(found, polynomial(places / 4.0), rtol=1e-12)


def test_samples_are_exact_and_the_end_values_are_held():
    signal = np.random.default_rng(0).normal(size=20)
    found = interpolate_at(signal, np.array([-3.0, 0.0, 7.0, 19.0, 40.0]))
    np.testing.assert_array_equal(found, signal[[0, 0, 7, 19, 19]])
