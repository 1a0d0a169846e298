"""Prediction bands of a free run for the measured output.

A band of level ``p`` contains a new measured sample with probability ``p``. Its half-width at sample ``k`` is
``q sqrt(noise^2 + spread(k)^2)``. The spread of the ensemble varies with time: it is the uncertainty of the
parameters and of the structure. The noise is the part of the residual that the spread does not explain:
measurement noise, equation noise and the common error of all members. Outside of the range of the data, the
error of the structure grows (see `DataRange`).

The factor ``q`` is the quantile ``p`` of the normalised residuals of the free run on the estimation and the
validation data, a conformal prediction with a normalised score (Lei et al., J. Am. Statist. Assoc. 113 (2018)
1094-1111). No distribution is assumed. Correlated residuals are not exchangeable, so ``p`` is increased for
the effective number of samples. The coverage holds for records of the same kind: inputs, noise and sampling
time like those of the data. It is an average over samples; in one record, adjacent samples are inside or
outside together.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from islands.errors import SettingsError, check_numbers
from islands.models.coupled_narx import AnyModel, CoupledModel
from islands.models.protocol import DynamicModel
from islands.records.compatibility import match_record
from islands.records.coupled import AnyRecord, CoupledRecord, CoupledSplit, match_coupled
from islands.records.dataset import Dataset
from islands.records.signal_map import match_rate
from islands.records.split import Split
from islands.simulation.initial_outputs import simulate_freely
from islands.simulation.predictors import free_run
from islands.validation.data_range import DataRange, measure_range
from islands.validation.ensemble import Ensemble, effective_samples
from islands.validation.predictable_residual import predictable_share

#: Levels whose factors are stored; others are interpolated.
LEVELS = (0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 0.98, 0.99)

#: Largest number of samples of a part that calibrate the bands; free runs are smooth.
_SAMPLES = 5000

#: Level of a band unless another is given.
LEVEL = 0.9


@dataclass(frozen=True, slots=True, eq=False)
class PredictionBand:
    """Free run of a model with a band that contains a measured sample with a given probability.

    Attributes
    ----------
    level : float
        Probability, between 0.5 and 0.99.
    y, lower, upper : ndarray, shape (samples,) or (samples, outputs)
        Free run and limits of the band, in the unit of the output. NaN during the warm-up and after a
        divergence. The limits are infinite where more than a tenth of the ensemble has diverged.
    """

    level: float
    y: NDArray[np.float64]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]

    @property
    def outputs(self) -> tuple["PredictionBand", ...]:
        """The band of every output."""
        if self.y.ndim == 1:
            return (self,)
        columns = zip(self.y.T, self.lower.T, self.upper.T, strict=True)
        return tuple(PredictionBand(self.level, *each) for each in columns)


@dataclass(frozen=True, slots=True, eq=False)
class PredictionBands:
    """Prediction bands of a model, of every level.

    Attributes
    ----------
    ensemble : Ensemble
        Models that the data do not exclude.
    noise : float
        Root mean square of the residual of the free run that the spread of the ensemble does not explain, in
        the unit of the output.
    width : float
        Median of ``sqrt(noise^2 + spread^2)`` over the data, in the unit of the output.
    factors : mapping
        Half-width of a band in units of ``sqrt(noise^2 + spread^2)``, by level.
    coverage : float or None
        Fraction of the validation samples within the band of the default level. None for results of earlier
        versions.
    data_range : DataRange or None
        Range of the data, outside of which the bands widen. None for results of earlier versions.
    independent_samples : float or None
        Number of independent samples that the correlated residuals of the validation data are worth. None for
        results of earlier versions.
    """

    ensemble: Ensemble
    noise: float
    width: float
    factors: Mapping[float, float]
    coverage: float | None = None
    data_range: DataRange | None = None
    independent_samples: float | None = None

    def predict(
        self, model: AnyModel, record: AnyRecord, level: float = LEVEL, warm_up: int | None = None
    ) -> PredictionBand:
        """Simulate a record with a band.

        Parameters
        ----------
        model : DynamicModel
            Model for which the bands were calibrated.
        record : Dataset
            Inputs, and the output of the warm-up.
        level : float
            Probability with which the band contains a measured sample, between 0.5 and 0.99.
        warm_up : int or None
            Number of samples before the first prediction. None is the model's largest lag.

        Raises
        ------
        SettingsError
            The level is out of range.
        RecordError
            The record does not match the model, or is too short for it or for a member of the ensemble.
        """
        first = model.maximum_lag if warm_up is None else warm_up
        run = simulate_freely(model, record, first).y
        runs = self.ensemble.simulate(record, first)
        assert isinstance(model, DynamicModel), "several outputs have `OutputBands`"
        (single,) = record.records
        return self.band(match_record(model, match_rate(model, single)), run, runs, level)

    @property
    def outputs(self) -> tuple["PredictionBands"]:
        """The bands of every output, as of several."""
        return (self,)

    def band(
        self,
        record: Dataset,
        run: NDArray[np.float64],
        runs: NDArray[np.float64],
        level: float = LEVEL,
    ) -> PredictionBand:
        """Return the band about a free run.

        Parameters
        ----------
        record : Dataset
            Record of the free run, with its inputs in the order of the model.
        run : ndarray, shape (samples,)
            Free run of the model.
        runs : ndarray, shape (members, samples)
            Free runs of the ensemble.
        level : float
            As for `predict`.
        """
        factor = self._factor(level)
        squares = self.noise**2 + self.ensemble.spread(runs, run) ** 2
        if self.data_range is not None:
            squares = squares + self.width**2 * self.data_range.increase(record, run)
        half = factor * np.sqrt(squares)
        return PredictionBand(level, run, run - half, run + half)

    def typical_half_width(self, level: float = LEVEL) -> float:
        """Return the median half-width of a band on the data, in the unit of the output."""
        return self._factor(level) * self.width

    @property
    def typical_factor(self) -> float:
        """Half-width of the band of the default level in units of ``sqrt(noise^2 + spread^2)``."""
        return self._factor(LEVEL)

    def _factor(self, level: float) -> float:
        check_numbers(level=level)
        if not LEVELS[0] <= level <= LEVELS[-1]:
            raise SettingsError(f"the level of a band lies between {LEVELS[0]} and {LEVELS[-1]}, got {level}")
        levels = sorted(self.factors)
        return float(np.interp(level, levels, [self.factors[each] for each in levels]))


@dataclass(frozen=True, slots=True, eq=False)
class OutputBands:
    """Prediction bands of a model of several outputs, of every level.

    Attributes
    ----------
    outputs : tuple of PredictionBands
        Bands of each output.
    """

    outputs: tuple[PredictionBands, ...]

    @property
    def ensemble(self) -> Ensemble | None:
        """The ensemble of all outputs; None if every output has its own."""
        first = self.outputs[0].ensemble
        return first if all(each.ensemble is first for each in self.outputs) else None

    def predict(
        self, model: AnyModel, record: AnyRecord, level: float = LEVEL, warm_up: int | None = None
    ) -> PredictionBand:
        """Simulate a record with a band for every output; see `PredictionBands.predict`."""
        assert isinstance(model, CoupledModel), "one output has `PredictionBands`"
        assert isinstance(record, CoupledRecord), "the record matches the model"
        first = model.maximum_lag if warm_up is None else warm_up
        data = match_coupled(model, record.map(partial(match_rate, model)))
        run = free_run(model, data, first).y
        bands = [
            each.band(one, y, runs, level)
            for each, one, y, runs in zip(
                self.outputs, data.records, run.T, self._simulate(model, data, first), strict=True
            )
        ]
        lower, upper = ([getattr(band, limit) for band in bands] for limit in ("lower", "upper"))
        return PredictionBand(level, run, np.column_stack(lower), np.column_stack(upper))

    def _simulate(self, model: CoupledModel, data: CoupledRecord, warm_up: int) -> list[NDArray[np.float64]]:
        """Return the free runs of the ensemble of every output, each of shape (members, samples)."""
        if self.ensemble is not None:
            return list(np.moveaxis(self.ensemble.simulate(data, warm_up), 2, 0))
        return [
            each.ensemble.simulate(model.separate(data, place), warm_up)
            for place, each in enumerate(self.outputs)
        ]


#: Prediction bands of a model of one or several outputs.
AnyBands: TypeAlias = PredictionBands | OutputBands


def calibrate_bands(
    models: Sequence[DynamicModel], ensemble: Ensemble, split: Split, warm_up: int
) -> tuple[PredictionBands | None, ...]:
    """Calibrate the bands of models.

    Parameters
    ----------
    models : sequence of DynamicModel
        Models whose free runs are the centres of the bands.
    ensemble : Ensemble
    split : Split
        Estimation and validation data.
    warm_up : int
        Number of samples before the first prediction.

    Returns
    -------
    tuple of PredictionBands or None
        None for a model that diverges on the estimation or the validation data.
    """
    parts = [
        (record, _simulate_samples(ensemble, record, warm_up))
        for record in (split.estimation, split.validation)
    ]

    def calibrate(model: DynamicModel) -> PredictionBands | None:
        simulated = [simulate_freely(model, record, warm_up) for record, _ in parts]
        if not all(run.outcome for run in simulated):
            return None
        outputs = [
            _Output(match_record(model, record), run.y, runs)
            for (record, runs), run in zip(parts, simulated, strict=True)
        ]
        return _calibrate(ensemble, outputs)

    return tuple(map(calibrate, models))


def calibrate_output_bands(
    model: CoupledModel, ensemble: Ensemble, split: CoupledSplit, warm_up: int
) -> OutputBands | None:
    """Calibrate the bands of every output of a model; None if it diverges on a part of the data.

    Parameters
    ----------
    model : CoupledModel
    ensemble : Ensemble
    split : CoupledSplit
    warm_up : int
        Number of samples before the first prediction.
    """
    found = []
    parts = [
        (record, free_run(model, record, warm_up), _simulate_samples(ensemble, record, warm_up))
        for record in (split.estimation, split.validation)
    ]
    if not all(run.outcome for _, run, _ in parts):
        return None
    for place in range(len(model.models)):
        outputs = [
            _Output(record.records[place], run.y[:, place], runs[..., place]) for record, run, runs in parts
        ]
        if (calibrated := _calibrate(ensemble, outputs)) is None:
            return None
        found.append(calibrated)
    return OutputBands(tuple(found))


def _list_samples(samples: int) -> NDArray[np.int64]:
    """Return the samples of a part of the data that calibrate the bands, at equal distances."""
    return np.arange(0, samples, -(-samples // _SAMPLES))


def _simulate_samples(ensemble: Ensemble, record: AnyRecord, warm_up: int) -> NDArray[np.float64]:
    """Return the free runs of the ensemble at these samples."""
    return ensemble.simulate(record, warm_up)[:, _list_samples(record.samples)]


@dataclass(frozen=True, slots=True, eq=False)
class _Output:
    """A part of the data, the free run on it, and runs of the ensemble at some samples."""

    record: Dataset
    run: NDArray[np.float64]
    runs: NDArray[np.float64]


def _calibrate(ensemble: Ensemble, parts: Sequence[_Output]) -> PredictionBands | None:
    residuals, spreads, counts = [], [], []
    for part in parts:
        residual = part.record.y - part.run
        counts.append(effective_samples(residual[~np.isnan(residual)]))
        samples = _list_samples(len(residual))
        spread = ensemble.spread(part.runs, part.run[samples])
        known = ~np.isnan(residual[samples]) & np.isfinite(spread)
        residuals.append(np.abs(residual[samples][known]))
        spreads.append(spread[known])
    residual, spread = np.concatenate(residuals), np.concatenate(spreads)
    if not residual.size:
        return None
    unexplained = np.add.reduce(residual**2) - np.add.reduce(spread**2)
    noise = float(np.sqrt(max(0.0, unexplained) / len(residual)))
    width = np.sqrt(noise**2 + spread**2)
    scores = np.sort(residual / np.where(width > 0.0, width, 1.0))
    # The correction of a conformal prediction for a finite number of residuals.
    ranks = [int(len(scores) * level * (1.0 + 1.0 / sum(counts))) for level in LEVELS]
    factors = [float(scores[min(len(scores) - 1, rank)]) for rank in ranks]
    bands = PredictionBands(
        ensemble,
        noise,
        float(np.median(width)),
        dict(zip(LEVELS, factors, strict=True)),
        data_range=_measure_range(parts),
    )
    validated = len(residuals[-1])
    if not validated:
        return bands
    inside = residual[-validated:] <= bands.typical_factor * width[-validated:]
    return replace(bands, coverage=float(inside.mean()), independent_samples=counts[-1])


def _measure_range(parts: Sequence[_Output]) -> DataRange:
    """Return the range of the data, with the properties of the residual on the estimation data."""
    part = parts[0]
    begin, end = max(part.record.bounds, key=lambda bounds: bounds[1] - bounds[0])
    residual = part.record.y[begin:end] - part.run[begin:end]
    rows = np.flatnonzero(~np.isnan(residual))[:_SAMPLES]
    residual, y, u = residual[rows], part.record.y[begin:end][rows], part.record.u[begin:end][rows]
    return measure_range(
        [each.record for each in parts],
        [each.run for each in parts],
        predictable_share(residual, u, y) if rows.size else 0.0,
        rows.size / effective_samples(residual) if rows.size else 1.0,
    )
