"""Screening: effects are judged by what the parameters of a simulation cannot reproduce."""

import numpy as np
import pytest

from islands.data.dataset import Dataset
from islands.diagnosis.calibration.levenberg_marquardt import evaluate_fit
from islands.diagnosis.calibration.projection import Projection
from islands.diagnosis.calibration.target import Target
from islands.simulators.context import make_context
from islands.simulators.extended import ExtendedSimulator
from islands.simulators.linear import LinearSimulator

SAMPLES = 200_000


@pytest.mark.ci
def test_parameter_whose_change_lets_the_simulation_diverge_absorbs_nothing() -> None:
    """An integrator is finite over a record, and a pole slightly above one is not."""
    u = np.random.default_rng(0).standard_normal(SAMPLES)
    y = np.cumsum(u)
    simulator = LinearSimulator(np.array([1.0, 0.0]), np.array([1.0]), 0.0, 0.0, 0, "um")
    record = Dataset(u[:, None], y, 0.01)
    simulation = ExtendedSimulator(simulator, (), make_context(record, simulator, SAMPLES))
    target = Target(y + 1.0, np.ones(SAMPLES, dtype=bool), None, {}, fitted=SAMPLES)
    fit = evaluate_fit(simulation, target, simulation.nominal)
    shifted = fit.values + 0.01 * np.diag(simulation.scales)
    diverges = [bool(np.isnan(each).any()) for each in simulation.simulate_batch(shifted)]
    assert diverges == [False, False, True, False, False]
    projection = Projection(fit, target)
    # The level absorbs a constant. A ramp is what the parameter would have absorbed approximately.
    constant, ramp = (projection(each) for each in (np.ones(SAMPLES), np.linspace(0.0, 1.0, SAMPLES)))
    assert float(np.linalg.norm(constant)) < 1e-6 * float(np.linalg.norm(ramp))
    assert projection.absorb(np.ones(SAMPLES))[2] == 0.0
