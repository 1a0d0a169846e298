"""Ensemble of the models that the data do not exclude: structures of a search, with bootstrap parameters.

A structure has a weight, and each of its members has parameters from a block bootstrap of the estimation
data. The weight of a structure with the information criterion ``L`` of its free run on all data (see
`islands.validation.evidence`) is proportional to ``exp(-L / 2)``. The penalty of the size is necessary for
inclusion probabilities. Without it the larger of two structures with equal errors has the same weight, and
terms that are not in the law of the system have probabilities of up to one half. The free run starts from the
initial outputs that are most likely for the structure, since the noise of the measured ones does not
distinguish structures.

Structures with equal free runs state one law (see `find_laws`). In inclusion probabilities, they count as one
of them: the shortest, and of equal sizes the recommended one.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from islands.estimation.block_bootstrap import draw_parameters
from islands.estimation.estimator_table import Criterion
from islands.models.coupled_narx import AnyModel, CoupledModel
from islands.models.narx import Model
from islands.records.coupled import AnyRecord, CoupledSplit
from islands.records.dataset import Dataset
from islands.records.split import Split
from islands.rounding import ROUNDING
from islands.simulation.initial_outputs import LEAST_SHARE, estimate_initial_outputs
from islands.simulation.predictors import free_run, free_runs
from islands.validation.all_data_fit import AllDataFit
from islands.validation.equal_laws import find_laws
from islands.validation.evidence import (
    ErrorNoise,
    count_terms,
    join_errors,
    mean_square,
    measure_errors,
    measure_lack,
    measure_size,
)

M = TypeVar("M", bound=AnyModel)

#: Members of an ensemble, up to rounding.
MEMBERS = 64

#: Structures with a smaller weight are left out.
_MIN_WEIGHT = 0.5 / MEMBERS

#: A member is left out if the squared error of its free run on a part of the data exceeds that of its
#: structure by this factor: a replicate is a linear step, which may leave the stable models.
_IMPLAUSIBLE = 4.0

#: Fraction of the weight within the spread of an ensemble.
_INSIDE = 0.9

#: Half-width of that central part of a normal distribution, in standard deviations.
_DEVIATIONS = 1.645


@dataclass(frozen=True, slots=True)
class ValidatedModel(Generic[M]):
    """A model with the error of its free run, which may become part of an ensemble.

    Attributes
    ----------
    model : DynamicModel or CoupledModel
    criterion : Criterion
        Error that its parameters minimise.
    error : float
        Mean squared error of the free run on all data (see `measure_square`); infinite if it diverges.
    all_data : AllDataFit or None
        Fit by which the model is weighed. None if its parameters are not estimated on all data yet.
    """

    model: M
    criterion: Criterion
    error: float
    all_data: AllDataFit | None = None

    @property
    def size(self) -> int:
        """Number of terms."""
        return self.model.size

    @property
    def order(self) -> tuple[float, tuple[str, ...], tuple[float, ...]]:
        """Sort key: the error; ties are broken by the text of the terms and by the parameters."""
        return self.error, self.model.parameter_names, self.model.parameters


@dataclass(frozen=True, slots=True, eq=False)
class EnsembleStructure:
    """A structure of an ensemble.

    Attributes
    ----------
    model : DynamicModel or CoupledModel
        Model with estimated parameters.
    weight : float
        Weight of the structure. Its members have equal weights.
    parameters : ndarray, shape (members, terms)
        Parameters of the members.
    law : int or None
        Position in the ensemble of another structure with the same free run, whose terms count in place of
        those of this one. None if there is none.
    """

    model: AnyModel
    weight: float
    parameters: NDArray[np.float64]
    law: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Ensemble:
    """Structures in the order of their weights, which sum to 1.

    The last one is the recommended structure if its weight is too small for the others.
    """

    structures: tuple[EnsembleStructure, ...]

    def inclusion(self, term: str) -> float:
        """Return the inclusion probability of a term: the weight of the structures whose law contains it.

        Parameters
        ----------
        term : str
            One of the ``parameter_names`` of a model.
        """
        laws = [each if each.law is None else self.structures[each.law] for each in self.structures]
        pairs = zip(self.structures, laws, strict=True)
        return min(1.0, sum(each.weight for each, law in pairs if term in law.model.parameter_names))

    @property
    def weights(self) -> NDArray[np.float64]:
        """Weight of every member, in the order of the structures; shape (members,)."""
        shares = [
            np.full(len(each.parameters), each.weight / len(each.parameters)) for each in self.structures
        ]
        return np.concatenate(shares)

    def simulate(self, record: AnyRecord, warm_up: int) -> NDArray[np.float64]:
        """Return the free runs of all members.

        Parameters
        ----------
        record : Dataset or CoupledRecord
        warm_up : int
            Number of samples before the first prediction. Members with larger lags start later.

        Returns
        -------
        ndarray, shape (members, samples) or (members, samples, outputs)
            The measured output before the first prediction, and NaN after a divergence.
        """
        runs = []
        for each in self.structures:
            first = max(warm_up, each.model.maximum_lag)
            # The members of a structure start from the same outputs, those of its first member.
            member = each.model.with_parameters(each.parameters[0].tolist())
            given = estimate_initial_outputs(member, record, first)
            found = free_runs(each.model, each.parameters, given, first)
            for begin, end in record.bounds:
                started = slice(begin, min(begin + first, end))
                found[:, started] = record.y[started]
            runs.append(found)
        return np.concatenate(runs)

    def spread(self, runs: NDArray[np.float64], centre: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the spread of free runs about a simulation, in the scale of a standard deviation.

        Parameters
        ----------
        runs : ndarray, shape (members, samples)
            Result of `simulate` for one output, or some of its columns.
        centre : ndarray, shape (samples,)
            Simulated output.

        Returns
        -------
        ndarray, shape (samples,)
            Half-width about the centre that contains nine tenths of the weight, divided by 1.645. Infinite
            where more than a tenth of the weight has diverged. NaN where the centre is NaN.
        """
        distances = np.ascontiguousarray(np.abs(runs - centre).T)
        distances[np.isnan(distances)] = np.inf
        order = np.argsort(distances, axis=1, kind="stable")
        reached = np.cumsum(self.weights[order], axis=1) >= _INSIDE
        found = np.take_along_axis(distances, order, axis=1)[np.arange(len(centre)), reached.argmax(axis=1)]
        return np.where(np.isnan(centre), np.nan, found / _DEVIATIONS)


