"""Linear models of the free run: output-error models, and Box-Jenkins models under coloured noise.

The noise is that of the measurement, so that least squares on the one-step-ahead error is biased. If the
sampling time is short compared with the slow modes, the bias is large: of an integrator and a pole of 0.967
it finds neither. The error of the free run of `LinearProblem` is minimised instead.

Under coloured noise, that estimate is consistent but has a larger variance than necessary. If the residual
is coloured, a further estimate minimises the residual that an autoregressive model of the noise whitens: a
Box-Jenkins model with C = 1 (Ljung 1999, sections 4.2 and 7.5). Filtered input and output fulfil the same
difference equation, with other initial states.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import inf

import numpy as np
import scipy

from islands.estimation.covariance import sandwich_of_jacobian
from islands.estimation.estimate import FittedStructure
from islands.estimation.estimator_table import BOX_JENKINS, OUTPUT_ERROR, Criterion
from islands.estimation.linear_simulation import (
    LinearProblem,
    LinearSimulation,
    differentiate,
    factor,
    find_start,
    measure_criterion,
    minimise,
    solve,
)
from islands.estimation.structure_selection.deviations import LARGE_OFFSET, find_offsets
from islands.expressions.tree import Expression, Lagged
from islands.kernels.linear_filter import divide_rows
from islands.models.narx import Model, make_model
from islands.records.channel_names import parse_channel_name
from islands.records.dataset import Dataset
from islands.records.noise_model import fit_whitening, is_rounding_error

#: Largest order of a model. An order is tried only if one of the two before it reduced the criterion.
_LARGEST_ORDER, _PATIENCE = 4, 2

#: The steps end when one reduces the squared error by a smaller relative amount.
_MIN_GAIN = 1e-7

#: Of a problem with more rows, a part is minimised first, and the steps on all rows start there. These end at
#: a larger gain: 1e-6 of 50 000 rows moves a parameter by a fifth of its standard error.
_MANY_ROWS, _PART, _MIN_FINAL_GAIN = 10_000, 4_000, 1e-6

#: Largest error relative to the least: a model with a larger one is not recommended.
_LARGEST_RATIO = 1.5

#: Samples and segments that are used, at most: the first samples, and of these the longest segments.
_LARGEST_SAMPLES, _LARGEST_SEGMENTS = 50_000, 16


def fit_output_error(
    record: Dataset, delays: Sequence[int] = (), lags: int = 4, max_terms: int = 10
) -> list[FittedStructure]:
    """Fit linear models of increasing order to the free run, and under coloured noise to its whitened error.

    Parameters
    ----------
    record : Dataset
        Record without missing values. The first 50 000 samples are used, and of these the 16 longest
        segments, because each has an initial state.
    delays : sequence of int
        Dead time of each input in samples; none if empty.
    lags : int
        Largest lag, without dead times. A model of order n reads n samples of an input, of an input that is
        read one sample early n + 1, but not more than this number. The largest order is 4.
    max_terms : int
        Terms of the largest model.

    Returns
    -------
    list of FittedStructure
        Difference equations of x, one for each order at most, with a constant if the signals are far from
        zero or if it reduces the information criterion of Schwarz. Orders after two that do not reduce the
        criterion are left out, also those whose error is much larger than the least. After them, of the
        models that minimise a whitened residual the one with the least criterion, if the residual is
        coloured; its residual variance is that of the whitened one.
    """
    record = record[:_LARGEST_SAMPLES]
    late = tuple(delays) or (0,) * record.inputs
    # The constant that an offset requires belongs to the unit, not to the law.
    is_far = any(find_offsets(record, least=LARGE_OFFSET))
    found: list[LinearSimulation] = []
    least, failed = inf, 0
    for order in range(1, min(_LARGEST_ORDER, lags) + 1):
        problem = make_problem(record, order, late, lags)
        if problem and is_far:
            problem = problem.with_constant()
        best = _fit_order(problem, max_terms + is_far) if problem else None
        failed = 0 if best and best.criterion < least else failed + 1
        if best:
            found.append(best)
            least = min(least, best.criterion)
        if failed == _PATIENCE:
            break
    smallest = min((each.mean_square for each in found), default=inf)
    kept = [each for each in found if each.mean_square <= _LARGEST_RATIO**2 * smallest]
    # Whitening takes different numbers of rows.
    coloured = [each for each in map(_fit_coloured, found) if each and each.mean_square < smallest]
    whitened = sorted(coloured, key=lambda each: each.criterion / each.residual.size)[:1]
    return [
        *(_make_structure(each, record, OUTPUT_ERROR) for each in kept),
        *(_make_structure(each, record, BOX_JENKINS) for each in whitened),
    ]


def make_problem(record: Dataset, order: int, delays: Sequence[int], lags: int) -> LinearProblem | None:
    """Return the rows of a model without a constant; None if no segment is long enough."""
    early = [parse_channel_name(name).at_once for name in record.input_names]
    read = [
        (place, delay + lag)
        for place, delay in enumerate(delays)
        for lag in range(1, min(order + early[place], lags) + 1)
    ]
    return _make_rows(record, order, read)


def refit_output_error(model: Model, record: Dataset, criterion: Criterion) -> FittedStructure | None:
    """Estimate the parameters of a model of `fit_output_error` again, on another record.

    Parameters
    ----------
    model : Model
        Its parameters are the start, and its terms stay.
    record : Dataset
        Record without missing values. All samples of its 16 longest segments are used.
    criterion : Criterion
        ``OUTPUT_ERROR`` or ``BOX_JENKINS``. The noise model of the latter is estimated again, too.

    Returns
    -------
    FittedStructure or None
        None if the estimate fails.
    """
    values = {item.expression: value for item, value in zip(model.regressors, model.parameters, strict=True)}
    lagged = [term for term in values if isinstance(term, Lagged)]
    read = sorted((term.channel - 1, term.lag) for term in lagged if term.channel)
    problem = _make_rows(record, model.output_lag, read)
    if problem is not None and len(lagged) < len(values):
        problem = problem.with_constant()
    if problem is None or not problem.is_determined:
        return None
    denominator = [-values[Lagged(0, lag)] for lag in range(1, model.output_lag + 1)]
    start = solve(problem, np.array(denominator))
    if start is None:
        return None
    found = minimise(start, _MIN_GAIN)
    if criterion == BOX_JENKINS:
        found = _fit_coloured(found) or found  # of a white residual, both are equal
    return _make_structure(found, record, criterion)


def _make_rows(record: Dataset, order: int, read: Sequence[tuple[int, int]]) -> LinearProblem | None:
    """Return the rows of a model that reads inputs, each given by its place and its lag."""
    first = max([order, *(lag for _, lag in read)])
    longest = sorted(record.bounds, key=lambda bounds: bounds[0] - bounds[1])[:_LARGEST_SEGMENTS]
    kept = sorted((begin, end) for begin, end in longest if end - begin > first + order)
    if not kept:
        return None
    ends = np.cumsum([end - begin - first for begin, end in kept], dtype=np.int64)
    terms: list[Expression] = [Lagged(0, lag) for lag in range(1, order + 1)]
    terms += [Lagged(1 + place, lag) for place, lag in read]
    columns = [
        np.concatenate([record.u[begin + first - lag : end - lag, place] for begin, end in kept])
        for place, lag in read
    ]
    y = np.concatenate([record.y[begin + first : end] for begin, end in kept])
    return LinearProblem(order, tuple(terms), np.array(columns), y, ends)


def _fit_order(problem: LinearProblem, max_terms: int) -> LinearSimulation | None:
    """Return the model with the least criterion of those without and with a constant; None without any."""
    found = _fit_many_rows(problem, max_terms) if problem.y.size > _MANY_ROWS else None
    if found is not None:
        return found
    fits = []
    for each in dict.fromkeys((problem, problem.with_constant())):
        start = find_start(each) if each.is_determined and len(each.terms) <= max_terms else None
        if start is not None:
            fits.append(minimise(start, _MIN_GAIN))
    return min(fits, key=lambda each: each.criterion, default=None)


def _fit_many_rows(problem: LinearProblem, max_terms: int) -> LinearSimulation | None:
    """Return the model that the steps on all rows find from the one of a part of them; None without that."""
    first = _fit_order(problem.take_part(_PART), max_terms)
    if first is None:
        return None
    start = solve(problem.with_constant() if first.problem.has_constant else problem, first.denominator)
    if start is None:
        return None
    found = minimise(start, _MIN_FINAL_GAIN)
    # A constant that a part of the rows does not show is small.
    if len(found.problem.terms) < max_terms and not found.problem.has_constant and _lacks_constant(found):
        start = solve(problem.with_constant(), found.denominator)
        found = minimise(start, _MIN_FINAL_GAIN) if start else found
    return found


def _lacks_constant(found: LinearSimulation) -> bool:
    """Return whether a constant reduces the criterion of a model without one, to the first order."""
    rows = found.residual.size
    constant = divide_rows(found.denominator, np.ones((1, rows)), found.problem.ends)
    factored = factor(np.vstack([found.basis, differentiate(found), constant]), found.residual)
    if factored is None:
        return False
    reduced = found.squares - float(factored.projection[-1]) ** 2
    return measure_criterion(reduced, rows, 1) < measure_criterion(found.squares, rows, 0)


def _fit_coloured(found: LinearSimulation) -> LinearSimulation | None:
    """Return the model that minimises the whitened residual; None if the residual is white."""
    problem = found.problem
    if is_rounding_error(found.residual, problem.y):
        return None
    noise = fit_whitening(found.residual, problem.lengths)
    weighted = problem.whiten(noise)
    start = solve(weighted, found.denominator) if noise.order and weighted.is_determined else None
    return minimise(start, _MIN_FINAL_GAIN if problem.y.size > _MANY_ROWS else _MIN_GAIN) if start else None


def _make_structure(found: LinearSimulation, record: Dataset, criterion: Criterion) -> FittedStructure:
    """Return the difference equation with its parameters and their standard errors."""
    problem, states = found.problem, found.problem.states
    values = [*(-found.denominator).tolist(), *found.coefficients[states:].tolist()]
    # The rank of the columns is that of the simulation: its basis, not the columns, is the Jacobian.
    columns = len(found.basis)
    covariance = sandwich_of_jacobian(np.vstack([found.basis, -differentiate(found)]), found.residual)
    half = scipy.linalg.solve_triangular(found.triangle, covariance[:columns, :columns])
    of_columns = scipy.linalg.solve_triangular(found.triangle, half.T)
    variances = np.append(np.diag(covariance)[columns:], np.diag(of_columns)[states:])
    errors = np.sqrt(np.maximum(variances, 0.0)).tolist()
    terms = list(zip(problem.terms, values, strict=True))
    model = make_model(terms, record.input_names, record.output_name, record.dt)
    # The same order of the terms as that of the model, without the factors of the expressions, which are 1.
    ordered = make_model(list(zip(problem.terms, errors, strict=True)), record.input_names)
    assert ordered.regressors == model.regressors
    model = replace(model, standard_errors=ordered.theta, preprocessing=record.preprocessing)
    variance = found.squares / max(1, problem.y.size - columns - problem.order)
    return FittedStructure(model, variance, criterion=criterion)
