"""Choice of a sampling rate: noise of an oversampled record is averaged before the search.

In one sampling time, an oversampled output changes less than its noise, so a model selected by its
one-step-ahead error describes the noise. Means of consecutive samples change more and have less noise.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from math import inf, isfinite, lcm

import numpy as np
from numpy.typing import NDArray

from islands.estimation.estimate import FittedStructure, estimate
from islands.estimation.forward_selection import forward_selection
from islands.estimation.refinement import RefinedModel, refine
from islands.estimation.structure_selection.deviations import find_offsets, subtract_offsets
from islands.facade.trials.library import TrialLibrary
from islands.models.narx import Model
from islands.progress import Steps
from islands.records.averaging import AUTO, average_samples, check_average
from islands.records.channel_names import parse_channel_name
from islands.records.dataset import Dataset
from islands.records.inspection.oversampling import COUNTS, is_noisy, keeps_bandwidth
from islands.records.split import Split, average_split
from islands.simulation.initial_outputs import simulate_freely
from islands.simulation.outcome import EvaluationOutcome
from islands.simulation.predictors import Simulation
from islands.validation.simple_models import assess_linear_model

#: Samples are averaged if the error is at most this fraction of the error without averaging.
CLEAR_GAIN = 0.8

#: The same for a search that refines: at the rate of the record, it improves more on the trial models.
CLEAR_GAIN_REFINED = 0.5

#: Fewest means of the estimation data, and of the validation data when two rates are compared.
_LEAST_ESTIMATION, _LEAST_VALIDATION = 500, 100

#: Smallest share of the samples that must be in segments long enough for a prediction at the lower rate.
_LEAST_SHARE = 0.9

#: Terms of the trial models, at most.
_TERMS = 10


def select_rate(
    split: Split, average: int | str, library: TrialLibrary, least: int, steps: Steps | None = None
) -> tuple[Split, int]:
    """Average the data as the setting ``average`` says.

    ``auto`` compares small models of the same library at several rates. The measure is the error of their
    free run on the validation data, averaged over the same intervals of time for all rates. A record without
    noise, or without samples to spare, is not averaged.

    Parameters
    ----------
    split : Split
    average : int or str
        Samples of a mean, or ``auto``.
    library : TrialLibrary
    least : int
        Fewest samples of a segment after averaging that permit a prediction. ``auto`` keeps nine tenths of
        the samples in such segments.
    steps : Steps, optional
        Checked before the models of each rate.

    Returns
    -------
    tuple of Split and int
        The data, and the number of samples of a mean.

    Raises
    ------
    StoppedError
        A stop is requested.
    SettingsError
        ``average`` is neither ``auto`` nor a positive integer.
    RecordError
        A recording is too short for the given average, or an input is read one sample early.
    """
    check_average(average)
    count = _choose_count(split, library, least, steps or Steps()) if average == AUTO else int(average)
    return average_split(split, count), count


def _choose_count(split: Split, library: TrialLibrary, least: int, steps: Steps) -> int:
    # Statistics of very large numbers overflow: such a record is not averaged.
    with np.errstate(over="ignore", invalid="ignore"):
        counts = [count for count in COUNTS if _permits(split, count, least)]
        interval = _limit_interval(split.validation, counts)
        if len(counts) == 1 or not is_noisy(split.estimation):
            return 1
    errors_at = []
    for count in counts:
        steps.check("sampling rate")
        errors_at.append(
            compute_errors(average_split(split, count), library.at_rate(count), interval // count)
        )
    # Means reduce the noise that least squares takes for dynamics, which a linear model separates itself.
    linear = assess_linear_model(split, 1, constraints=library.constraints, steps=steps)
    if linear is not None and linear.validation_error < _root_mean_square(errors_at[0]):
        predicted = simulate_freely(linear.model, split.validation, linear.warm_up).y
        residual = replace(split.validation, y=split.validation.y - predicted)
        errors_at[0] = average_samples(residual, interval).y
    squares = np.array(errors_at) ** 2
    # Coarse rates have a longer warm-up: compare the intervals that all of them predict.
    compared = squares[:, ~np.isnan(squares).any(axis=0)]
    errors = np.sqrt(compared.mean(axis=1)) if compared.size else np.full(len(counts), inf)
    best = int(np.argmin(errors))
    gain = CLEAR_GAIN if library.shooting is None else CLEAR_GAIN_REFINED
    return counts[best] if errors[best] <= gain * errors[0] else 1


def _root_mean_square(errors: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.nanmean(errors**2)))


def _permits(split: Split, count: int, least: int) -> bool:
    """Return whether means of ``count`` samples keep the bandwidth and leave enough samples."""
    if count == 1:
        return True
    estimation, validation = split.estimation, split.validation
    if any(parse_channel_name(name).at_once for name in estimation.input_names):
        return False
    # Segments that are too short for a prediction at this rate are lost.
    for part, fewest in ((estimation, _LEAST_ESTIMATION), (validation, _LEAST_VALIDATION)):
        if _count_in_segments(part, least * count) < max(fewest * count, _LEAST_SHARE * part.samples):
            return False
    return keeps_bandwidth(estimation, count)


def _count_in_segments(record: Dataset, least: int) -> int:
    """Return the number of samples in segments of at least ``least`` samples."""
    return sum(length for length in record.segments if length >= least)


def _limit_interval(validation: Dataset, counts: list[int]) -> int:
    """Remove the largest counts until there are enough common intervals; return their length in samples."""
    while len(counts) > 1:
        interval = lcm(*counts)
        if _count_in_segments(validation, interval) >= _LEAST_VALIDATION * interval:
            return interval
        counts.pop()
    return 1


def compute_errors(split: Split, library: TrialLibrary, count: int) -> NDArray[np.float64]:
    """Return the errors of the best trial model on the validation data, in means over ``count`` samples.

    NaN in the warm-up; infinite if no model can be estimated and simulated.
    """
    offsets = find_offsets(split.estimation, library.constraints)
    estimation, validation = (
        subtract_offsets(part, offsets) for part in (split.estimation, split.validation)
    )
    pool = library.screen(estimation)
    structures = forward_selection(pool, estimation, library.constraints, _TERMS)
    warm_up = max(item.maximum_lag for item in pool)
    estimated = [
        estimate(structure, estimation, library.constraints, warm_up, standard_errors=False)
        for structure in (() if isinstance(structures, EvaluationOutcome) else structures)
    ]
    best = min(_simulate(estimated, validation, warm_up), key=_squared_error, default=None)
    if best is None:
        return np.full(sum(length // count for length in validation.segments), inf)
    if library.shooting is not None:
        refined = refine(
            *(best[0], estimation, library.shooting, library.constraints, warm_up), standard_errors=False
        )
        best = min((best, *_simulate([refined], validation, warm_up)), key=_squared_error)
    return average_samples(replace(validation, y=validation.y - best[1].y), count).y


def _simulate(
    estimated: Iterable[FittedStructure | RefinedModel[Model] | EvaluationOutcome],
    validation: Dataset,
    warm_up: int,
) -> Iterator[tuple[Model, Simulation]]:
    """Yield the estimated models and their free runs on the validation data, except for diverging ones."""
    for found in estimated:
        if not isinstance(found, EvaluationOutcome):
            run = simulate_freely(found.model, validation, warm_up)
            if isfinite(run.mean_squared_error):
                yield found.model, run


def _squared_error(simulated: tuple[Model, Simulation]) -> float:
    return simulated[1].mean_squared_error
