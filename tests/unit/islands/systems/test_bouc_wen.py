"""Bouc-Wen piezoelectric actuator, equation (11)."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from islands.errors import RecordError
from islands.systems import signals
from islands.systems.bouc_wen import BoucWenPiezo, simulate

DT = 1e-3
PIEZO = BoucWenPiezo()


def integrate_exactly(piezo, u, dt):
    """Integrate equation (11) by an adaptive high-order method, restarted at every kink of the voltage."""
    h = [0.0]
    for step in np.diff(u):
        v = step / dt

        def derivative(_, state, v=v):
            return piezo.A * v - piezo.beta * abs(v) * state - piezo.gamma * v * np.abs(state)

        h.append(solve_ivp(derivative, (0.0, dt), [h[-1]], method="DOP853", rtol=1e-11, atol=1e-13).y[0, -1])
    return piezo.dp * u - np.array(h)


def test_runge_kutta_agrees_with_an_adaptive_integrator():
    u = signals.sine(DT, 0.4, 40.0, 5.0)
    y, exact = simulate(PIEZO, u, DT), integrate_exactly(PIEZO, u, DT)
    kink = np.flatnonzero(PIEZO.dp * u - exact < 0)[0] - 1
    assert kink > 80
    np.testing.assert_allclose(y[:kink], exact[:kink], atol=1e-9)
    # If the state crosses zero inside a step, |h| has a kink and the method loses its order.
    np.testing.assert_allclose(y, exact, atol=1e-3)
    assert np.ptp(exact) > 60.0


def test_default_parameters_are_those_of_the_paper():
    assert (PIEZO.A, PIEZO.beta, PIEZO.gamma, PIEZO.dp) == (0.9, 0.008, 0.008, 1.6)


def test_hysteretic_state_is_linear_in_the_voltage_after_a_reversal():
    # With beta = gamma the loss vanishes while slope and state have opposite signs, so h' = A u'.
    u = np.linspace(0.0, 20.0, 2001)
    y = simulate(PIEZO, -u, DT, h0=30.0)
    np.testing.assert_allclose(y, -PIEZO.dp * u - (30.0 - PIEZO.A * u), atol=1e-10)


def test_hysteretic_state_saturates_at_its_theoretical_level():
    u = np.linspace(0.0, 600.0, 60001)
    h = PIEZO.dp * u - simulate(PIEZO, u, DT)
    # h' = u' (A - (beta + gamma) h) has the closed-form solution below with the limit A / (beta + gamma).
    limit = PIEZO.A / (PIEZO.beta + PIEZO.gamma)
    np.testing.assert_allclose(h, limit * (1 - np.exp(-u * (PIEZO.beta + PIEZO.gamma))), atol=1e-8)
    assert h[-1] == pytest.approx(56.25, abs=0.01)


def test_loop_does_not_depend_on_the_rate():
    fine = 1e-4
    slow = simulate(PIEZO, signals.sine(fine, 8.0, 40.0, 0.25), fine)[::20]
    fast = simulate(PIEZO, signals.sine(fine, 0.4, 40.0, 5.0), fine)
    assert np.ptp(fast) > 60.0
    np.testing.assert_allclose(slow, fast, atol=2e-3)


def test_inconsistent_shapes_are_refused():
    u = np.zeros(5)
    with pytest.raises(RecordError, match=r"5 samples require 4 slopes, got \(5,\)"):
        simulate(PIEZO, u, DT, slope=u)
    with pytest.raises(RecordError, match=r"got \(5, 1\)"):
        simulate(PIEZO, u[:, None], DT)
    with pytest.raises(RecordError, match=r"got \(0,\)"):
        simulate(PIEZO, u[:0], DT)
    with pytest.raises(RecordError, match="sampling time"):
        simulate(PIEZO, u, 0.0)