def make_ensemble(
    candidates: Sequence[ValidatedModel[M]],
    split: Split | CoupledSplit,
    constraints: str,
    warm_up: int,
    seed: int,
    skip: Callable[[], bool] = lambda: False,
    recommended: AnyModel | None = None,
) -> Ensemble | None:
    """Make the ensemble of the candidates.

    Parameters
    ----------
    candidates : sequence of ValidatedModel
        Models with parameters. Of several candidates with one structure, the one with the least error
        counts. Their order has no effect.
    split : Split or CoupledSplit
        Estimation data, from which the members draw their parameters, and validation data; both give the
        weights.
    constraints : str
        Statements of ``constraint``, met by the candidates and then by every member.
    warm_up : int
        Number of samples before the first prediction of every free run.
    seed : int
        Seed of the random generator.
    skip : callable
        Called before each structure. Once it returns true, there is no ensemble.
    recommended : DynamicModel or CoupledModel, optional
        One of the candidates, whose structure is part of the ensemble however small its weight is.

    Returns
    -------
    Ensemble or None
        None if the free run of every candidate diverges, or if ``skip`` returned true.
    """
    structures = []
    kept = _weigh(_best_of_each_structure(candidates), split, constraints, warm_up, recommended)
    laws = find_laws([candidate.model for candidate, _ in kept], split.validation, warm_up, recommended)
    for position, ((candidate, weight), law) in enumerate(zip(kept, laws, strict=True)):
        if skip():
            return None
        model, count = candidate.model, max(1, round(MEMBERS * weight))
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(position,)))
        drawn = draw_parameters(
            model, split.estimation, candidate.criterion.interval, constraints, warm_up, count, rng
        )
        members = _take_plausible(model, drawn, split, warm_up)
        structure = model
        if isinstance(model, Model):
            structure = replace(model, theta=None, standard_errors=None)
        structures.append(EnsembleStructure(structure, weight, members, law))
    return Ensemble(tuple(structures)) if structures else None


