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

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import inf, log

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
    found: list[tuple[_Problem, _Solution]] = []
    least, failed = inf, 0
    for order in range(1, min(_LARGEST_ORDER, lags) + 1):
        best = min(_fit_order(record, order, late, lags, max_terms), key=_criterion, default=None)
        failed = 0 if best and _criterion(best) < least else failed + 1
        if best:
            found.append(best)
            least = min(least, _criterion(best))
        if failed == _PATIENCE:
            break
    allowed = _LARGEST_RATIO**2 * min((solution.mean_square for _, solution in found), default=inf)
    return [_make_structure(*each, record) for each in found if each[1].mean_square <= allowed]


def _fit_order(
    record: Dataset, order: int, delays: Sequence[int], lags: int, max_terms: int
) -> Iterator[tuple["_Problem", "_Solution"]]:
    """Yield the models of an order, without and with a constant."""
    for constant in (False, True):
        problem = _make_problem(record, order, delays, lags, constant)
        if problem is not None and len(problem.terms) <= max_terms:
            solution = _minimise(problem)
            if solution is not None:
                yield problem, solution


def _criterion(fitted: tuple["_Problem", "_Solution"]) -> float:
    return fitted[1].criterion


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
    starts : ndarray, shape (order x segments, rows)
        Unit pulses at the first rows of every segment.
    y : ndarray, shape (rows,)
    ends : ndarray of int64, shape (segments,)
        Row after the last one of every segment.
    """

    order: int
    terms: tuple[Expression, ...]
    columns: NDArray[np.float64]
    starts: NDArray[np.float64]
    y: NDArray[np.float64]
    ends: NDArray[np.int64]

    def lag(self, series: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a series one to ``order`` rows later, with zeros at the start of every segment."""
        lagged = np.zeros((self.order, series.size))
        for begin, end in zip((0, *self.ends[:-1]), self.ends, strict=True):
            for row in range(min(self.order, end - begin - 1)):
                lagged[row, begin + row + 1 : end] = series[begin : end - row - 1]
        return lagged


@dataclass(frozen=True, slots=True, eq=False)
class _Solution:
    """Simulation for a given A.

    Attributes
    ----------
    denominator : ndarray, shape (order,)
        Coefficients of A after the leading 1.
    basis : ndarray, shape (columns, rows)
        Orthonormal basis of the initial states and the columns, divided by A.
    residual : ndarray, shape (rows,)
    squares : float
        Sum of squares of the residual.
    """

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
        rows, count = self.residual.size, len(self.basis) + self.denominator.size
        return rows * log(max(self.mean_square, np.finfo(float).tiny)) + count * log(rows)


def _make_problem(
    record: Dataset, order: int, delays: Sequence[int], lags: int, constant: bool
) -> _Problem | None:
    """Return the rows of a model; None if the record is too short."""
    early = [parse_channel_name(name).at_once for name in record.input_names]
    read = [
        (place, delay + lag)
        for place, delay in enumerate(delays)
        for lag in range(1, min(order + early[place], lags) + 1)
    ]
    first = max([order, *(lag for _, lag in read)])
    longest = sorted(record.bounds, key=lambda bounds: bounds[0] - bounds[1])[:_LARGEST_SEGMENTS]
    kept = sorted((begin, end) for begin, end in longest if end - begin > first + order)
    ends = np.cumsum([end - begin - first for begin, end in kept], dtype=np.int64)
    terms: list[Expression] = [Lagged(0, lag) for lag in range(1, order + 1)]
    terms += [Lagged(1 + place, lag) for place, lag in read]
    terms += [Constant(1.0)] if constant else []
    if not kept or ends[-1] < _SAMPLES_PER_PARAMETER * (len(terms) + order * len(kept)):
        return None
    columns = [
        np.concatenate([record.u[begin + first - lag : end - lag, place] for begin, end in kept])
        for place, lag in read
    ]
    columns += [np.ones(ends[-1])] if constant else []
    starts = np.zeros((order * len(kept), ends[-1]))
    for segment, begin in enumerate((0, *ends[:-1])):
        for row in range(order):
            starts[segment * order + row, begin + row] = 1.0
    y = np.concatenate([record.y[begin + first : end] for begin, end in kept])
    return _Problem(order, tuple(terms), np.array(columns), starts, y, ends)


