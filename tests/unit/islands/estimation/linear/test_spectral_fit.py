"""Fit of a state space to spectra: exact slopes, the true order, and the effect of the amplitude."""

from dataclasses import replace

import numpy as np
import pytest

from islands.estimation.linear.frequency_response import FrequencyResponse, estimate_response
from islands.estimation.linear.spectral_fit import (
    ResponseAtAmplitude,
    _Factors,
    _move,
    fit_shared_system,
    refine,
    schedule,
)

from .test_frequency_response import A, B, C, respond, simulate


def make_data(system, amplitude):
    frequencies = np.linspace(0.05, 3.0, 50)
    a, b, c, d = system.at_amplitude(amplitude)
    values = c @ np.linalg.solve(np.exp(1j * frequencies)[:, None, None] * np.eye(len(a)) - a, b + 0j) + d
    power = np.broadcast_to(np.eye(2) + 0j, (50, 2, 2))
    return ResponseAtAmplitude(FrequencyResponse(frequencies, values, power, np.full(2, 1e-6), 50), amplitude)


def make_linear():
    frequencies = np.linspace(0.05, 3.0, 50)
    power = np.broadcast_to(np.eye(2) + 0j, (50, 2, 2))
    response = FrequencyResponse(frequencies, respond(frequencies), power, np.full(2, 1e-6), 50)
    return fit_shared_system([ResponseAtAmplitude(response, 0.0)], 6)


def make_scheduled():
    rng, linear = np.random.default_rng(0), make_linear()
    order = linear.order
    return replace(
        linear,
        e=linear.b,
        f=linear.d,
        w=0.02 * rng.standard_normal((2, order)),
        v=0.05 * rng.standard_normal((2, 2)),
    )


def test_the_order_of_a_record_with_noise_is_found():
    rng = np.random.default_rng(6)
    u = rng.standard_normal((6, 1000, 2))
    y = np.stack([simulate(each) for each in u])
    response = estimate_response(u, y + 0.05 * y.std() * rng.standard_normal(y.shape))
    found = fit_shared_system([ResponseAtAmplitude(response, 0.0)], 8)
    assert found.order == 3
    assert not found.is_direct
    np.testing.assert_allclose(
        np.sort_complex(np.linalg.eigvals(found.a)), np.sort_complex(np.linalg.eigvals(A)), atol=0.02
    )


def test_a_system_without_noise_is_exact():
    found = make_linear()
    gain = found.c @ np.linalg.solve(np.eye(found.order) - found.a, found.b) + found.d
    np.testing.assert_allclose(gain, C @ np.linalg.solve(np.eye(3) - A, B), rtol=1e-6)


def test_the_slopes_are_those_of_differences():
    system = make_scheduled()
    data = make_data(make_linear(), 0.7)
    slopes = _Factors(system, data).differentiate(system, 0.7)
    for place in range(0, slopes.shape[1], 3):
        step = np.zeros(slopes.shape[1])
        step[place] = 1e-6
        sides = [_Factors(_move(system, sign * step), data).error.reshape(-1) for sign in (-1.0, 1.0)]
        np.testing.assert_allclose((sides[0] - sides[1]) / 2e-6, slopes[:, place], rtol=1e-4, atol=1e-3)


@pytest.mark.ci
def test_an_effect_of_the_amplitude_is_found():
    true = make_scheduled()
    data = [make_data(true, amplitude) for amplitude in (0.0, -1.0, 1.0)]
    linear = refine(make_linear(), data)
    found = schedule(make_linear(), data, 0)
    assert found.deviance < 1e-3 * linear.deviance
    assert found.is_stable((-1.0, 0.0, 1.0))
