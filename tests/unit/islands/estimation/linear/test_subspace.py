"""Subspace of a frequency response: the states of a system without noise are exact."""

import numpy as np

from islands.estimation.linear.frequency_response import FrequencyResponse
from islands.estimation.linear.subspace import find_subspace

from .test_frequency_response import A, respond


def make_response():
    frequencies = np.linspace(0.05, 3.0, 60)
    power = np.broadcast_to(np.eye(2) + 0j, (60, 2, 2))
    return FrequencyResponse(frequencies, respond(frequencies), power, np.ones(2), 60)


def test_the_poles_of_a_response_without_noise_are_exact():
    a, _ = find_subspace(make_response(), 6).find_states(3)
    np.testing.assert_allclose(
        np.sort_complex(np.linalg.eigvals(a)), np.sort_complex(np.linalg.eigvals(A)), atol=1e-9
    )


def test_the_singular_values_show_the_order():
    values = find_subspace(make_response(), 6).values
    assert values[2] > 1e-3 * values[0]
    assert values[3] < 1e-9 * values[0]


def test_unstable_poles_are_mirrored():
    a, _ = find_subspace(make_response(), 12).find_states(9)
    assert np.abs(np.linalg.eigvals(a)).max() < 1.0