def _minimise(problem: _Problem) -> _Solution | None:
    """Return the solution with the least error that the steps find; None if there is none."""
    found = _initialise(problem)
    for _ in range(_MAX_STEPS if found else 0):
        assert found is not None
        # The simulation is what the residual leaves of the output.
        slopes = -divide_rows(found.denominator, problem.lag(problem.y - found.residual), problem.ends)
        solved = _project(np.vstack([found.basis, slopes]), found.residual)
        if solved is None:
            break
        step, before = solved[-problem.order :], found.squares
        for _ in range(_MAX_HALVINGS):
            moved = _solve(problem, found.denominator + step)
            if moved is not None and moved.squares < before:
                found = moved
                break
            step = step / 2.0
        if not found.squares < (1.0 - _MIN_GAIN) * before:
            break
    return found


def _initialise(problem: _Problem) -> _Solution | None:
    """Return the best solution of the iteration of Steiglitz and McBride, which begins with least squares."""
    # With an offset that the initial states and the constant take, the divided output remains small.
    y, ones = problem.y - problem.y[0], np.ones((1, problem.y.size))
    fixed = np.vstack([problem.starts, problem.columns, ones])
    if isinstance(problem.terms[-1], Constant):
        fixed = fixed[:-1]
    denominator: NDArray[np.float64] = np.zeros(problem.order)
    best: _Solution | None = None
    for _ in range(_INITIAL_ITERATIONS):
        rows = divide_rows(denominator, np.vstack([fixed, y]), problem.ends)
        solved = _project(np.vstack([rows[:-1], -problem.lag(rows[-1])]), rows[-1])
        if solved is None or not np.isfinite(solved).all():
            break
        denominator = _reflect(solved[-problem.order :])
        found = _solve(problem, denominator)
        if found is not None and (best is None or found.squares < best.squares):
            best = found
    return best


def _project(columns: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the coefficients of least squares; None if a column depends on those before it."""
    triangle, projection = np.empty((len(columns), len(columns))), np.empty(len(columns))
    if orthogonalise(np.array(columns), np.array(target), triangle, projection, _DEPENDENT) >= 0:
        return None
    coefficients: NDArray[np.float64] = scipy.linalg.solve_triangular(triangle, projection)
    return coefficients


def _solve(problem: _Problem, denominator: NDArray[np.float64]) -> _Solution | None:
    """Return the simulation for A with the best other coefficients; None if A is unstable."""
    if not is_stable(denominator / _LARGEST_POLE ** np.arange(1, denominator.size + 1)):
        return None
    basis = divide_rows(denominator, np.vstack([problem.starts, problem.columns]), problem.ends)
    residual = np.array(problem.y)
    triangle, projection = np.empty((len(basis), len(basis))), np.empty(len(basis))
    if orthogonalise(basis, residual, triangle, projection, _DEPENDENT) >= 0:
        return None
    squares = float(dot(residual, 0, residual, 0, residual.size))
    return _Solution(denominator, basis, residual, squares) if np.isfinite(squares) else None


def _reflect(denominator: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return A with unstable poles mirrored at the unit circle."""
    if is_stable(denominator):
        return denominator
    poles = np.roots(np.append(1.0, denominator))
    outside = np.abs(poles) > 1.0
    poles[outside] = 1.0 / poles[outside].conj()
    reflected: NDArray[np.float64] = np.real(np.poly(poles))[1:]
    return reflected


def _make_structure(problem: _Problem, found: _Solution, record: Dataset) -> FittedStructure:
    """Return the difference equation with its parameters and their standard errors."""
    divided = divide_rows(found.denominator, np.vstack([problem.columns, problem.starts]), problem.ends)
    slopes = divide_rows(found.denominator, problem.lag(problem.y - found.residual), problem.ends)
    coefficients = _project(divided, problem.y)
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
