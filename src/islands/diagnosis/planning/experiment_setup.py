"""Set-up of a planned experiment: checks, noise, and the effects that a diagnosis would search for."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import calibrate
from islands.diagnosis.calibration.preparation import MIN_SAMPLES, make_target, select_effects
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.noise_floor import contrast_periods, explain_residual
from islands.diagnosis.planning.channel_noise import ChannelNoise, NoiseOrigin, make_white_noise
from islands.diagnosis.planning.experiment import Experiment, MeasuredChannel
from islands.effects.catalogue import EFFECTS
from islands.effects.interface.effect import Effect
from islands.errors import RecordError, SettingsError
from islands.records.dataset import Dataset
from islands.records.noise_model import fit_noise
from islands.records.split import estimation_part
from islands.rounding import ROUNDING
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.interface import Simulator


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


def make_experiment(
    record: Dataset,
    simulator: Simulator,
    noise_std: float | None,
    prior_std: Mapping[str, float],
    catalogue: Sequence[Effect] = EFFECTS,
) -> tuple[Experiment, list[Effect]]:
    """Make the experiment with the input of a record, and list the effects that it could show.

    Parameters
    ----------
    record : Dataset
        Record with the input, and further channels. Its output may be missing.
    simulator : Simulator
    noise_std : float or None
        Standard deviation of the noise of the output, which is white then; None to estimate a noise model
        from the measured output.
    prior_std : mapping
        Relative standard deviations of parameters about their nominal values.

    Raises
    ------
    RecordError
        The record is too short or has several recordings, the simulation diverges on it, or there is no
        output to estimate the noise from.
    SettingsError
        The noise is not positive, or the simulation is a recorded column.
    """
    _check(record, simulator, noise_std)
    fitted = estimation_part(record).samples
    context = make_context(_fill_output(record), simulator, fitted)
    if noise_std is None:
        target = make_target(record, fitted, prior_std)
        noise = estimate_noise(record, ExtendedSimulator(simulator, (), context), target)
    else:
        noise = make_white_noise(noise_std)
    output = MeasuredChannel(record.output_name, record.output_unit, simulator, context, noise)
    effects = select_effects(simulator, context, prior_std, catalogue)
    return Experiment((output,), prior_std, fitted), effects


def _check(record: Dataset, simulator: Simulator, noise_std: float | None) -> None:
    if record.samples < MIN_SAMPLES:
        raise RecordError(
            f"the input has {record.samples} samples, and a diagnosis needs at least {MIN_SAMPLES}: plan a "
            "longer experiment"
        )
    if len(record.segments) > 1:
        raise RecordError(f"a plan is for one recording, and the record has {len(record.segments)}: give one")
    if simulator.is_recorded:
        raise SettingsError(
            "a recorded column cannot be simulated with other inputs: give a simulation that computes it"
        )
    if noise_std is not None and not (np.isfinite(noise_std) and noise_std > 0.0):
        raise SettingsError(f"the noise is a positive number in the unit of the output, got {noise_std:g}")


def _fill_output(record: Dataset) -> Dataset:
    """Return a record whose output is zero where it is missing; the scale of a resting output needs it."""
    return replace(record, y=np.nan_to_num(record.y))
