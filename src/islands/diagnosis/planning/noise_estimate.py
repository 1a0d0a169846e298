"""Noise model of an output, estimated from its measured values before an experiment is planned."""

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import calibrate
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.noise_floor import contrast_periods, explain_residual
from islands.diagnosis.planning.channel_noise import ChannelNoise, NoiseOrigin
from islands.errors import RecordError
from islands.records.dataset import Dataset
from islands.records.noise_model import fit_noise
from islands.rounding import ROUNDING
from islands.simulators.extended import ExtendedSimulator


def estimate_noise(record: Dataset, simulation: ExtendedSimulator, target: Target) -> ChannelNoise:
    """Estimate the noise of a measured output, and its colour.

    If the input repeats, the noise is what differs between periods. Otherwise it is the part of the residual
    of the calibrated simulation that a regression on its signals does not predict: an upper bound, since it
    may contain errors of the simulation.

    Raises
    ------
    RecordError
        The output has gaps or no noise.
    """
    if np.isnan(record.y).any():
        raise RecordError(
            "the noise is unknown, since the record has no complete output: give its standard deviation"
        )
    fitted = target.fitted
    u, y = record.u[:fitted, 0], record.y[:fitted]
    parts, origin = contrast_periods(u, y), NoiseOrigin.PERIODS
    if parts is None:
        base = calibrate(simulation, target, simulation.nominal)
        output = base.output[:fitted]
        left = explain_residual(y - output, u, output, np.random.default_rng(0))[1]
        parts, origin = left[None], NoiseOrigin.RESIDUAL
    if np.max(np.abs(parts)) <= ROUNDING * np.max(np.abs(y)):
        raise RecordError("the output has no noise: give the standard deviation of that in the experiment")
    # A difference of fractional order would have no stationary variance.
    model = fit_noise(parts.ravel(), segments=(parts.shape[1],) * len(parts), difference_orders=())
    # In a record, noise that is slower than it and a drift are the same.
    return ChannelNoise(model.limit_poles(parts.size), origin)
