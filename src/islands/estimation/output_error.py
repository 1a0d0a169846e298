"""Linear output-error models: the error of the free run is minimised, and the initial state is estimated.

The noise is that of the measurement, so that least squares on the one-step-ahead error is biased. If the
sampling time is short compared with the slow modes, the bias is large: of an integrator and a pole of 0.967
it finds neither. The simulated output is

    A(q) x(k) = B_1(q) u_1(k) + ... + constant + initial state,    y(k) = x(k) + e(k)

It is linear in everything except A, so that the other coefficients are eliminated (variable projection: Golub
and Pereyra 1973, with the Jacobian of Kaufman 1975). The iteration of Steiglitz and McBride (1965), which is
consistent under white measurement noise, gives the initial A; Gauss-Newton steps follow (Ljung 1999, sections
7.5 and 10.2).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, log
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.data.channel_names import parse_channel_name
from islands.data.dataset import Dataset
from islands.estimation.covariance import sandwich_of_jacobian
from islands.estimation.estimate import FittedStructure
from islands.estimation.extended_least_squares import is_stable
from islands.expressions.tree import Constant, Expression, Lagged
from islands.kernels.linear_filter import divide_rows
from islands.kernels.qr import orthogonalise
from islands.kernels.summation import dot
from islands.models.narx import make_model

#: Largest order of a model. An order is tried only if one of the two before it reduced the criterion.
_LARGEST_ORDER, _PATIENCE = 4, 2

#: Iterations of Steiglitz and McBride, Gauss-Newton steps, and halvings of a step.
_INITIAL_ITERATIONS, _MAX_STEPS, _MAX_HALVINGS = 8, 30, 12

#: The steps end when one reduces the squared error by a smaller relative amount.
_MIN_GAIN = 1e-7

#: Of a problem with more rows, a part is minimised first, and the steps on all rows start there. These end at
#: a larger gain: 1e-6 of 50 000 rows moves a parameter by a fifth of its standard error.
_MANY_ROWS, _PART, _MIN_FINAL_GAIN = 10_000, 4_000, 1e-6

#: Largest magnitude of a pole: an integrator is estimated with an error.
_LARGEST_POLE = 1.0 + 1e-3

#: A column that keeps a smaller fraction of its norm depends on those before it.
_DEPENDENT = 1e-11

#: Largest error relative to the least: a model with a larger one is not recommended.
_LARGEST_RATIO = 1.5

#: Samples and segments that are used, at most: the first samples, and of these the longest segments.
_LARGEST_SAMPLES, _LARGEST_SEGMENTS = 50_000, 16

#: Samples for each parameter, initial states included, that an estimate needs.
_SAMPLES_PER_PARAMETER = 5


def fit_output_error(
    record: Dataset, delays: Sequence[int] = (), lags: int = 4, max_terms: int = 10
) -> list[FittedStructure]:
    """Fit linear models of increasing order to the free run.

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
        Difference equations of x, one for each order at most, with a constant if it reduces the information
        criterion of Schwarz. Orders after two that do not reduce it are left out, also those whose error is
        much larger than the least.
    """
    record = record[:_LARGEST_SAMPLES]
    late = tuple(delays) or (0,) * record.inputs
    found: list[_Fit] = []
    least, failed = inf, 0
    for order in range(1, min(_LARGEST_ORDER, lags) + 1):
        problem = _make_problem(record, order, late, lags)
        best = _fit_order(problem, max_terms) if problem else None
        failed = 0 if best and best.criterion < least else failed + 1
        if best:
            found.append(best)
            least = min(least, best.criterion)
        if failed == _PATIENCE:
            break
    allowed = _LARGEST_RATIO**2 * min((each.mean_square for each in found), default=inf)
    return [_make_structure(each, record) for each in found if each.mean_square <= allowed]


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """Rows of a model of a given order.

    Attributes
    ----------
    order : int
    terms : tuple of Expression
        The past outputs, then the terms whose values are the columns.
    columns : ndarray, shape (columns, rows)
        Values of the terms with inputs and of the constant.
    y : ndarray, shape (rows,)
    ends : ndarray of int64, shape (segments,)
        Row after the last one of every segment.
    """

    order: int
    terms: tuple[Expression, ...]
    columns: NDArray[np.float64]
    y: NDArray[np.float64]
    ends: NDArray[np.int64]

    def lag(self, series: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a series one to ``order`` rows later, with zeros at the start of every segment."""
        lagged = np.zeros((self.order, series.size))
        for begin, end in self.bounds:
            for row in range(min(self.order, end - begin - 1)):
                lagged[row, begin + row + 1 : end] = series[begin : end - row - 1]
        return lagged

    def divide(self, denominator: NDArray[np.float64], series: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the responses to the initial states, ``order`` of every segment, and series divided by A."""
        longest = max(end - begin for begin, end in self.bounds)
        pulse = np.zeros((1, longest))
        pulse[0, 0] = 1.0
        (response,) = divide_rows(denominator, pulse, np.array([longest]))
        divided = np.zeros((self.states + len(series), self.y.size))
        for segment, (begin, end) in enumerate(self.bounds):
            for row in range(self.order):
                divided[segment * self.order + row, begin + row : end] = response[: end - begin - row]
        divided[self.states :] = divide_rows(denominator, series, self.ends)
        return divided

    def take_part(self, rows: int) -> "_Problem":
        """Return the problem of a number of consecutive rows, where the inputs vary most."""
        first_rows = np.arange(0, self.y.size - rows + 1, rows)
        with np.errstate(divide="ignore"):
            spreads = [np.log(self.columns[:, row : row + rows].var(axis=1)).sum() for row in first_rows]
        first = first_rows[np.argmax(spreads)]
        pieces = [(max(begin, first), min(end, first + rows)) for begin, end in self.bounds]
        kept = [np.arange(begin, end) for begin, end in pieces if end - begin > self.order]
        chosen, ends = np.concatenate(kept), np.cumsum([piece.size for piece in kept])
        return replace(self, columns=self.columns.take(chosen, axis=1), y=self.y[chosen], ends=ends)

    def with_constant(self) -> "_Problem":
        """Return the problem with a constant."""
        columns = np.vstack([self.columns, np.ones(self.y.size)])
        return replace(self, terms=(*self.terms, Constant(1.0)), columns=columns)

    @property
    def has_constant(self) -> bool:
        """Whether the last term is a constant."""
        return isinstance(self.terms[-1], Constant)

    @property
    def is_determined(self) -> bool:
        """Whether there are enough rows for the parameters and the initial states."""
        return self.y.size >= _SAMPLES_PER_PARAMETER * (len(self.terms) + self.states)

    @property
    def bounds(self) -> list[tuple[int, int]]:
        """First row of every segment, and the row after its last one."""
        ends = self.ends.tolist()
        return list(zip([0, *ends[:-1]], ends, strict=True))

    @property
    def states(self) -> int:
        """Number of initial states."""
        return self.order * self.ends.size


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """Simulation for a given A with the best other coefficients.

    Attributes
    ----------
    problem : _Problem
    denominator : ndarray, shape (order,)
        Coefficients of A after the leading 1.
    basis : ndarray, shape (columns, rows)
        Orthonormal basis of the initial states and the columns, divided by A.
    residual : ndarray, shape (rows,)
    squares : float
        Sum of squares of the residual.
    """

    problem: _Problem
    denominator: NDArray[np.float64]
    basis: NDArray[np.float64]
    residual: NDArray[np.float64]
    squares: float

    @property
    def mean_square(self) -> float:
        """Mean square of the residual."""
        return self.squares / self.residual.size

    @property
    def criterion(self) -> float:
        """Information criterion of Schwarz."""
        return _criterion(self.squares, self.residual.size, len(self.basis) + self.denominator.size)


def _make_problem(record: Dataset, order: int, delays: Sequence[int], lags: int) -> _Problem | None:
    """Return the rows of a model without a constant; None if no segment is long enough."""
    early = [parse_channel_name(name).at_once for name in record.input_names]
    read = [
        (place, delay + lag)
        for place, delay in enumerate(delays)
        for lag in range(1, min(order + early[place], lags) + 1)
    ]
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
    return _Problem(order, tuple(terms), np.array(columns), y, ends)


def _fit_order(problem: _Problem, max_terms: int) -> _Fit | None:
    """Return the model with the least criterion of those without and with a constant; None without any."""
    found = _fit_many_rows(problem, max_terms) if problem.y.size > _MANY_ROWS else None
    if found is not None:
        return found
    fits = []
    for each in (problem, problem.with_constant()):
        start = _initialise(each) if each.is_determined and len(each.terms) <= max_terms else None
        if start is not None:
            fits.append(_minimise(start, _MIN_GAIN))
    return min(fits, key=lambda each: each.criterion, default=None)


def _fit_many_rows(problem: _Problem, max_terms: int) -> _Fit | None:
    """Return the model that the steps on all rows find from the one of a part of them; None without that."""
    first = _fit_order(problem.take_part(_PART), max_terms)
    if first is None:
        return None
    start = _solve(problem.with_constant() if first.problem.has_constant else problem, first.denominator)
    if start is None:
        return None
    found = _minimise(start, _MIN_FINAL_GAIN)
    # A constant that a part of the rows does not show is small.
    if len(found.problem.terms) < max_terms and not found.problem.has_constant and _lacks_constant(found):
        start = _solve(problem.with_constant(), found.denominator)
        found = _minimise(start, _MIN_FINAL_GAIN) if start else found
    return found


def _criterion(squares: float, rows: int, count: int) -> float:
    """Return the information criterion of Schwarz."""
    return rows * log(max(squares / rows, np.finfo(float).tiny)) + count * log(rows)


def _lacks_constant(found: _Fit) -> bool:
    """Return whether a constant reduces the criterion of a model without one, to the first order."""
    rows = found.residual.size
    constant = divide_rows(found.denominator, np.ones((1, rows)), found.problem.ends)
    factored = _factor(np.vstack([found.basis, _differentiate(found), constant]), found.residual)
    if factored is None:
        return False
    reduced = found.squares - float(factored.projection[-1]) ** 2
    return _criterion(reduced, rows, 1) < _criterion(found.squares, rows, 0)


def _minimise(found: _Fit, least_gain: float) -> _Fit:
    """Return the model with the least error that Gauss-Newton steps find, up to a relative gain of a step."""
    for _ in range(_MAX_STEPS):
        order, before = found.denominator.size, found.squares
        solved = _project(np.vstack([found.basis, _differentiate(found)]), found.residual)
        if solved is None:
            break
        step = solved[-order:]
        for _ in range(_MAX_HALVINGS):
            moved = _solve(found.problem, found.denominator + step)
            if moved is not None and moved.squares < before:
                found = moved
                break
            step = step / 2.0
        if not found.squares < (1.0 - least_gain) * before:
            break
    return found


def _differentiate(found: _Fit) -> NDArray[np.float64]:
    """Return the derivatives of the simulation with respect to A, shape (order, rows)."""
    problem = found.problem
    # The simulation is what the residual leaves of the output.
    lagged = problem.lag(problem.y - found.residual)
    slopes: NDArray[np.float64] = -divide_rows(found.denominator, lagged, problem.ends)
    return slopes


def _initialise(problem: _Problem) -> _Fit | None:
    """Return the best solution of the iteration of Steiglitz and McBride, which begins with least squares."""
    # With an offset that the initial states and the constant take, the divided output remains small.
    y, ones = problem.y - problem.y[0], np.ones((1, problem.y.size))
    series = np.vstack([problem.columns, y] if problem.has_constant else [problem.columns, ones, y])
    denominator: NDArray[np.float64] = np.zeros(problem.order)
    best: _Fit | None = None
    for _ in range(_INITIAL_ITERATIONS):
        rows = problem.divide(denominator, series)
        solved = _project(np.vstack([rows[:-1], -problem.lag(rows[-1])]), rows[-1])
        if solved is None or not np.isfinite(solved).all():
            break
        denominator = _reflect(solved[-problem.order :])
        found = _solve(problem, denominator)
        if found is not None and (best is None or found.squares < best.squares):
            best = found
    return best


class _Factors(NamedTuple):
    """Factors of columns A = Q R, without Q."""

    triangle: NDArray[np.float64]
    projection: NDArray[np.float64]
    residual: NDArray[np.float64]


def _factor(columns: NDArray[np.float64], target: NDArray[np.float64]) -> _Factors | None:
    """Orthogonalise columns in place; return None if one depends on those before it."""
    count, residual = len(columns), np.array(target)
    triangle, projection = np.empty((count, count)), np.empty(count)
    if orthogonalise(columns, residual, triangle, projection, _DEPENDENT) >= 0:
        return None
    return _Factors(triangle, projection, residual)


def _project(columns: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the coefficients of least squares; None if a column depends on those before it.

    The columns are overwritten.
    """
    factored = _factor(columns, target)
    if factored is None:
        return None
    coefficients: NDArray[np.float64] = scipy.linalg.solve_triangular(factored.triangle, factored.projection)
    return coefficients


def _solve(problem: _Problem, denominator: NDArray[np.float64]) -> _Fit | None:
    """Return the simulation for A with the best other coefficients; None if A is unstable."""
    if not is_stable(denominator / _LARGEST_POLE ** np.arange(1, denominator.size + 1)):
        return None
    basis = problem.divide(denominator, problem.columns)
    factored = _factor(basis, problem.y)
    if factored is None:
        return None
    residual = factored.residual
    squares = float(dot(residual, 0, residual, 0, residual.size))
    return _Fit(problem, denominator, basis, residual, squares) if np.isfinite(squares) else None


def _reflect(denominator: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return A with unstable poles mirrored at the unit circle."""
    if is_stable(denominator):
        return denominator
    poles = np.roots(np.append(1.0, denominator))
    outside = np.abs(poles) > 1.0
    poles[outside] = 1.0 / poles[outside].conj()
    reflected: NDArray[np.float64] = np.real(np.poly(poles))[1:]
    return reflected


def _make_structure(found: _Fit, record: Dataset) -> FittedStructure:
    """Return the difference equation with its parameters and their standard errors."""
    problem = found.problem
    divided = np.roll(problem.divide(found.denominator, problem.columns), -problem.states, axis=0)
    slopes = -_differentiate(found)
    coefficients = _project(np.array(divided), problem.y)
    assert coefficients is not None, "the solution has independent columns"
    count = len(problem.columns)
    values = [*(-found.denominator).tolist(), *coefficients[:count].tolist()]
    variances = np.diag(sandwich_of_jacobian(np.vstack([slopes, divided]), found.residual))
    errors = np.sqrt(np.maximum(variances, 0.0))[: len(problem.terms)].tolist()
    terms = list(zip(problem.terms, values, strict=True))
    model = make_model(terms, record.input_names, record.output_name, record.dt)
    # The same order of the terms as that of the model, without the factors of the expressions, which are 1.
    ordered = make_model(list(zip(problem.terms, errors, strict=True)), record.input_names)
    assert ordered.regressors == model.regressors
    model = replace(model, standard_errors=ordered.theta, preprocessing=record.preprocessing)
    return FittedStructure(model, found.squares / max(1, problem.y.size - len(divided) - problem.order))