def _take_plausible(
    model: AnyModel, drawn: Iterable[NDArray[np.float64]], split: Split | CoupledSplit, warm_up: int
) -> NDArray[np.float64]:
    """Return the plausible ones of the first draws at least half of which are plausible.

    A draw is plausible if its error on both parts of the data is not far above that of the model. Without
    such draws, the parameters of the model are the only member.
    """
    parts = [_find_limit(model, record, warm_up) for record in (split.validation, split.estimation)]
    for parameters in drawn:
        plausible = np.ones(len(parameters), bool)
        for record, predicted, largest in parts:
            # The divergence of a draw gives NaN, which is not plausible either.
            runs = free_runs(model, parameters[plausible], record, warm_up)
            plausible[plausible] = mean_squares(record, runs, predicted) <= largest
            if 2 * np.count_nonzero(plausible) < len(plausible):
                break
        else:
            return parameters[plausible]
    return np.array([model.parameters])


def _find_limit(
    model: AnyModel, record: AnyRecord, warm_up: int
) -> tuple[AnyRecord, NDArray[np.bool_], float]:
    """Return the record from which free runs start, the samples that count, and the largest mean square."""
    started = estimate_initial_outputs(model, record, warm_up)
    run = free_run(model, started, warm_up).y
    predicted = find_predicted(run)
    square = float(mean_squares(record, run[None], predicted)[0])
    return started, predicted, _IMPLAUSIBLE * square + _error_floor(record)


