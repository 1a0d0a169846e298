"""Preview of a diagnosis: a simulation, calibrated on a part of a record that is short enough for seconds."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate
from islands.diagnosis.calibration.preparation import count_fitted_samples, make_target, validate_prior
from islands.records.dataset import Dataset
from islands.records.segments import fill_gaps
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.interface import Simulator

#: Largest number of samples of a preview.
MAX_SAMPLES = 5000

#: Number of places per length of a stretch at which it can begin.
_STARTS = 4


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationPreview:
    """Calibrated simulation of a record.

    Attributes
    ----------
    record : Dataset
    fit : CalibrationResult
        Fitted to the first ``fitted`` samples, as at the start of a diagnosis.
    fitted : int
    error_percent : float
        Mean absolute error over all known samples, in per cent of the range of the output.
    """

    record: Dataset
    fit: CalibrationResult
    fitted: int
    error_percent: float


def choose_stretch(record: Dataset, samples: int = MAX_SAMPLES) -> slice:
    """Return the samples of a preview: all, or those in a row over which the output varies most.

    Parameters
    ----------
    record : Dataset
    samples : int
        Largest number of samples.

    Returns
    -------
    slice
        With start and stop.
    """
    if record.samples <= samples:
        return slice(0, record.samples)
    last = record.samples - samples
    starts = np.unique(np.linspace(0, last, 1 + -(-_STARTS * last // samples)).astype(int))
    y = fill_gaps(record.y)
    sums = np.cumsum([y, y**2], axis=1)
    sums = np.concatenate([np.zeros((2, 1)), sums], axis=1)
    first, second = sums[:, starts + samples] - sums[:, starts]
    begin = int(starts[np.argmax(second - first**2 / samples)])
    return slice(begin, begin + samples)


def preview_calibration(
    record: Dataset, simulator: Simulator, tolerance: Mapping[str, float] | None = None
) -> CalibrationPreview:
    """Calibrate a simulation as a diagnosis does first, with the intersample behaviour that it has.

    Parameters
    ----------
    record : Dataset
        See `choose_stretch`.
    simulator : Simulator
        Of that record.
    tolerance : mapping, optional
        See `islands.diagnosis.procedure.diagnose`.

    Raises
    ------
    RecordError
        The record is not suitable for a diagnosis, or the simulation diverges on it.
    SettingsError
        A tolerance is not between 0 and 1, or belongs to no parameter.
    """
    prior_std = validate_prior({**simulator.tolerances, **(tolerance or {})}, simulator)
    fitted = count_fitted_samples(record)
    target = make_target(record, fitted, prior_std)
    simulation = ExtendedSimulator(simulator, (), make_context(record, simulator, fitted))
    fit = calibrate(simulation, target, simulation.nominal)
    error = float(np.nanmean(np.abs(fit.output - record.y)))
    return CalibrationPreview(record, fit, fitted, 100.0 * error / record.output_range)
