"""Linear systems: frequency response, resonances and their statement."""

import numpy as np
import pytest

from islands.models.linear_system import LinearSystem, describe_poles, find_resonances
from islands.records.dataset import Dataset
from islands.simulation.predictors import free_run
from support.latent_systems import SPRING, make_model


def test_a_first_order_lag_has_the_response_of_its_formula():
    lag = LinearSystem(np.array([[0.9]]), np.array([[0.5, 0.0]]), np.array([2.0]), np.array([0.0, 0.3]))
    z = np.exp(2j * np.pi * np.array([0.0, 0.1, 0.5]))
    response = lag.respond(np.array([0.0, 0.1, 0.5]))
    assert response[0] == pytest.approx(1.0 / (z - 0.9))
    assert response[1] == pytest.approx(np.full(3, 0.3))


def test_an_undamped_mode_has_no_response_at_its_frequency():
    integrator = LinearSystem(np.eye(1), np.ones((1, 1)), np.ones(1), np.zeros(1))
    at_rest, moving = integrator.respond(np.array([0.0, 0.5]))[0]
    assert np.isnan(at_rest)
    assert moving == pytest.approx(-0.5)


def test_resonances_are_those_of_the_continuous_system():
    rate = 2.0 * np.pi * 5.0 * (-0.1 + 1j * np.sqrt(1.0 - 0.1**2))
    poles = np.exp(0.01 * np.array([rate, rate.conjugate(), -2.0]))
    ((frequency, damping),) = find_resonances(poles, 0.01)
    assert (frequency, damping) == pytest.approx((5.0, 0.1))
    assert describe_poles(poles, 0.01) == (
        "time constant 0.5 s",
        "resonance at 5 Hz with a damping ratio of 0.1",
    )


def test_standard_errors_of_modes_are_stated_in_their_order():
    poles = [np.exp(-0.01 / 0.5), 0.5 + 0.5j, 0.5 - 0.5j, 0.0, -0.3, 1.1]
    assert describe_poles(poles, 0.01, (0.001, 0.02, 0.31, 0.0123, 0.004)) == (
        "a mode that does not decay (pole 1.1 +- 0.001)",
        "time constant 0.5 +- 0.02 s",
        "resonance at 13.66 +- 0.31 Hz with a damping ratio of 0.404 +- 0.012",
        "an alternating mode (pole -0.3 +- 0.004)",
        "a delay of one sample",
    )


def test_the_static_gain_is_the_response_at_rest():
    lag = LinearSystem(np.array([[0.9]]), np.array([[0.5, 0.0]]), np.array([2.0]), np.array([0.0, 0.3]))
    assert lag.static_gains == pytest.approx(lag.respond(np.zeros(1))[:, 0].real)
    assert np.isnan(LinearSystem(np.eye(1), np.ones((1, 1)), np.ones(1), np.zeros(1)).static_gains).all()


@pytest.mark.ci
@pytest.mark.parametrize("frequency", [0.02, 0.0525, 0.2])
def test_the_response_at_rest_is_the_ratio_of_a_small_sine(frequency):
    """The spring is stiffer at the operating point, and the output reads the input at once."""
    wiring = {**dict(list(SPRING.items())[:7]), "d": 0.4, **dict(list(SPRING.items())[7:])}
    model = make_model(wiring, input_names=("u_V+1",), operating_inputs=(1.5,))
    time, amplitude = np.arange(4000), 1e-4
    sine = np.exp(2j * np.pi * frequency * time)
    u = 1.5 + amplitude * sine.real
    rest = 1.2 * model.rest[0] + 0.3 + 0.4 * 1.5
    record = Dataset(u, np.full(len(u), rest), 0.01, ("u_V",), "y_mm")
    y = free_run(model, record).y[2000:]
    basis = np.column_stack([sine[2000:].real, sine[2000:].imag, np.ones(2000)])
    cosine, quadrature, _ = np.linalg.lstsq(basis, y, rcond=None)[0]
    (response,) = model.linearise(model.rest).respond(np.array([frequency]))[0]
    assert (cosine - 1j * quadrature) / amplitude == pytest.approx(response, rel=1e-3)
