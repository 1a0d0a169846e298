"""Fits of corrected records: parameters stay within their tolerances."""

from dataclasses import replace

import numpy as np
import pytest

from islands.diagnosis.calibration.levenberg_marquardt import calibrate
from islands.diagnosis.calibration.preparation import make_target
from islands.diagnosis.gross_errors.corrected_simulation import limit_to_tolerances
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import PhysicalSpec
from support.simulated_records import recorded, simulate_oscillator, wave


def test_fit_within_its_tolerances_keeps_its_values() -> None:
    u = wave(400)
    noise = 0.002 * np.random.default_rng(5).standard_normal(u.size)
    record = recorded(u, simulate_oscillator(u, 0.5, 4.0, 200.0) + noise, units=("N", "m"))
    given = {"m": 0.5, "c": 4.0, "k": 200.0}
    simulator = make_simulator(PhysicalSpec(kind="second-order", parameters=given), record)
    simulation = ExtendedSimulator(simulator, (), make_context(record, simulator, 300))
    target = make_target(record, 300, {"m": 0.02, "c": 0.05, "k": 0.02})
    fit = calibrate(simulation, target, simulation.nominal)
    assert limit_to_tolerances(fit, target) is fit
    far = replace(fit, values=fit.values * np.array([1.5, 1.0, 1.0, 1.0, 1.0]))
    assert limit_to_tolerances(far, target).values[0] == pytest.approx(0.5 * 1.08)
