"""Response to a pulse: that of a linear system is exact, and that of a hysteresis returns."""

import numpy as np
import pytest
from numpy.typing import NDArray

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, evaluate_fit
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.pulse_response import convolve, respond_to_pulse
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.interface import Simulator
from support.built_in_simulators import make_oscillator, make_piezo
from support.simulated_records import DT, recorded, wave

SAMPLES = 600


def evaluate(simulator: Simulator, u: NDArray[np.float64]) -> CalibrationResult:
    record = recorded(u, wave(SAMPLES))
    simulation = ExtendedSimulator(simulator, (), make_context(record, simulator, SAMPLES))
    target = Target(record.y, np.ones(SAMPLES, dtype=bool), None, {}, fitted=SAMPLES)
    return evaluate_fit(simulation, target, simulation.nominal)


def test_the_response_of_an_oscillator_filters_its_input() -> None:
    fit = evaluate(make_oscillator(0.5, 4.0, 200.0), wave(SAMPLES))
    response = respond_to_pulse(fit)
    assert response is not None
    filtered = convolve(fit.simulation.context.u, response, ())
    assert filtered[250:] == pytest.approx(fit.output[250:], abs=2e-3 * np.abs(fit.output).max())


def test_the_response_of_a_hysteresis_returns_to_zero() -> None:
    """A pulse that turns a slow sweep back leaves a change, of which the sum over a sweep is large."""
    sweep = 40.0 * np.sin(0.2 * np.pi * DT * np.arange(SAMPLES))
    response = respond_to_pulse(evaluate(make_piezo(), sweep))
    assert response is not None
    assert np.abs(response[2:]).max() < 0.02 * response[0]