def mean_squares(
    record: AnyRecord, runs: NDArray[np.float64], predicted: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return the mean squared error of simulations.

    Parameters
    ----------
    record : Dataset or CoupledRecord
    runs : ndarray, shape (runs, samples) or (runs, samples, outputs)
    predicted : ndarray of bool, shape (samples,)
        Samples that count.

    Returns
    -------
    ndarray, shape (runs,)
        In the squared unit of the output. With several outputs, the geometric mean of the errors relative to
        the squared ranges: the likelihood of independent normal errors with unknown variances depends on it.
    """
    squares: NDArray[np.float64] = np.mean((record.y - runs)[:, predicted] ** 2, axis=1)
    if isinstance(record, Dataset):
        return squares
    ranges = np.array([each.output_range or 1.0 for each in record.records])
    # Errors by rounding are equal.
    relative: NDArray[np.float64] = np.exp(np.log(squares / ranges / ranges + ROUNDING**2).mean(axis=1))
    return relative


def find_predicted(y: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which samples of a simulation of one or several outputs have a value, shape (samples,)."""
    found: NDArray[np.bool_] = ~np.isnan(y.reshape(len(y), -1)[:, 0])
    return found


def _error_floor(record: AnyRecord) -> float:
    scale = record.output_range if isinstance(record, Dataset) else 1.0
    return (ROUNDING * scale) ** 2


def _best_of_each_structure(candidates: Sequence[ValidatedModel[M]]) -> list[ValidatedModel[M]]:
    """Return the candidate with the least error of each structure, in the order of their errors."""
    found: dict[tuple[str, ...], ValidatedModel[M]] = {}
    for candidate in sorted(candidates, key=lambda each: each.order):
        if np.isfinite(candidate.error):
            found.setdefault(candidate.model.parameter_names, candidate)
    return list(found.values())


def _weigh(
    candidates: list[ValidatedModel[M]],
    split: Split | CoupledSplit,
    constraints: str,
    warm_up: int,
    recommended: AnyModel | None,
) -> list[tuple[ValidatedModel[M], float]]:
    """Return the candidates of relevant weight with their weights, largest weight first.

    The recommended one is the last if its weight is smaller.
    """
    if not candidates:
        return []
    models = [_fit_all_data(candidate, split, constraints, warm_up) for candidate in candidates]
    errors = [_measure_errors(model, split, warm_up) for model in models]
    noise = ErrorNoise.fit_closest(errors, split.segments)
    squares = [noise.measure(each) for each in errors]
    sizes, terms = [measure_size(model) for model in models], count_terms(models)
    lack = measure_lack(models, sizes, squares, noise.samples, terms)
    # An estimate of initial outputs that the error lacks changes it by less than this part.
    reach = -noise.samples * np.log1p(-LEAST_SHARE) - 2.0 * np.log(_MIN_WEIGHT)
    for at in np.flatnonzero(lack <= lack.min() + reach):
        squares[at] = noise.measure(_measure_errors(models[at], split, warm_up, least_share=0.0))
    lack = measure_lack(models, sizes, squares, noise.samples, terms)
    weights = np.exp(0.5 * (lack.min() - lack))
    weights /= weights.sum()
    order = [int(index) for index in np.argsort(-weights, kind="stable") if weights[index] >= _MIN_WEIGHT]
    if recommended is not None:
        names = recommended.parameter_names
        order += [at for at, each in enumerate(models) if each.parameter_names == names and at not in order]
        weights = np.maximum(weights, np.finfo(float).tiny)
    kept = weights[order] / weights[order].sum()
    return [(candidates[index], float(weight)) for index, weight in zip(order, kept, strict=True)]


def _fit_all_data(
    candidate: ValidatedModel[M], split: Split | CoupledSplit, constraints: str, warm_up: int
) -> AnyModel:
    """Return a candidate with the parameters of all data; one of several outputs keeps its own."""
    if isinstance(split, CoupledSplit) or isinstance(candidate.model, CoupledModel):
        return candidate.model
    fit = candidate.all_data
    if fit is None:
        errors = measure_errors(candidate.model, split, warm_up)
        fit = AllDataFit(candidate.model, candidate.criterion, split, constraints, warm_up, errors)
    return fit.model


def measure_square(model: AnyModel, split: Split | CoupledSplit, warm_up: int) -> float:
    """Return the mean squared error of the free run on all data, relative to the squared output range.

    With several outputs, it is the geometric mean of their errors. Infinite after a divergence.
    """
    return mean_square(_measure_errors(model, split, warm_up))


def _measure_errors(
    model: AnyModel, split: Split | CoupledSplit, warm_up: int, least_share: float = LEAST_SHARE
) -> NDArray[np.float64]:
    """Return the errors of the free runs on all data; see `join_errors`.

    With ``least_share=0``, the initial outputs are parameters of the model, and the errors in the warm-up are
    those of the measured ones: their noise decays more slowly in a model with fewer past outputs.
    """
    parts = []
    for record in (split.estimation, split.validation):
        started = estimate_initial_outputs(model, record, warm_up, least_share)
        run = free_run(model, started, warm_up)
        if least_share == 0.0 and started is not record and isinstance(record, Dataset):
            y = np.where(np.isnan(run.y), started.y, run.y)
            run = replace(run, y=y)
        parts.append((record, run))
    return join_errors(*parts)


def effective_samples(residual: NDArray[np.float64]) -> float:
    """Return the number of independent samples whose mean has the variance of the mean of a residual.

    The sum of the autocorrelations ends before the first pair of lags with a negative sum (Geyer, Statist.
    Sci. 7 (1992) 473-483).

    Parameters
    ----------
    residual : ndarray, shape (samples,)

    Returns
    -------
    float
        Between 2 and the number of samples; the number of samples if the residual is constant.
    """
    samples = len(residual)
    centred = residual - residual.mean()
    # A power of two: the transform of a length with a large prime factor is slow.
    spectrum = np.fft.rfft(centred, 1 << (2 * samples - 1).bit_length())
    correlation = np.fft.irfft(spectrum * spectrum.conj())[:samples]
    if samples < 4 or not correlation[0] > 0.0:
        return float(max(2, samples))
    correlation = correlation[: samples // 2 * 2] / correlation[0]
    pairs = correlation[::2] + correlation[1::2]
    negative = np.flatnonzero(pairs <= 0.0)
    kept = pairs[: negative[0]] if negative.size else pairs
    return float(np.clip(samples / max(1.0, 2.0 * kept.sum() - 1.0), 2.0, samples))
