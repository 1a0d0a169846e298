"""Calibration of a simulation from several starts."""

import numpy as np

from islands.diagnosis.calibration.starts_calibrator import StartsCalibrator
from islands.diagnosis.calibration.target import Target
from islands.simulators.extended import ExtendedSimulator, make_context
from support.built_in_simulators import make_oscillator
from support.simulated_records import recorded, wave

OSCILLATOR = make_oscillator(0.5, 4.0, 200.0)


def test_a_calibrated_start_keeps_its_own_arrays_alone() -> None:
    """Rows of the outputs of all points took twice the memory of a diagnosis."""
    record = recorded(wave(), 0.01 * wave())
    simulation = ExtendedSimulator(OSCILLATOR, (), make_context(record, OSCILLATOR, record.samples))
    target = Target(record.y, np.ones(record.samples, dtype=bool), None, {}, fitted=record.samples)
    starts = [simulation.nominal, 1.1 * simulation.nominal]
    for start in StartsCalibrator(target)((simulation, starts)):
        assert start.values.base is None
        assert start.output.base is None
        np.testing.assert_array_equal(start.output, simulation.simulate(start.values))
